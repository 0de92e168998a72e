//! Cuts a surface into nearly flat charts and packs them into the unit square.
//!
//! Every triangle goes to the face, of a box aligned with its body part, that it looks at most; connected
//! triangles of one face form a chart, which is projected straight onto that face. Charts are packed on
//! shelves, tallest first, at the greatest scale that fits.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::nets::Surface;

/// What the unwrapper needs to know about a body part.
#[derive(Clone, Copy)]
pub struct PartFrame {
    /// Right-handed orthonormal axes of the box.
    pub axes: [DVec3; 3],
    /// Texels it deserves relative to others, per metre.
    pub importance: f64,
}

/// A surface whose vertices are repeated where charts meet.
pub struct Unwrapped {
    /// The vertex of the original surface behind each vertex.
    pub source: Vec<u32>,
    /// Texture coordinates, v down.
    pub tex_coords: Vec<DVec2>,
    /// Direction in space of growing u, on the chart's plane; u, v upwards and the chart's outside are a
    /// right-handed frame.
    pub u_dir: Vec<DVec3>,
    /// Triangles over the new vertices, in the original order.
    pub triangles: Vec<[u32; 3]>,
}

/// Unwraps `surface`; `part` numbers the part of each triangle in `frames`. `texels` is the size of the
/// texture for which charts keep `gap` texels between them.
pub fn unwrap(surface: &Surface, part: &[usize], frames: &[PartFrame], texels: f64, gap: f64) -> Unwrapped {
    let faces = smooth_faces(surface, part, &initial_faces(surface, part, frames), frames);
    let chart_of = components(surface, part, &faces);
    let chart_count = chart_of.iter().copied().max().map_or(0, |m| m + 1);
    let mut charts = vec![None; chart_count];
    for (t, corners) in surface.triangles.iter().enumerate() {
        let chart: &mut Chart = charts[chart_of[t]].get_or_insert_with(|| Chart::new(&frames[part[t]], faces[t]));
        for &corner in corners {
            chart.grow(surface.positions[corner as usize]);
        }
    }
    let mut charts: Vec<Chart> = charts.into_iter().flatten().collect();
    let scale = pack(&mut charts, gap / texels);
    let mut out = Unwrapped { source: vec![], tex_coords: vec![], u_dir: vec![], triangles: vec![] };
    let mut seen = HashMap::new();
    for (corners, &chart) in surface.triangles.iter().zip(&chart_of) {
        out.triangles.push(corners.map(|corner| {
            *seen.entry((corner, chart)).or_insert_with(|| {
                let c = &charts[chart];
                out.source.push(corner);
                out.tex_coords.push(c.place + (c.project(surface.positions[corner as usize]) - c.min) * scale);
                out.u_dir.push(c.u);
                out.source.len() as u32 - 1
            })
        }));
    }
    out
}

#[derive(Clone)]
struct Chart {
    u: DVec3,
    v_up: DVec3,
    importance: f64,
    min: DVec2,
    max: DVec2,
    /// Upper left corner in the unit square.
    place: DVec2,
}

impl Chart {
    fn new(frame: &PartFrame, face: usize) -> Self {
        let [_, a, b] = std::array::from_fn(|i| frame.axes[(face / 2 + i) % 3]);
        let (u, v_up) = if face.is_multiple_of(2) { (a, b) } else { (b, a) };
        let (min, max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        Self { u, v_up, importance: frame.importance, min, max, place: DVec2::ZERO }
    }

    fn project(&self, p: DVec3) -> DVec2 {
        DVec2::new(p.dot(self.u), -p.dot(self.v_up)) * self.importance
    }

    fn grow(&mut self, p: DVec3) {
        let q = self.project(p);
        self.min = self.min.min(q);
        self.max = self.max.max(q);
    }
}

fn face_normal(surface: &Surface, t: usize) -> DVec3 {
    let [a, b, c] = surface.triangles[t].map(|i| surface.positions[i as usize]);
    (b - a).cross(c - a).normalize_or(DVec3::Y)
}

/// How much a normal looks along face `face` (twice the axis, plus one for its negative side).
fn facing(frame: &PartFrame, face: usize, n: DVec3) -> f64 {
    n.dot(frame.axes[face / 2]) * if face.is_multiple_of(2) { 1.0 } else { -1.0 }
}

fn initial_faces(surface: &Surface, part: &[usize], frames: &[PartFrame]) -> Vec<usize> {
    let best = |t: usize| {
        let (frame, n) = (&frames[part[t]], face_normal(surface, t));
        (0..6).max_by(|&a, &b| facing(frame, a, n).total_cmp(&facing(frame, b, n))).unwrap_or(0)
    };
    (0..surface.triangles.len()).map(best).collect()
}

/// Triangles across each edge; an edge of the closed surface has two.
fn across(surface: &Surface) -> Vec<[Option<usize>; 3]> {
    let mut edges: HashMap<(u32, u32), usize> = HashMap::new();
    let each_edge = |t: &[u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    for (i, t) in surface.triangles.iter().enumerate() {
        for edge in each_edge(t) {
            edges.insert(edge, i);
        }
    }
    surface.triangles.iter().map(|t| each_edge(t).map(|(a, b)| edges.get(&(b, a)).copied())).collect()
}

/// Takes the face of two agreeing neighbours, so that charts have smooth outlines and no specks.
fn smooth_faces(surface: &Surface, part: &[usize], faces: &[usize], frames: &[PartFrame]) -> Vec<usize> {
    let across = across(surface);
    let mut faces = faces.to_vec();
    for _ in 0..16 {
        let vote = |t: usize| {
            let near: Vec<usize> = across[t].iter().flatten().copied().filter(|&o| part[o] == part[t]).collect();
            let wins = |f: usize| near.iter().filter(|&&o| faces[o] == f).count() >= 2;
            let allowed = |f: usize| facing(&frames[part[t]], f, face_normal(surface, t)) > 0.2;
            (0..6).find(|&f| f != faces[t] && wins(f) && allowed(f)).unwrap_or(faces[t])
        };
        faces = (0..faces.len()).map(vote).collect();
    }
    faces
}

/// Numbers the connected sets of triangles that share part and face.
fn components(surface: &Surface, part: &[usize], faces: &[usize]) -> Vec<usize> {
    let across = across(surface);
    let mut chart_of = vec![usize::MAX; faces.len()];
    let mut count = 0;
    for start in 0..faces.len() {
        if chart_of[start] != usize::MAX {
            continue;
        }
        let mut open = vec![start];
        chart_of[start] = count;
        while let Some(t) = open.pop() {
            for &o in across[t].iter().flatten() {
                if chart_of[o] == usize::MAX && part[o] == part[t] && faces[o] == faces[t] {
                    chart_of[o] = count;
                    open.push(o);
                }
            }
        }
        count += 1;
    }
    chart_of
}

/// Places the charts in the unit square; returns the scale at which all fit.
fn pack(charts: &mut [Chart], gap: f64) -> f64 {
    let mut order: Vec<usize> = (0..charts.len()).collect();
    let height = |c: &Chart| c.max.y - c.min.y;
    order.sort_by(|&a, &b| height(&charts[b]).total_cmp(&height(&charts[a])).then(a.cmp(&b)));
    let area: f64 = charts.iter().map(|c| (c.max - c.min).x * height(c)).sum();
    let mut scale = 1.0 / area.sqrt();
    while !place(charts, &order, scale, gap) {
        scale *= 0.985;
    }
    scale
}

fn place(charts: &mut [Chart], order: &[usize], scale: f64, gap: f64) -> bool {
    let (mut at, mut shelf) = (DVec2::splat(gap), 0.0);
    for &i in order {
        let size = (charts[i].max - charts[i].min) * scale;
        if at.x + size.x + gap > 1.0 {
            at = DVec2::new(gap, at.y + shelf + gap);
            shelf = 0.0;
        }
        if at.x + size.x + gap > 1.0 || at.y + size.y + gap > 1.0 {
            return false;
        }
        charts[i].place = at;
        at.x += size.x + gap;
        shelf = f64::max(shelf, size.y);
    }
    true
}
