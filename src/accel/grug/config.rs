use super::{build::MAX_RES, table::CellOrder};
use crate::accel::{AccelConfig, kdtree::KdConfig};

/// How rays get from one group to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepMode {
    /// Cell by cell until the group is left, as in the paper.
    Dda,
    /// At once, to the plane by which the ray leaves the group.
    Exit,
}

/// Build settings of `grug`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrugConfig {
    /// Cells along each axis, a power of two from 4 to 512; `None` (`res=auto`) takes the first with eight cells a group or more.
    pub res: Option<u32>,
    /// How rays get from one group to the next.
    pub mode: StepMode,
    /// Order of the cells in the table.
    pub order: CellOrder,
    /// Settings of the trees.
    pub tree: KdConfig,
}

impl Default for GrugConfig {
    fn default() -> Self {
        Self { res: None, mode: StepMode::Exit, order: CellOrder::Concatenated, tree: KdConfig::default() }
    }
}

impl AccelConfig for GrugConfig {
    const KEYS: &'static [&'static str] = &["res", "mode", "order", "bins", "block_cost", "empty_bonus", "clip"];

    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        match (key, value) {
            ("res", "auto") => self.res = None,
            ("res", _) => {
                let res = value.parse().ok().filter(|r: &u32| r.is_power_of_two() && (4..=MAX_RES).contains(r));
                self.res =
                    Some(res.ok_or_else(|| {
                        format!("`{value}` is neither `auto` nor a power of two from 4 to {MAX_RES}")
                    })?);
            }
            ("mode", "dda") => self.mode = StepMode::Dda,
            ("mode", "exit") => self.mode = StepMode::Exit,
            ("mode", _) => return Err(format!("`{value}` is neither `dda` nor `exit`")),
            ("order", "concatenated") => self.order = CellOrder::Concatenated,
            ("order", "morton") => self.order = CellOrder::Interleaved,
            ("order", _) => return Err(format!("`{value}` is neither `concatenated` nor `morton`")),
            _ => self.tree.set(key, value)?,
        }
        Ok(())
    }
}
