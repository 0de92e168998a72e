//! What code that threads share is made of. `tests/swap_model.rs` compiles the same code over a model checker's types instead.

pub(super) use std::{
    sync::{Arc, Condvar, Mutex, MutexGuard},
    thread,
};
