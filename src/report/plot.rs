//! Plots as SVG, with the fonts of whoever shows them.

use plotters::{
    chart::{ChartBuilder, ChartContext, MeshStyle},
    coord::{
        Shift,
        combinators::{IntoLogRange, LogCoord},
        ranged1d::{AsRangedCoord, ValueFormatter},
    },
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use super::{ReportError, labels::Labels};

/// Size of a plot in pixels, and of its strips at the left, below and at the right.
const SIZE: (u32, u32) = (900, 520);
const LEFT: u32 = 64;
const BELOW: u32 = 46;
const LEGEND: i32 = 190;

/// Colours that people with any colour vision tell apart, after Okabe and Ito; the last are added.
const COLORS: [RGBColor; 10] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(60, 60, 60),
    RGBColor(140, 110, 70),
    RGBColor(120, 80, 190),
    RGBColor(150, 170, 40),
];

const FRAME: RGBColor = RGBColor(70, 70, 70);
const GRID: RGBColor = RGBColor(222, 222, 222);

/// Colour of points that another one beats, and its number.
const DOMINATED: RGBColor = RGBColor(185, 185, 185);
const GREY: usize = usize::MAX;

/// Values of one name.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Its name in the legend.
    pub name: String,
    /// Points by ascending x; in [`Bars`] x is the number of a group.
    pub points: Vec<(f64, f64)>,
    /// Number of its colour.
    pub color: usize,
    /// Number of its mark: disc, triangle, cross.
    pub mark: usize,
}

impl Line {
    /// The `i`-th line of a plot: a colour of its own, and another mark when colours begin anew.
    pub fn new(i: usize, name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), points, color: i % COLORS.len(), mark: i / COLORS.len() }
    }
}

/// Lines over two logarithmic axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines {
    /// What runs to the right, with its unit.
    pub x: String,
    /// What runs upward, with its unit.
    pub y: String,
    /// The lines.
    pub lines: Vec<Line>,
}

/// Lines over a number that is counted, upward on a logarithmic axis; points have no marks.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// What runs to the right, with its unit.
    pub x: String,
    /// What runs upward, with its unit.
    pub y: String,
    /// The lines.
    pub lines: Vec<Line>,
}

/// Values by group: a mark each, on a logarithmic axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars {
    /// Names of the groups, from the left.
    pub groups: Vec<String>,
    /// What runs upward, with its unit.
    pub y: String,
    /// Marks of one colour.
    pub lines: Vec<Line>,
}

/// A point of a [`Scatter`].
#[derive(Clone, Debug, PartialEq)]
pub struct Dot {
    /// Its name, written beside it when it is among the best.
    pub name: String,
    /// Where it is.
    pub at: (f64, f64),
    /// True for a point in colour with its name, false for a grey one without.
    pub is_best: bool,
    /// Number of its mark, as in [`Line`].
    pub mark: usize,
}

/// Points over two logarithmic axes; an upward value of 0 is drawn on the lower edge.
#[derive(Clone, Debug, PartialEq)]
pub struct Scatter {
    /// What runs to the right, with its unit.
    pub x: String,
    /// What runs upward, with its unit.
    pub y: String,
    /// The points.
    pub dots: Vec<Dot>,
}

/// What a plot shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Chart {
    /// Growth over a number.
    Lines(Lines),
    /// Change from one to the next.
    Series(Series),
    /// Values side by side.
    Bars(Bars),
    /// Cost against error.
    Scatter(Scatter),
}

/// A plot, drawn when it is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// File name without its extension; anything but letters, digits and `-` becomes `-`.
    pub name: String,
    /// Heading.
    pub title: String,
    /// What it shows.
    pub chart: Chart,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type LogChart<'a, 'b, X> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<X, LogCoord<f64>>>;
type Failed = DrawingAreaErrorKind<std::io::Error>;

impl Plot {
    /// A plot.
    pub fn new(name: impl Into<String>, title: impl Into<String>, chart: Chart) -> Self {
        Self { name: name.into(), title: title.into(), chart }
    }

    /// Name of its file.
    pub fn file(&self) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
        format!("{}.svg", self.name.chars().map(plain).collect::<String>())
    }

    /// The plot as SVG. Points that are not positive and finite are left out.
    ///
    /// # Errors
    /// What the drawing code refuses.
    pub fn svg(&self) -> Result<String, ReportError> {
        let mut svg = String::new();
        let drawn = {
            let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
            match &self.chart {
                Chart::Lines(lines) => draw_lines(&root, &self.title, lines),
                Chart::Series(series) => draw_series(&root, &self.title, series),
                Chart::Bars(bars) => draw_bars(&root, &self.title, bars),
                Chart::Scatter(scatter) => draw_scatter(&root, &self.title, scatter),
            }
            .and_then(|()| root.present())
        };
        drawn.map_err(|e| ReportError::Plot { plot: self.file(), reason: e.to_string() })?;
        Ok(svg)
    }
}

fn draw_lines(root: &Area<'_>, title: &str, lines: &Lines) -> Result<(), Failed> {
    let [x, y] = [decades(&lines.lines, |p| p.0), decades(&lines.lines, |p| p.1)];
    let plot = begin(root, title, &lines.lines)?;
    let mut chart = axes(&plot, (x.0..x.1).log_scale(), y)?;
    draw_numbered(&mut chart, [&lines.x, &lines.y])?;
    for line in &lines.lines {
        let points = line.points.iter().copied().filter(|p| drawable(p.0) && drawable(p.1)).collect::<Vec<_>>();
        chart.draw_series(LineSeries::new(points.iter().copied(), color(line).stroke_width(2)))?;
        mark(&plot, &chart, line, &points)?;
    }
    Ok(())
}

fn draw_series(root: &Area<'_>, title: &str, series: &Series) -> Result<(), Failed> {
    let y = decades(&series.lines, |p| p.1);
    let last = series.lines.iter().flat_map(|l| &l.points).map(|p| p.0).fold(1.0, f64::max);
    let plot = begin(root, title, &series.lines)?;
    let mut chart = axes(&plot, 0.0..last, y)?;
    draw_numbered(&mut chart, [&series.x, &series.y])?;
    for line in &series.lines {
        let points = line.points.iter().copied().filter(|p| p.0.is_finite() && drawable(p.1));
        chart.draw_series(LineSeries::new(points, color(line).stroke_width(2)))?;
    }
    Ok(())
}

fn draw_bars(root: &Area<'_>, title: &str, bars: &Bars) -> Result<(), Failed> {
    let y = decades(&bars.lines, |p| p.1);
    let plot = begin(root, title, &bars.lines)?;
    let mut chart = axes(&plot, 0.0..bars.groups.len().max(1) as f64, y)?;
    let mut mesh = chart.configure_mesh();
    mesh.disable_x_mesh().x_labels(0).y_desc(&bars.y).y_label_formatter(&|y| short(*y));
    draw_mesh(&mut mesh)?;
    for (i, group) in bars.groups.iter().enumerate() {
        let (px, py) = chart.backend_coord(&(i as f64 + 0.5, y.0));
        let origin = plot.get_base_pixel();
        let style = ("sans-serif", 12).into_font().color(&FRAME).pos(Pos::new(HPos::Center, VPos::Top));
        // Neighbours stand at two heights, so that long names do not meet.
        let step = if bars.groups.len() > 6 && i % 2 == 1 { 16 } else { 0 };
        plot.draw(&Text::new(group.clone(), (px - origin.0, py - origin.1 + 8 + step), style))?;
    }
    for (i, line) in bars.lines.iter().enumerate() {
        let points = line.points.iter().filter(|p| drawable(p.1));
        // Marks of a group stand side by side.
        let shift = (i as f64 + 0.5) / bars.lines.len() as f64 * 0.6 + 0.2;
        mark(&plot, &chart, line, &points.map(|p| (p.0 + shift, p.1)).collect::<Vec<_>>())?;
    }
    Ok(())
}

fn draw_scatter(root: &Area<'_>, title: &str, scatter: &Scatter) -> Result<(), Failed> {
    // What is nothing at all stands a decade below the least that is something.
    let above = scatter.dots.iter().map(|d| d.at.1).filter(|&y| drawable(y)).fold(f64::INFINITY, f64::min);
    let floor = if above.is_finite() { above / 10.0 } else { 1.0 };
    let points = |best: bool| {
        let of_kind = scatter.dots.iter().filter(move |d| d.is_best == best && drawable(d.at.0) && d.at.1.is_finite());
        of_kind.map(move |d| (d, (d.at.0, if d.at.1 > 0.0 { d.at.1 } else { floor })))
    };
    let all = [Line::new(0, "", points(true).chain(points(false)).map(|p| p.1).collect())];
    let [x, y] = [roomy(&all, |p| p.0), roomy(&all, |p| p.1)];
    let plot = begin(root, title, &scatter_legend())?;
    let mut chart = axes(&plot, (x.0..x.1).log_scale(), y)?;
    let upward = |y: &f64| if *y <= floor * 1.01 { "0".to_owned() } else { short(*y) };
    let mut mesh = chart.configure_mesh();
    mesh.x_desc(&scatter.x).y_desc(&scatter.y).x_label_formatter(&|x| short(*x)).y_label_formatter(&upward);
    draw_mesh(&mut mesh)?;
    let origin = plot.get_base_pixel();
    for (dot, at) in points(false).chain(points(true)) {
        let (px, py) = chart.backend_coord(&at);
        let at = (px - origin.0, py - origin.1);
        draw_mark_in(&plot, dot.mark, if dot.is_best { COLORS[dot.mark % 2] } else { DOMINATED }, at)?;
    }
    let in_pixels = |at: &(f64, f64)| {
        let (x, y) = chart.backend_coord(at);
        (x - origin.0, y - origin.1)
    };
    // Between the axes.
    let (low, high) = (in_pixels(&(x.0, y.0)), in_pixels(&(x.1, y.1)));
    let area = [low.0 + 2, high.1, high.0, low.1 - 2];
    let mut labels = Labels::new(area, points(false).chain(points(true)).map(|(_, at)| in_pixels(&at)));
    for (dot, at) in points(true) {
        let label = labels.place(&dot.name, in_pixels(&at));
        if let Some(from) = label.from {
            plot.draw(&PathElement::new(vec![from, in_pixels(&at)], DOMINATED.stroke_width(1)))?;
        }
        let style = ("sans-serif", 12).into_font().color(&FRAME).pos(Pos::new(HPos::Left, VPos::Center));
        plot.draw(&Text::new(dot.name.clone(), label.at, style))?;
    }
    Ok(())
}

/// What the marks of a [`Scatter`] mean.
fn scatter_legend() -> [Line; 3] {
    let line = |name: &str, color: usize, mark: usize| Line { name: name.into(), points: Vec::new(), color, mark };
    [line("conservative", 0, 0), line("lossy", 1, 1), line("grey: dominated", GREY, 0)]
}

/// Fills the ground, writes the title and the legend; the area left for the axes.
fn begin<'a>(root: &Area<'a>, title: &str, lines: &[Line]) -> Result<Area<'a>, Failed> {
    root.fill(&WHITE)?;
    let below = root.titled(title, ("sans-serif", 18))?;
    #[expect(clippy::cast_possible_wrap, reason = "a picture's width")]
    let (plot, legend) = below.split_horizontally(SIZE.0 as i32 - LEGEND);
    let mut y = 16;
    for line in lines {
        draw_mark(&legend, line, (12, y))?;
        let style = ("sans-serif", 13).into_font().color(&FRAME).pos(Pos::new(HPos::Left, VPos::Center));
        legend.draw(&Text::new(line.name.clone(), (24, y), style))?;
        y += 20;
    }
    Ok(plot)
}

/// Axes in `plot`, the upward one of decades.
fn axes<'p, 'b, X: AsRangedCoord<Value = f64>>(
    plot: &'p Area<'b>,
    x: X,
    y: (f64, f64),
) -> Result<LogChart<'p, 'b, X::CoordDescType>, Failed> {
    ChartBuilder::on(plot)
        .margin(8)
        .x_label_area_size(BELOW)
        .y_label_area_size(LEFT)
        .build_cartesian_2d(x, (y.0..y.1).log_scale())
}

/// Draws axes with names and numbers.
fn draw_numbered<X>(chart: &mut LogChart<'_, '_, X>, names: [&str; 2]) -> Result<(), Failed>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let mut mesh = chart.configure_mesh();
    mesh.x_desc(names[0]).y_desc(names[1]).x_label_formatter(&|x| short(*x)).y_label_formatter(&|y| short(*y));
    draw_mesh(&mut mesh)
}

/// Draws axes and lines across, in the colours and letters of all plots.
fn draw_mesh<X>(mesh: &mut MeshStyle<'_, '_, X, LogCoord<f64>, SVGBackend<'_>>) -> Result<(), Failed>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    mesh.bold_line_style(GRID).light_line_style(TRANSPARENT).axis_style(FRAME).label_style(("sans-serif", 13)).draw()
}

/// Marks points given in the chart's coordinates.
fn mark<X: Ranged<ValueType = f64>>(
    plot: &Area<'_>,
    chart: &LogChart<'_, '_, X>,
    line: &Line,
    points: &[(f64, f64)],
) -> Result<(), Failed> {
    let origin = plot.get_base_pixel();
    points.iter().try_for_each(|point| {
        let (x, y) = chart.backend_coord(point);
        draw_mark(plot, line, (x - origin.0, y - origin.1))
    })
}

fn draw_mark(area: &Area<'_>, line: &Line, at: (i32, i32)) -> Result<(), Failed> {
    draw_mark_in(area, line.mark, color(line), at)
}

fn draw_mark_in(area: &Area<'_>, mark: usize, color: RGBColor, at: (i32, i32)) -> Result<(), Failed> {
    match mark % 3 {
        0 => area.draw(&Circle::new(at, 4, color.filled())),
        1 => area.draw(&TriangleMarker::new(at, 6, color.filled())),
        _ => area.draw(&Cross::new(at, 4, color.stroke_width(2))),
    }
}

fn color(line: &Line) -> RGBColor {
    if line.color == GREY { DOMINATED } else { COLORS[line.color % COLORS.len()] }
}

fn drawable(x: f64) -> bool {
    x.is_finite() && x > 0.0
}

/// The whole decades that hold all values, but for a tenth at either end.
fn decades(lines: &[Line], value: impl Fn(&(f64, f64)) -> f64) -> (f64, f64) {
    let values = lines.iter().flat_map(|l| &l.points).map(value).filter(|&v| drawable(v));
    let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return (1.0, 10.0);
    }
    let first = libm::floor(libm::log10(low * 1.1));
    let last = libm::ceil(libm::log10(high / 1.1)).max(first + 1.0);
    (libm::pow(10.0, first).min(low), libm::pow(10.0, last).max(high))
}

/// As [`decades`], and a third of one more at an end where a value lies: marks on an axis are hard to see.
fn roomy(lines: &[Line], value: impl Fn(&(f64, f64)) -> f64) -> (f64, f64) {
    let (low, high) = decades(lines, &value);
    let values = || lines.iter().flat_map(|l| &l.points).map(&value).filter(|&v| drawable(v));
    let first = if values().any(|v| v < low * 1.3) { low / 2.0 } else { low };
    let last = if values().any(|v| v > high / 1.3) { high * 2.0 } else { high };
    (first, last)
}

/// A number in few characters.
fn short(x: f64) -> String {
    for (unit, name) in [(1e9, "G"), (1e6, "M"), (1e3, "k")] {
        if x >= unit * 0.9999 {
            return format!("{}{name}", trimmed(x / unit));
        }
    }
    trimmed(x)
}

fn trimmed(x: f64) -> String {
    let text = format!("{x:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_take_whole_decades() {
        let line = |points: &[(f64, f64)]| vec![Line::new(0, "a", points.to_vec())];
        assert_eq!(decades(&line(&[(1.0, 3.0), (2.0, 450.0)]), |p| p.1), (1.0, 1000.0));
        assert_eq!(decades(&line(&[(1.0, 0.0), (2.0, f64::NAN)]), |p| p.1), (1.0, 10.0));
        assert_eq!(decades(&line(&[(1.0, 100.0)]), |p| p.1), (100.0, 1000.0));
    }

    #[test]
    fn no_value_lies_on_an_axis_with_room() {
        let line = |points: &[(f64, f64)]| vec![Line::new(0, "a", points.to_vec())];
        assert_eq!(roomy(&line(&[(1.0, 3.0), (2.0, 450.0)]), |p| p.1), (1.0, 1000.0));
        assert_eq!(roomy(&line(&[(1.0, 1.0), (2.0, 100.0)]), |p| p.1), (0.5, 200.0));
    }

    #[test]
    fn labels_are_short() {
        assert_eq!(["1k", "10M", "0.01", "5"], [1e3, 1e7, 0.01, 5.0].map(short).each_ref().map(String::as_str));
    }

    #[test]
    fn plots_are_well_formed_and_hold_every_name_and_mark() {
        let points = vec![(968.0, 3.0), (10_000.0, 0.0), (100_000.0, 45.0)];
        let lines: Vec<Line> = (0..12).map(|i| Line::new(i, format!("line <{i}>"), points.clone())).collect();
        let charts = [
            Chart::Lines(Lines { x: "n & m".into(), y: "ns".into(), lines: lines.clone() }),
            Chart::Bars(Bars { groups: vec!["one".into(), "two".into()], y: "ns".into(), lines }),
        ];
        for chart in charts {
            let svg = Plot::new("p", "A & B", chart).svg().unwrap();
            assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"), "{svg}");
            assert!(svg.contains("line &lt;11&gt;") && svg.contains("A &amp; B"));
            // Ten discs at two points each, and ten in the legend.
            assert_eq!(svg.matches("<circle").count(), 30);
            assert!(!svg.contains("NaN") && !svg.contains("inf"));
        }
    }

    #[test]
    fn points_worth_their_cost_have_names_and_the_others_are_grey() {
        let dot = |name: &str, at, is_best| Dot { name: name.into(), at, is_best, mark: 0 };
        let dots =
            vec![dot("best", (10.0, 0.0), true), dot("beaten", (30.0, 5.0), false), dot("cheap", (9.0, 70.0), true)];
        let svg = Plot::new("p", "t", Chart::Scatter(Scatter { x: "ns".into(), y: "u".into(), dots })).svg().unwrap();
        assert!(svg.contains("best") && svg.contains("cheap") && !svg.contains("beaten"));
        // The point, and its line in the legend; names stand beside their points, so no line leads to them.
        assert_eq!(svg.matches("#B9B9B9").count(), 2);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn file_names_hold_letters_digits_and_dashes() {
        let chart = Chart::Bars(Bars { groups: vec![], y: "y".into(), lines: vec![] });
        assert_eq!(Plot::new("rates builtin:walk/x", "t", chart).file(), "rates-builtin-walk-x.svg");
    }
}
