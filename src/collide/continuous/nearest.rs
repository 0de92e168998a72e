use glam::DVec3;

use super::map::Map;

/// How near the two surely come at one moment (rounded up), and where: weights of the face's second and third corner, or how far along
/// the edges. Near the least distance, as well as f64 finds it.
pub(super) fn nearest(map: &Map, t: f64) -> (f64, [f64; 2]) {
    let [base, v, u, both] = map.at(t);
    // The vector between the two is `base + x along + y across`, whatever x and y.
    let (along, across) = if map.is_face() { (u - base, both - base) } else { (u - base, v - base) };
    let (x, y) = if map.is_face() { in_triangle(base, along, across) } else { in_square(base, along, across) };
    let gap = (base + along * x + across * y).length();
    // One error for the vector, one for what the differences above add.
    (gap * (1.0 + 8.0 * f64::EPSILON) + 2.0 * map.error.element_sum(), [x, y])
}

/// The x in [0, 1] for which `base + x along` is shortest.
fn on_edge(base: DVec3, along: DVec3) -> f64 {
    let square = along.length_squared();
    if square > 0.0 { (-base.dot(along) / square).clamp(0.0, 1.0) } else { 0.0 }
}

/// The free minimum of `|base + x along + y across|`, if it can be told.
fn free(base: DVec3, along: DVec3, across: DVec3) -> Option<(f64, f64)> {
    let (a, b, c) = (along.length_squared(), along.dot(across), across.length_squared());
    let (d, e) = (along.dot(base), across.dot(base));
    let det = a * c - b * b;
    (det > 0.0).then(|| ((b * e - c * d) / det, (b * d - a * e) / det))
}

/// Of some candidates, the one that gives the shortest vector.
fn shortest<const N: usize>(base: DVec3, along: DVec3, across: DVec3, candidates: [(f64, f64); N]) -> (f64, f64) {
    let length = |(x, y): (f64, f64)| (base + along * x + across * y).length_squared();
    candidates[1..].iter().fold(candidates[0], |best, &c| if length(c) < length(best) { c } else { best })
}

fn in_square(base: DVec3, along: DVec3, across: DVec3) -> (f64, f64) {
    if let Some((x, y)) = free(base, along, across)
        && (0.0..=1.0).contains(&x)
        && (0.0..=1.0).contains(&y)
    {
        return (x, y);
    }
    shortest(
        base,
        along,
        across,
        [
            (on_edge(base, along), 0.0),
            (on_edge(base + across, along), 1.0),
            (0.0, on_edge(base, across)),
            (1.0, on_edge(base + along, across)),
        ],
    )
}

fn in_triangle(base: DVec3, along: DVec3, across: DVec3) -> (f64, f64) {
    if let Some((x, y)) = free(base, along, across)
        && x >= 0.0
        && y >= 0.0
        && x + y <= 1.0
    {
        return (x, y);
    }
    let slant = on_edge(base + along, across - along);
    shortest(base, along, across, [(on_edge(base, along), 0.0), (0.0, on_edge(base, across)), (1.0 - slant, slant)])
}
