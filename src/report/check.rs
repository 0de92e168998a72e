use serde::Serialize;

/// What a checked value must be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    /// This or more.
    AtLeast(f64),
    /// This or less.
    AtMost(f64),
    /// Within both, ends included.
    Between(f64, f64),
    /// This, exactly.
    Exactly(f64),
}

impl Bound {
    /// True when `value` keeps it; never for NaN.
    pub fn holds(self, value: f64) -> bool {
        match self {
            Self::AtLeast(least) => value >= least,
            Self::AtMost(most) => value <= most,
            Self::Between(least, most) => (least..=most).contains(&value),
            Self::Exactly(due) => value.total_cmp(&due).is_eq(),
        }
    }
}

impl std::fmt::Display for Bound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::AtLeast(x) => write!(f, "at least {x}"),
            Self::AtMost(x) => write!(f, "at most {x}"),
            Self::Between(x, y) => write!(f, "{x} to {y}"),
            Self::Exactly(x) => write!(f, "{x}"),
        }
    }
}

/// A stated bound or target with what was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// What is claimed, and of what.
    pub claim: String,
    /// What the value must be.
    pub bound: Bound,
    /// What it is; absent when there was nothing to measure, which misses no bound.
    pub value: Option<f64>,
}

impl Check {
    /// A claim with its bound and the value found.
    pub fn new(claim: impl Into<String>, bound: Bound, value: impl Into<Option<f64>>) -> Self {
        Self { claim: claim.into(), bound, value: value.into() }
    }

    /// True when a value was found and breaks the bound.
    pub fn is_missed(&self) -> bool {
        self.value.is_some_and(|value| !self.bound.holds(value))
    }

    /// `kept`, `missed` or `not measured`.
    pub fn verdict(&self) -> &'static str {
        match self.value {
            None => "not measured",
            Some(_) if self.is_missed() => "missed",
            Some(_) => "kept",
        }
    }
}

impl std::fmt::Display for Check {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let value = self.value.map_or_else(String::new, |v| format!("{v:.4}, "));
        write!(f, "{}: {value}due {}: {}", self.claim, self.bound, self.verdict())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_kept_at_their_ends_and_never_by_nan() {
        for (bound, kept, missed) in [
            (Bound::AtLeast(0.5), 0.5, 0.499),
            (Bound::AtMost(0.5), 0.5, 0.501),
            (Bound::Between(1.0, 2.0), 2.0, 2.001),
            (Bound::Exactly(0.25), 0.25, 0.250_001),
        ] {
            assert!(!Check::new("a", bound, kept).is_missed());
            assert!(Check::new("a", bound, missed).is_missed());
            assert!(Check::new("a", bound, f64::NAN).is_missed());
            assert_eq!(Check::new("a", bound, None).verdict(), "not measured");
        }
    }
}
