//! Casting rays timed, casting them counted, and what repeats of a time say.

mod cast;
mod clock;
mod counts;
mod samples;

pub use cast::{Answer, Ask, Caster};
pub use clock::Stopwatch;
pub use counts::Counts;
pub use samples::Samples;
