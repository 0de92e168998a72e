#[cfg(unix)]
use rustix::time::{ClockId, clock_gettime};
use std::time::Instant;

/// Seconds since it was started: of processor time of this thread where the system tells and the thread works alone, else of
/// the wall clock.
///
/// Processor time does not count what other programs take; it is what makes figures of a shared machine comparable.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    wall: Instant,
    cpu: Option<f64>,
}

impl Stopwatch {
    /// For work that this thread does by itself.
    pub fn thread() -> Self {
        Self { wall: Instant::now(), cpu: thread_seconds() }
    }

    /// For work in the current rayon pool, where each thread does a part.
    pub fn pool() -> Self {
        if rayon::current_num_threads() == 1 {
            return Self::thread();
        }
        Self { wall: Instant::now(), cpu: None }
    }

    /// Seconds since the start; call it from the thread that started it.
    pub fn seconds(&self) -> f64 {
        match (self.cpu, thread_seconds()) {
            (Some(start), Some(now)) => now - start,
            _ => self.wall.elapsed().as_secs_f64(),
        }
    }
}

#[cfg(unix)]
#[expect(clippy::unnecessary_wraps, reason = "other systems do not tell")]
fn thread_seconds() -> Option<f64> {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Some(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
}

#[cfg(not(unix))]
fn thread_seconds() -> Option<f64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn sleep_takes_no_processor_time() {
        let (wall, cpu) = (Instant::now(), Stopwatch::thread());
        std::thread::sleep(std::time::Duration::from_millis(30));
        assert!(cpu.seconds() < 0.02 && wall.elapsed().as_secs_f64() >= 0.03);
    }
}
