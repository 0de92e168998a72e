//! A report as Markdown: what it ran on, the bounds, the tables, the plots.

use std::fmt::Write;

use super::{Cell, Report, Role, Table, record::COMMIT};

impl Report {
    /// The report as Markdown.
    pub fn markdown(&self) -> String {
        let mut out = format!("# kinora report {}\n\n", self.kind.name());
        out += &self.preamble();
        for paragraph in &self.summary {
            let _ = write!(out, "\n{paragraph}\n");
        }
        out += &self.bounds();
        for table in self.tables.iter().filter(|t| !t.json_only) {
            out += &format_table(table);
        }
        out += &self.elsewhere();
        if !self.plots.is_empty() {
            out += "\n## Plots\n";
            for plot in &self.plots {
                let _ = write!(out, "\n![{}]({})\n", plot.title, plot.file());
            }
        }
        out
    }

    /// Names the tables that are in JSON only.
    fn elsewhere(&self) -> String {
        let tables: Vec<&Table> = self.tables.iter().filter(|t| t.json_only).collect();
        if tables.is_empty() {
            return String::new();
        }
        let mut out = format!("\n## In `{}.json`\n\n", self.kind.name());
        for table in tables {
            let _ = writeln!(
                out,
                "- `{}`, {} rows: {}. {}",
                table.name,
                table.rows.len(),
                table.title,
                table.notes.join(" ")
            );
        }
        out
    }

    fn preamble(&self) -> String {
        let (m, s) = (&self.machine, &self.settings);
        let memory = m.memory_bytes.map_or_else(String::new, |b| format!(", {:.0} GiB", b as f64 / f64::from(1 << 30)));
        let quick = if s.quick { ", quick" } else { "" };
        format!(
            "{}, commit {COMMIT}, on {} ({} cores{memory}, {}, {}); {} threads, kernels for {}, {} precision{quick}.\n",
            self.date, m.cpu, m.cores, m.simd, m.os, s.threads, s.simd, s.precision
        )
    }

    fn bounds(&self) -> String {
        if self.checks.is_empty() {
            return String::new();
        }
        let mut out = "\n## Bounds and targets\n\n| claim | due | found | verdict |\n|---|---|---:|---|\n".to_owned();
        for check in &self.checks {
            let value = check.value.map_or_else(|| "-".to_owned(), |v| number(v, 3));
            let _ = writeln!(out, "| {} | {} | {value} | {} |", escaped(&check.claim), check.bound, check.verdict());
        }
        out
    }
}

fn format_table(table: &Table) -> String {
    let mut out = format!("\n## {}\n", table.title);
    for note in &table.notes {
        let _ = write!(out, "\n{note}\n");
    }
    // Columns that are empty in every row say nothing.
    let shown: Vec<usize> = (0..table.columns.len())
        .filter(|&i| table.columns[i].role == Role::Id || table.rows.iter().any(|r| r[i] != Cell::Absent))
        .collect();
    let is_text = |i: usize| table.rows.iter().all(|r| matches!(r[i], Cell::Text(_) | Cell::Flag(_) | Cell::Absent));
    let line = |cells: &mut dyn Iterator<Item = String>| format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "));
    out += "\n";
    out += &line(&mut shown.iter().map(|&i| table.columns[i].head.to_owned()));
    let rule = |&i: &usize| if is_text(i) { "---" } else { "---:" };
    let _ = writeln!(out, "|{}|", shown.iter().map(rule).collect::<Vec<_>>().join("|"));
    for row in &table.rows {
        out += &line(&mut shown.iter().map(|&i| cell(&row[i], table.columns[i].digits)));
    }
    out
}

fn cell(cell: &Cell, digits: usize) -> String {
    match cell {
        Cell::Text(text) => escaped(text),
        Cell::Count(n) => grouped(*n),
        Cell::Number(x) => number(*x, digits),
        Cell::Flag(is) => if *is { "yes" } else { "no" }.to_owned(),
        Cell::Absent => "-".to_owned(),
    }
}

fn escaped(text: &str) -> String {
    text.replace('|', "\\|").replace(['\n', '\r'], " ")
}

/// Decimals as asked for, and more where they would leave fewer than two digits that say something.
fn number(x: f64, digits: usize) -> String {
    if !x.is_finite() {
        return "-".to_owned();
    }
    let needed = if x == 0.0 { 0.0 } else { 1.0 - libm::floor(libm::log10(x.abs())) };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0 to 6")]
    let needed = needed.clamp(0.0, 6.0) as usize;
    let text = format!("{x:.*}", digits.max(if digits > 0 { needed } else { 0 }));
    let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
    whole.parse::<u64>().map_or_else(|_| text.clone(), |n| grouped(n) + rest)
}

/// Thousands apart from 10,000 on.
pub(super) fn grouped(n: u64) -> String {
    let digits = n.to_string();
    if n < 10_000 {
        return digits;
    }
    let first = digits.len() % 3;
    let mut groups = vec![&digits[..first]];
    groups.extend((first..digits.len()).step_by(3).map(|i| &digits[i..i + 3]));
    groups.retain(|g| !g.is_empty());
    groups.join(",")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Column;

    #[test]
    fn numbers_keep_two_digits_and_group_thousands() {
        assert_eq!(number(1234.5, 1), "1234.5");
        assert_eq!(number(12_345_678.0, 0), "12,345,678");
        assert_eq!(number(0.0123, 1), "0.012");
        assert_eq!(number(f64::NAN, 1), "-");
        assert_eq!(grouped(100_000), "100,000");
        assert_eq!(number(-0.5, 2), "-0.50");
    }

    #[test]
    fn tables_hide_empty_columns_and_escape_bars() {
        const COLUMNS: &[Column] = &[
            Column::new("scene", "scene", Role::Id, 0),
            Column::new("x", "x [ms]", Role::Sooner, 1),
            Column::new("y", "y", Role::Note, 1),
        ];
        let mut table = Table::new("t", "Title", COLUMNS).with_note("Note.");
        table.push(vec!["a|b".into(), 1.25.into(), Cell::Absent]);
        assert_eq!(format_table(&table), "\n## Title\n\nNote.\n\n| scene | x [ms] |\n|---|---:|\n| a\\|b | 1.2 |\n");
    }
}
