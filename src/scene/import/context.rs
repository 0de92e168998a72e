//! What every import step needs: the document, its data, the memory budget, and a place for warnings.

use std::{
    cell::{Cell, RefCell},
    fmt::Display,
};

use super::{
    buffers::Buffers,
    error::{Problem, Step, one_line},
    json::Document,
};

/// At most this many warnings are kept; the rest is counted.
const MAX_WARNINGS: usize = 100;

/// Warnings collected during an import.
#[derive(Debug, Default)]
pub(super) struct Warnings {
    list: RefCell<Vec<String>>,
    dropped: Cell<usize>,
}

impl Warnings {
    /// Keeps `place: text`.
    pub(super) fn add(&self, place: impl Display, text: impl Display) {
        let mut list = self.list.borrow_mut();
        if list.len() < MAX_WARNINGS {
            list.push(one_line(&format!("{place}: {text}")));
        } else {
            self.dropped.set(self.dropped.get() + 1);
        }
    }

    /// Keeps what went wrong at a place as a warning.
    pub(super) fn add_problem(&self, problem: &Problem, consequence: &str) {
        self.add(problem.place(), format_args!("{}; {consequence}", problem.reason()));
    }

    /// Everything collected, in order.
    pub(super) fn finish(self) -> Vec<String> {
        let mut list = self.list.into_inner();
        match self.dropped.get() {
            0 => {}
            n => list.push(format!("and {n} more warnings")),
        }
        list
    }
}

/// Memory that decoded data may take, so that a small file cannot ask for all of the machine's.
#[derive(Debug)]
pub(super) struct Budget {
    limit: u64,
    left: Cell<u64>,
}

impl Budget {
    /// Bytes allowed whatever the file's size.
    const BASE: u64 = 176 << 20;
    /// Bytes allowed for each byte of the file and of the files it names.
    const PER_BYTE: u64 = 24;

    /// The budget of a file without the files it names.
    pub(super) fn new(file_size: usize) -> Self {
        let limit = Self::BASE.saturating_add(Self::PER_BYTE.saturating_mul(file_size as u64));
        Self { limit, left: Cell::new(limit) }
    }

    /// Widens the budget for another file of this size.
    pub(super) fn grow(&self, file_size: usize) {
        self.left.set(self.left.get().saturating_add(Self::PER_BYTE.saturating_mul(file_size as u64)));
    }

    /// Takes `count` elements of `size` bytes out of the budget.
    pub(super) fn take(&self, count: usize, size: usize, place: impl Display) -> Step<()> {
        let needed = (count as u64).saturating_mul(size as u64);
        let left = self.left.get();
        let Some(rest) = left.checked_sub(needed) else {
            return Err(Problem::TooLarge { place: place.to_string(), needed, left, limit: self.limit });
        };
        self.left.set(rest);
        Ok(())
    }

    /// Bytes left.
    pub(super) fn left(&self) -> u64 {
        self.left.get()
    }
}

/// What every import step needs.
#[derive(Debug)]
pub(super) struct Context<'a> {
    pub(super) doc: &'a Document<'a>,
    pub(super) buffers: Buffers<'a>,
    pub(super) budget: &'a Budget,
    pub(super) warnings: &'a Warnings,
}

/// Checks that `index` names one of `count` objects.
pub(super) fn check_index(index: usize, count: usize, place: impl Display, kind: &str) -> Step<usize> {
    if index < count {
        return Ok(index);
    }
    let reason = match count {
        0 => format!("{kind} {index}, but the file has none"),
        _ => format!("{kind} {index}, but the last is {}", count - 1),
    };
    Err(Problem::at(place, reason))
}

/// A file's number as `f32`; what overflows becomes the largest finite value.
#[expect(clippy::cast_possible_truncation, reason = "rounding is wanted")]
pub(super) fn to_f32(value: f64) -> f32 {
    (value as f32).clamp(f32::MIN, f32::MAX)
}
