//! What a structure may take before it is left out with a row that says so.

use crate::report::machine::held_memory;

/// Memory of the whole process in bytes: 12 GiB.
pub(super) const MEMORY: u64 = 12 << 30;

/// What the next build is expected to take, from the last smaller one of the same structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Foresight {
    triangles: usize,
    build_s: f64,
    bytes: u64,
}

impl Foresight {
    /// What a build over `triangles` took, and what it left.
    pub(super) fn new(triangles: usize, build_s: f64, total_bytes: usize) -> Self {
        Self { triangles, build_s, bytes: total_bytes as u64 }
    }

    /// Why a build over `triangles` should not be begun, if so: too long, or too much memory.
    ///
    /// Builds take a little more than linear time; a build holds up to three times the finished structure, and 100 bytes a triangle.
    pub(super) fn objection(&self, triangles: usize, most_seconds: f64) -> Option<String> {
        let factor = triangles as f64 / self.triangles.max(1) as f64;
        let seconds = self.build_s * factor * 1.2;
        if seconds > most_seconds {
            return Some(format!("left out: the build would take about {seconds:.0} s"));
        }
        let bytes = self.bytes as f64 * factor * 3.0 + 100.0 * triangles as f64;
        let total = bytes + held_memory().unwrap_or(0) as f64;
        (total > MEMORY as f64)
            .then(|| format!("left out: the process would need up to {:.1} GiB", total / f64::from(1 << 30)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn builds_too_long_or_too_large_are_foreseen() {
        let seen = Foresight::new(1000, 0.001, 100_000);
        assert_eq!(seen.objection(10_000, 1.0), None);
        assert!(seen.objection(10_000_000, 1.0).unwrap().contains("12 s"));
        assert!(seen.objection(100_000_000, 1e9).unwrap().contains("GiB"));
    }
}
