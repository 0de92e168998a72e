//! What changed against an earlier report.

use std::{collections::HashMap, fmt, fs, path::Path};

use serde_json::Value;

use super::{Bound, Check, Report, ReportError, Role, SCHEMA, Table};

/// Largest file that is read.
const MAX_BYTES: u64 = 1 << 28;

/// Clocked values that differ by less than this share are not reported.
const NOISE: f64 = 0.10;

/// With `--check`, a clocked value may be worse than before by this factor.
const TOLERANCE: f64 = 1.5;

/// The rows of an earlier report.
#[derive(Clone, Debug)]
pub struct Baseline {
    rows: Vec<Value>,
    date: String,
    commit: String,
}

/// A value that differs.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Table, row and column.
    pub what: String,
    /// Earlier value.
    pub before: f64,
    /// Value now.
    pub now: f64,
    /// How many times worse it became; below 1 is better. Absent when neither is.
    pub worse: f64,
    /// Measured by the clock, so that it differs from run to run.
    pub clocked: bool,
}

/// Everything that differs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Changes {
    /// Values in both that differ.
    pub values: Vec<Change>,
    /// Rows that were not there before.
    pub new_rows: usize,
    /// Rows that are no longer there.
    pub lost_rows: usize,
}

impl Baseline {
    /// Reads `KIND.json` of an earlier run.
    ///
    /// # Errors
    /// When it cannot be read, is no report, is of another kind or another schema version.
    pub fn read(file: &Path, kind: super::Kind) -> Result<Self, ReportError> {
        let fail = |reason: String| ReportError::Baseline { file: file.display().to_string(), reason };
        let size = fs::metadata(file).map_err(|e| fail(format!("cannot read: {e}")))?.len();
        if size > MAX_BYTES {
            return Err(fail(format!("{size} bytes; a report has at most {MAX_BYTES}")));
        }
        let bytes = fs::read(file).map_err(|e| fail(format!("cannot read: {e}")))?;
        let value: Value = serde_json::from_slice(&bytes).map_err(|e| fail(format!("no report: {e}")))?;
        if value["schema"] != SCHEMA {
            return Err(fail(format!("schema version {}, expected {SCHEMA}", value["schema"])));
        }
        if value["kind"] != kind.name() {
            return Err(fail(format!("a report of kind {}, expected \"{}\"", value["kind"], kind.name())));
        }
        let text = |key: &str| value[key].as_str().unwrap_or("unknown").to_owned();
        let rows = value["rows"].as_array().ok_or_else(|| fail("it has no rows".to_owned()))?;
        Ok(Self { rows: rows.clone(), date: text("date"), commit: text("commit") })
    }

    /// Compares every value whose column says what is better.
    pub fn compare(&self, report: &Report) -> Changes {
        let mut before: HashMap<String, &Value> = HashMap::new();
        for row in &self.rows {
            let table = report.tables.iter().find(|t| row["table"] == t.name);
            if let Some(table) = table {
                before.insert(identity(table, row), row);
            }
        }
        let mut changes = Changes::default();
        let mut found = 0;
        for table in &report.tables {
            for row in table.json() {
                let id = identity(table, &row);
                match before.get(&id) {
                    None => changes.new_rows += 1,
                    Some(old) => {
                        found += 1;
                        changes.values.extend(differences(table, &id, old, &row));
                    }
                }
            }
        }
        changes.lost_rows = self.rows.len() - found.min(self.rows.len());
        changes
    }

    /// When it was made, and of what.
    pub fn origin(&self) -> String {
        format!("{} (commit {})", self.date, self.commit)
    }
}

/// Table and id columns of a row.
fn identity(table: &Table, row: &Value) -> String {
    let ids = table.columns.iter().filter(|c| c.role == Role::Id);
    let words = ids.map(|c| match &row[c.key] {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    });
    std::iter::once(table.name.to_owned()).chain(words).collect::<Vec<_>>().join(" / ")
}

fn differences(table: &Table, id: &str, before: &Value, now: &Value) -> Vec<Change> {
    let mut changes = Vec::new();
    for column in table.columns {
        let (clocked, more) = match column.role {
            Role::Id | Role::Note => continue,
            Role::Less => (false, false),
            Role::More => (false, true),
            Role::Sooner => (true, false),
            Role::Faster => (true, true),
        };
        let (Some(old), Some(new)) = (before[column.key].as_f64(), now[column.key].as_f64()) else { continue };
        let ratio = if old.total_cmp(&new).is_eq() { 1.0 } else { new / old };
        let worse = if more { 1.0 / ratio } else { ratio };
        let least = if clocked { NOISE } else { 0.0 };
        if (ratio - 1.0).abs() > least {
            let what = format!("{id} / {}", column.key);
            changes.push(Change { what, before: old, now: new, worse, clocked });
        }
    }
    changes
}

impl Changes {
    /// Bounds that hold against the earlier report: no counted value became worse, no clocked one by more than half.
    pub fn checks(&self) -> Vec<Check> {
        let of = |clocked| self.values.iter().filter(move |c| c.clocked == clocked);
        let counted = of(false).filter(|c| c.worse > 1.0).count() as f64;
        let slower = of(true).filter(|c| c.worse > TOLERANCE).count() as f64;
        vec![
            Check::new("counted values worse than the baseline", Bound::Exactly(0.0), counted),
            Check::new(
                format!("clocked values more than {TOLERANCE} times worse than the baseline"),
                Bound::Exactly(0.0),
                slower,
            ),
        ]
    }
}

impl fmt::Display for Changes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for Change { what, before, now, worse, clocked } in &self.values {
            let verdict = match *worse {
                w if w > 1.0 => "worse",
                w if w < 1.0 => "better",
                _ => "changed",
            };
            let kind = if *clocked { "clocked" } else { "counted" };
            writeln!(f, "{verdict}: {what}: {before:.4} -> {now:.4} ({:+.1} %, {kind})", (now / before - 1.0) * 100.0)?;
        }
        writeln!(f, "{} values changed, {} rows new, {} gone", self.values.len(), self.new_rows, self.lost_rows)
    }
}
