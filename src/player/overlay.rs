//! Figures, messages and help over the picture.

use super::{
    canvas::{Canvas, Rect, line_height, text_width},
    input::HELP,
    request::Picture,
};

const WHITE: u32 = 0x00f2_f2f2;
const DIM: u32 = 0x00b8_c4cc;
const RED: u32 = 0x00ff_8a7a;
const PANEL: u32 = 0x0008_0c10;

/// Size of a font pixel for a window: 30 to 60 lines of text, and room for the help's width.
pub(super) fn text_scale(width: u32, height: u32) -> i32 {
    let fits = ((height + 180) / 450).min(width / 400).clamp(1, 8);
    i32::try_from(fits).unwrap_or(1)
}

/// What the figures say beside what the picture itself knows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Status<'a> {
    /// The scene's file.
    pub(super) file: &'a str,
    /// The clips that play.
    pub(super) clips: &'a str,
    /// Clip time now, seconds.
    pub(super) time_s: f64,
    /// Length of the loop, seconds.
    pub(super) duration_s: f64,
    /// Clip seconds a second.
    pub(super) speed: f64,
    /// True while time stands still.
    pub(super) is_paused: bool,
    /// The camera in use.
    pub(super) camera: &'a str,
    /// What a pixel shows.
    pub(super) shading: &'a str,
    /// Pictures a second, over the last second.
    pub(super) fps: f64,
}

fn ms(time: std::time::Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// `1234567` as `1,234,567`.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// The lines of figures.
pub(super) fn status_lines(status: &Status<'_>, picture: &Picture) -> Vec<String> {
    let times = &picture.times;
    let stages = [
        ("pose", ms(times.stages.pose)),
        ("deform", ms(times.stages.deform)),
        ("refit", ms(times.stages.refit)),
        ("trace", ms(times.trace)),
    ];
    let total: f64 = stages.iter().map(|(_, ms)| ms).sum();
    let trace_s = times.trace.as_secs_f64();
    let mega_rays = if trace_s > 0.0 { picture.rays as f64 * 1e-6 / trace_s } else { 0.0 };
    let stages: Vec<_> = stages.iter().map(|(name, ms)| format!("{name} {ms:.1}")).collect();
    let shot = &picture.shot;
    let size = match picture.divisor {
        1 => format!("{}x{}", picture.width, picture.height),
        divisor => format!("{}x{} of {}x{} (1/{divisor})", picture.width, picture.height, shot.width, shot.height),
    };
    let samples = if picture.samples == 1 { String::new() } else { format!(", {} samples", picture.samples) };
    let pause = if status.is_paused { "  paused" } else { "" };
    vec![
        format!("{}   {:.1} fps", status.file, status.fps),
        format!("{}  = {total:.1} ms   {mega_rays:.1} Mrays/s", stages.join("  ")),
        format!("{} triangles   {}   swaps {}", grouped(triangles(picture)), shot.structure, picture.counts.swaps),
        format!("{size}{samples}   {}   {}", status.shading, status.camera),
        status.clips.to_owned(),
        format!("{:.3} / {:.3} s   speed {}{pause}", status.time_s, status.duration_s, status.speed),
    ]
}

fn triangles(picture: &Picture) -> u64 {
    picture.shot.scene.triangles_drawn() as u64
}

/// Draws lines of text at the top left.
pub(super) fn draw_status(canvas: &mut Canvas<'_>, lines: &[String], scale: i32) {
    let (pad, line) = (4 * scale, line_height(scale));
    let width = lines.iter().map(|l| text_width(l, scale)).max().unwrap_or(0);
    let height = line * i32::try_from(lines.len()).unwrap_or(0);
    canvas.rect(Rect { x: 0, y: 0, width: width + 2 * pad, height: height + 2 * pad }, PANEL, 140);
    for (y, text) in (0..).map(|i| pad + i * line).zip(lines) {
        canvas.text(pad, y, text, WHITE, scale);
    }
}

/// Draws a message, broken into lines that fit, with its lower edge at `bottom`.
pub(super) fn draw_message(canvas: &mut Canvas<'_>, text: &str, is_error: bool, bottom: i32, scale: i32) {
    let (pad, line) = (4 * scale, line_height(scale));
    let columns = usize::try_from((canvas.width() - 2 * pad) / text_width("m", scale)).unwrap_or(0).max(1);
    let lines = wrapped(text, columns);
    let height = line * i32::try_from(lines.len()).unwrap_or(0) + 2 * pad;
    let top = (bottom - height).max(0);
    canvas.rect(Rect { x: 0, y: top, width: canvas.width(), height }, PANEL, 190);
    for (y, text) in (0..).map(|i| top + pad + i * line).zip(&lines) {
        canvas.text(pad, y, text, if is_error { RED } else { WHITE }, scale);
    }
}

/// Breaks text at spaces, or within a word that is longer than a line, into lines of at most `columns`.
fn wrapped(text: &str, columns: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        for piece in pieces(word, columns) {
            let line = lines.last_mut().map_or("", |l| l.as_str());
            let used = line.chars().count();
            if used > 0 && used + 1 + piece.chars().count() > columns {
                lines.push(piece);
            } else if let Some(line) = lines.last_mut() {
                if used > 0 {
                    line.push(' ');
                }
                line.push_str(&piece);
            }
        }
    }
    lines
}

fn pieces(word: &str, columns: usize) -> Vec<String> {
    let letters: Vec<_> = word.chars().collect();
    letters.chunks(columns).map(|c| c.iter().collect()).collect()
}

/// Draws the keys in the middle.
pub(super) fn draw_help(canvas: &mut Canvas<'_>, scale: i32) {
    let (pad, line) = (8 * scale, line_height(scale) + 2 * scale);
    let widest = |pick: fn(&(&'static str, &'static str)) -> &'static str| {
        HELP.iter().map(|row| text_width(pick(row), scale)).max().unwrap_or(0)
    };
    let gap = text_width("   ", scale);
    let (left, right) = (widest(|r| r.0), widest(|r| r.1));
    let width = left + gap + right + 2 * pad;
    let height = line * i32::try_from(HELP.len()).unwrap_or(0) + 2 * pad;
    let x = ((canvas.width() - width) / 2).max(0);
    let y = ((canvas.height() - height) / 2).max(0);
    canvas.rect(Rect { x, y, width, height }, PANEL, 215);
    for (row, (keys, what)) in (0..).map(|i| y + pad + i * line).zip(HELP) {
        canvas.text(x + pad, row, keys, WHITE, scale);
        canvas.text(x + pad + left + gap, row, what, DIM, scale);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_by_thousands() {
        assert_eq!(grouped(0), "0");
        assert_eq!(grouped(999), "999");
        assert_eq!(grouped(1_234_567), "1,234,567");
    }

    #[test]
    fn long_messages_are_broken_and_lose_no_letter() {
        let text = "a.glb: accessors[3].count: averyverylongwordindeed ends";
        let lines = wrapped(text, 12);
        assert!(lines.iter().all(|l| l.chars().count() <= 12), "{lines:?}");
        let letters = |s: &str| s.replace(' ', "");
        assert_eq!(letters(&lines.concat()), letters(text));
        assert_eq!(wrapped("", 5), [""]);
    }

    #[test]
    fn help_fits_the_smallest_usual_window() {
        let (width, height) = (640, 360);
        let scale = text_scale(width, height);
        let columns = HELP.iter().map(|r| r.0.len()).max().unwrap() + 3 + HELP.iter().map(|r| r.1.len()).max().unwrap();
        assert!(text_width(&"m".repeat(columns), scale) + 16 * scale <= 640);
        let rows = i32::try_from(HELP.len()).unwrap();
        assert!((line_height(scale) + 2 * scale) * rows + 16 * scale <= 360);
    }

    #[test]
    fn drawing_into_any_size_is_harmless() {
        for (width, height) in [(1, 1), (13, 200), (300, 9)] {
            let mut pixels = vec![0; width * height];
            let mut canvas = Canvas::new(width, height, &mut pixels);
            draw_status(&mut canvas, &["a line that is far too long".to_owned()], 3);
            draw_message(&mut canvas, "a message that is far too long", true, 5, 2);
            draw_help(&mut canvas, 2);
        }
    }
}
