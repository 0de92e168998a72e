use super::ranks::RankWord;
use crate::accel::AccelConfig;

/// Most cells an axis.
const MAX_GRID: usize = 16;

/// Greatest threshold.
const MAX_THRESHOLD: usize = 1024;

// A volume holds the objects of a leaf, an element a cell, or two elements.
const _: () = assert!(2 * MAX_GRID.pow(3) <= <u64 as RankWord>::MAX_EVENTS);
const _: () = assert!(2 * MAX_THRESHOLD <= <u64 as RankWord>::MAX_EVENTS);

/// Whether boxes stand in one set of lists or in a hierarchy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// Three lists over all boxes.
    Flat,
    /// Volumes with three lists each.
    #[default]
    Tree,
}

/// Build settings of `events`. All but the form concern the hierarchy only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EventsConfig {
    /// `flat` or `tree`.
    pub form: Form,
    /// Cells an axis of the grid on a volume, 2 to 16.
    pub grid: usize,
    /// Volumes of at most this many objects are not divided, 1 to 1024.
    pub threshold: usize,
    /// When all centres lie in one cell, objects whose extent is more than this part of the volume's, on two axes or else
    /// on one, are put apart; 0.01 to 1.
    pub large: f64,
}

impl Default for EventsConfig {
    fn default() -> Self {
        Self { form: Form::Tree, grid: 2, threshold: 4, large: 0.5 }
    }
}

fn number(value: &str, least: usize, most: usize) -> Result<usize, String> {
    let number = value.parse().ok().filter(|n| (least..=most).contains(n));
    number.ok_or_else(|| format!("`{value}` is not a number from {least} to {most}"))
}

impl AccelConfig for EventsConfig {
    const KEYS: &'static [&'static str] = &["form", "grid", "threshold", "large"];

    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        match key {
            "form" => {
                self.form = match value {
                    "flat" => Form::Flat,
                    "tree" => Form::Tree,
                    _ => return Err(format!("`{value}` is neither flat nor tree")),
                }
            }
            "grid" => self.grid = number(value, 2, MAX_GRID)?,
            "threshold" => self.threshold = number(value, 1, MAX_THRESHOLD)?,
            _ => {
                let part = value.parse().ok().filter(|part| (0.01..=1.0).contains(part));
                self.large = part.ok_or_else(|| format!("`{value}` is not a number from 0.01 to 1"))?;
            }
        }
        Ok(())
    }
}
