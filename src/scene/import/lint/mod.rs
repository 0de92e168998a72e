//! Warnings about what breaks the specification without harming the import: unused objects, missing
//! bounds, alignment, undeclared extensions. Runs last, reads the document only, and never fails.

mod accessors;
mod extensions;
mod geometry;
mod structure;

pub(super) use extensions::undeclared;

use super::context::Context;

/// Warns about everything that the conversion had no reason to look at.
pub(super) fn run(cx: &Context<'_>) {
    structure::check(cx);
    accessors::check(cx);
    geometry::check(cx);
    extensions::check(cx);
}
