//! What a walk leaves for rays that begin where it ended, and what a camera shares with all of its rays.

/// Cursors in one open volume.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seat {
    pub(super) volume: u32,
    pub(super) cursors: [u32; 3],
}

/// Cursors at a point: three integers for each volume around it, and in the flat form the boxes around it.
///
/// A ray that begins there, or nearby, starts from them by a short walk instead of a search. Rays that begin anywhere else
/// and states of other structures, or of the structure before a refit, cost time but change no answer.
#[derive(Clone, Debug, Default)]
pub struct EventState {
    /// Of the structure that the cursors were made with; 0 when there are none.
    pub(super) stamp: u64,
    pub(super) seats: Vec<Seat>,
    /// Boxes that hold the point; of the flat form.
    pub(super) inside: Vec<u32>,
    /// Where the next state is written while this one is read.
    pub(super) next_seats: Vec<Seat>,
    pub(super) next_inside: Vec<u32>,
}

impl EventState {
    /// Forgets everything but the memory.
    pub(super) fn clear(&mut self) {
        self.stamp = 0;
        self.seats.clear();
        self.inside.clear();
    }

    /// Makes what was written next the state.
    pub(super) fn take_next(&mut self, stamp: u64) {
        self.stamp = stamp;
        std::mem::swap(&mut self.seats, &mut self.next_seats);
        std::mem::swap(&mut self.inside, &mut self.next_inside);
    }
}
