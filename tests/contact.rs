//! The hard scene of contacts.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

#[path = "common/ccd.rs"]
mod ccd;
mod common;
#[path = "hard_scenes/h12_contact.rs"]
mod h12_contact;
#[path = "common/trace.rs"]
mod trace;
