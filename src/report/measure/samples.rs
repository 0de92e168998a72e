use super::Stopwatch;

/// Repeats of one measurement.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples(Vec<f64>);

impl Samples {
    /// Adds a value.
    pub fn push(&mut self, value: f64) {
        self.0.push(value);
    }

    /// Runs `work`, in the current rayon pool, and adds the seconds it took.
    pub fn time<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let watch = Stopwatch::pool();
        let out = work();
        self.push(watch.seconds());
        out
    }

    /// The values in the order they came.
    pub fn values(&self) -> &[f64] {
        &self.0
    }

    /// The middle value, or the mean of the two; `None` without values.
    pub fn median(&self) -> Option<f64> {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        (n > 0).then(|| f64::midpoint(sorted[(n - 1) / 2], sorted[n / 2]))
    }

    /// Half the distance of the extremes in percent of the median; `None` with fewer than two values.
    pub fn spread(&self) -> Option<f64> {
        let least = self.0.iter().copied().fold(f64::INFINITY, f64::min);
        let most = self.0.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        self.median().filter(|&m| m > 0.0 && self.0.len() > 1).map(|m| 50.0 * (most - least) / m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_and_half_the_range_are_reported() {
        let mut samples = Samples::default();
        assert_eq!((samples.median(), samples.spread()), (None, None));
        samples.push(3.0);
        assert_eq!((samples.median(), samples.spread()), (Some(3.0), None));
        samples.push(1.0);
        samples.push(2.0);
        assert_eq!((samples.median(), samples.spread()), (Some(2.0), Some(50.0)));
    }
}
