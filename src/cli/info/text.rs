//! The summary for people.

use std::fmt::Write as _;

use super::summary::Summary;

/// Lines of `name: value`, lists indented below their name.
pub(super) fn format(summary: &Summary<'_>) -> String {
    let mut out = format!("{}\n", printable(summary.file));
    let s = summary;
    let drawn = if s.triangles_drawn == s.triangles { String::new() } else { format!(", {} drawn", s.triangles_drawn) };
    let lines = [
        ("scenes", s.scenes.to_string()),
        ("nodes", s.nodes.to_string()),
        ("meshes", format!("{} ({} parts)", s.meshes, s.parts)),
        ("triangles", format!("{}{drawn}", s.triangles)),
        ("vertices", s.vertices.to_string()),
        ("joints", s.joints.to_string()),
        ("morph targets", s.morph_targets.to_string()),
        ("cameras", s.cameras.to_string()),
        ("lights", s.lights.to_string()),
        ("materials", s.materials.to_string()),
        ("textures", s.textures.to_string()),
        (
            "drawn parts",
            format!("{} static, {} rigid, {} deforming", s.classes.still, s.classes.rigid, s.classes.deforming),
        ),
    ];
    for (name, value) in lines {
        line(&mut out, name, &value);
    }
    let animation = |(i, a): (usize, &super::summary::Animation<'_>)| {
        let state = a.disabled.map_or(String::new(), |why| format!(" (disabled: {why})"));
        format!("{i} `{}` {:.3} s, {} channels{state}", printable(a.name), a.duration_s, a.channels)
    };
    list(&mut out, "animations", s.animations.iter().enumerate().map(animation));
    let extension = |name: &String| {
        let ignored = if s.extensions_ignored.contains(name) { " (ignored)" } else { "" };
        format!("{}{ignored}", printable(name))
    };
    let undeclared = s.extensions_ignored.iter().filter(|e| !s.extensions_used.contains(e));
    list(&mut out, "extensions", s.extensions_used.iter().chain(undeclared).map(extension));
    list(&mut out, "left out", s.left_out.iter().map(|l| format!("{}: {}", l.feature, l.why)));
    list(&mut out, "warnings", s.warnings.iter().map(|w| printable(w)));
    out
}

fn line(out: &mut String, name: &str, value: &str) {
    // Writing to a string cannot fail.
    let _ = writeln!(out, "  {name:<14} {value}");
}

fn list(out: &mut String, name: &str, items: impl Iterator<Item = String>) {
    let mut items = items.peekable();
    if items.peek().is_none() {
        line(out, name, "none");
    }
    for (i, item) in items.enumerate() {
        line(out, if i == 0 { name } else { "" }, &item);
    }
}

/// Text of a file without control characters, which a terminal would obey.
fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escape_sequences_of_a_file_do_not_reach_the_terminal() {
        assert_eq!(printable("a\u{1b}[31mb"), "a\u{fffd}[31mb");
    }

    #[test]
    fn empty_lists_say_none_and_long_ones_are_indented() {
        let mut out = String::new();
        list(&mut out, "x", std::iter::empty());
        list(&mut out, "y", ["1".to_owned(), "2".to_owned()].into_iter());
        let words: Vec<_> = out.lines().map(|l| l.split_whitespace().collect::<Vec<_>>()).collect();
        assert_eq!(words, [vec!["x", "none"], vec!["y", "1"], vec!["2"]]);
    }
}
