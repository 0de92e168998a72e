//! The small solids.

use glam::{DVec2, DVec3};

use crate::scenes::{
    explode::icosahedron,
    maths::{cos_turns, sin_turns, smoothstep},
    shape::{Shape, beveled_box},
};

/// Every kind, with its name.
pub fn all() -> Vec<(&'static str, Shape)> {
    vec![
        ("box", beveled_box(DVec3::splat(0.046), 0.007)),
        ("ring", ring(0.047, 0.019)),
        ("gear", prism(&gear(), 0.018)),
        ("star", prism(&star(), 0.019)),
        ("gem", gem(0.064)),
        ("cross", prism(&cross(), 0.023)),
    ]
}

/// A torus about z.
fn ring(radius: f64, tube: f64) -> Shape {
    let mut shape = Shape::default();
    shape.sheet(28, 12, |u, v| {
        let out = DVec3::new(cos_turns(u), sin_turns(u), 0.0);
        let normal = out * cos_turns(v) + DVec3::Z * sin_turns(v);
        (out * radius + normal * tube, normal)
    });
    shape
}

/// A solid with flat faces.
fn gem(radius: f64) -> Shape {
    let sphere = icosahedron();
    let mut shape = Shape::default();
    for t in &sphere.triangles {
        let corners = t.map(|i| sphere.points[i as usize] * radius);
        let normal = (corners[0] + corners[1] + corners[2]).normalize();
        let numbers = corners.map(|p| shape.vertex(p, normal, DVec2::ZERO));
        shape.triangles.push(numbers);
    }
    shape
}

/// An outline in the xy plane, star-shaped about its middle and counter-clockwise, made `2 * half` thick, with
/// its edges cut off a little.
fn prism(outline: &[DVec2], half: f64) -> Shape {
    let bevel = 0.004;
    let mut shape = Shape::default();
    let inset = |p: DVec2| p * (1.0 - bevel / p.length());
    for (k, &a) in outline.iter().enumerate() {
        let b = outline[(k + 1) % outline.len()];
        for side in [1.0, -1.0] {
            let high = |p: DVec2| inset(p).extend(side * half);
            let low = |p: DVec2| p.extend(side * (half - bevel));
            let (from, to) = if side > 0.0 { (a, b) } else { (b, a) };
            let cap = [DVec3::new(0.0, 0.0, side * half), high(from), high(to)];
            let numbers = cap.map(|p| shape.vertex(p, DVec3::Z * side, DVec2::ZERO));
            shape.triangles.push(numbers);
            shape.face([low(from), low(to), high(to), high(from)], |_| DVec2::ZERO);
        }
        let (low, high) = (-half + bevel, half - bevel);
        shape.face([a.extend(low), b.extend(low), b.extend(high), a.extend(high)], |_| DVec2::ZERO);
    }
    shape
}

fn gear() -> Vec<DVec2> {
    let (teeth, steps) = (9, 8);
    let count = teeth * steps;
    (0..count)
        .map(|k| {
            let place = f64::from(k % steps) / f64::from(steps);
            let up = smoothstep(0.05, 0.2, place) * (1.0 - smoothstep(0.55, 0.7, place));
            let turn = f64::from(k) / f64::from(count);
            DVec2::new(cos_turns(turn), sin_turns(turn)) * (0.050 + 0.014 * up)
        })
        .collect()
}

fn star() -> Vec<DVec2> {
    (0..10)
        .map(|k| {
            let turn = 0.25 + f64::from(k) / 10.0;
            DVec2::new(cos_turns(turn), sin_turns(turn)) * if k % 2 == 0 { 0.070 } else { 0.034 }
        })
        .collect()
}

fn cross() -> Vec<DVec2> {
    let (a, b) = (0.022, 0.060);
    [(a, -b), (a, -a), (b, -a), (b, a), (a, a), (a, b), (-a, b), (-a, a), (-b, a), (-b, -a), (-a, -a), (-a, -b)]
        .map(|(x, y)| DVec2::new(x, y))
        .to_vec()
}
