use std::path::Path;

use serde::Serialize;
use serde_json::{Value, json};

use super::{Check, Machine, Plot, ReportError, Table, date};
use crate::output::{Unfinished, atomic};

/// Version of the JSON's form. It changes when a field is renamed or changes its meaning.
pub const SCHEMA: u32 = 1;

/// Which report it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The papers' tables beside ours.
    Papers,
    /// Every acceleration structure on every scene.
    Structures,
    /// Policies of the frame loop, frame by frame.
    Frames,
    /// Speed against error.
    Accuracy,
}

impl Kind {
    /// The reports that exist.
    pub const ALL: [Self; 4] = [Self::Papers, Self::Structures, Self::Frames, Self::Accuracy];

    /// Name on the command line and of the files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Papers => "papers",
            Self::Structures => "structures",
            Self::Frames => "frames",
            Self::Accuracy => "accuracy",
        }
    }
}

/// What a report was asked to measure, and how.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Settings {
    /// Fewer scenes, rays and repeats: under a minute on two cores.
    pub quick: bool,
    /// Worker threads.
    pub threads: usize,
    /// SIMD level of the kernels.
    pub simd: &'static str,
    /// How exact hits are.
    pub precision: &'static str,
    /// Scenes asked for; empty means the default ones.
    pub scenes: Vec<String>,
    /// Structures measured, with their settings.
    pub structures: Vec<String>,
}

/// A finished report.
#[derive(Clone, Debug)]
pub struct Report {
    /// Which one.
    pub kind: Kind,
    /// What was asked for.
    pub settings: Settings,
    /// What it ran on.
    pub machine: Machine,
    /// The day, `YYYY-MM-DD` in UTC.
    pub date: String,
    /// What a reader learns first, a paragraph (or list, or table) of Markdown each.
    pub summary: Vec<String>,
    /// The rows.
    pub tables: Vec<Table>,
    /// Bounds and targets.
    pub checks: Vec<Check>,
    /// The plots.
    pub plots: Vec<Plot>,
}

/// The commit that the program was built from: the variable `KINORA_COMMIT` while it was compiled.
pub(super) const COMMIT: &str = match option_env!("KINORA_COMMIT") {
    Some(commit) => commit,
    None => "unknown",
};

impl Report {
    /// A report of today on this machine, still without rows.
    pub fn new(kind: Kind, settings: Settings) -> Self {
        let (machine, date) = (Machine::this(), date::today());
        Self {
            kind,
            settings,
            machine,
            date,
            summary: Vec::new(),
            tables: Vec::new(),
            checks: Vec::new(),
            plots: Vec::new(),
        }
    }

    /// Bounds that were missed.
    pub fn missed(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|c| c.is_missed())
    }

    /// The rows of a table by its name.
    pub fn table(&self, name: &str) -> Option<&Table> {
        self.tables.iter().find(|t| t.name == name)
    }

    /// Schema version, machine, commit, settings, checks and the rows of all tables.
    pub fn json(&self) -> Value {
        let check = |c: &Check| json!({ "claim": c.claim, "bound": c.bound, "value": c.value, "verdict": c.verdict() });
        json!({
            "schema": SCHEMA,
            "kind": self.kind.name(),
            "program": concat!("kinora ", env!("CARGO_PKG_VERSION")),
            "commit": COMMIT,
            "date": self.date,
            "machine": self.machine,
            "settings": self.settings,
            "checks": self.checks.iter().map(check).collect::<Vec<_>>(),
            "plots": self.plots.iter().map(Plot::file).collect::<Vec<_>>(),
            "rows": self.tables.iter().flat_map(Table::json).collect::<Vec<_>>(),
        })
    }

    /// Writes `KIND.json`, `KIND.md` and the plots into `folder`, which is made when it is missing; each file appears when it is
    /// complete. Returns their names in order of writing.
    ///
    /// # Errors
    /// When the folder cannot be written, or a plot not be drawn.
    pub fn write(&self, folder: &Path, unfinished: &Unfinished) -> Result<Vec<String>, ReportError> {
        let mut json = serde_json::to_vec_pretty(&self.json()).unwrap_or_default();
        json.push(b'\n');
        let mut files = Vec::new();
        for plot in &self.plots {
            files.push((plot.file(), plot.svg()?.into_bytes()));
        }
        files.push((format!("{}.md", self.kind.name()), self.markdown().into_bytes()));
        files.push((format!("{}.json", self.kind.name()), json));
        for (name, bytes) in &files {
            let path = folder.join(name);
            atomic::prepare(&path)?;
            atomic::write_file(&path, bytes, unfinished)?;
        }
        Ok(files.into_iter().map(|f| f.0).collect())
    }
}
