//! Right answers of collision in whole numbers: parting axes, squared distances as ratios. Nothing is shared with `collide`.

use std::cmp::Ordering;

/// Coordinates, each at most 2^20 in size; at most 2^10 where distances are asked for.
pub(super) type Point = [i64; 3];

/// A direction; components up to 2^66.
type Axis = [i128; 3];

fn minus(a: Point, b: Point) -> Axis {
    [0, 1, 2].map(|i| i128::from(a[i] - b[i]))
}

fn cross(a: Axis, b: Axis) -> Axis {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i] * b[j] - a[j] * b[i])
}

fn dot(a: Axis, b: Axis) -> i128 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn square(a: Axis) -> i128 {
    dot(a, a)
}

fn edges([a, b, c]: [Point; 3]) -> [Axis; 3] {
    [minus(b, a), minus(c, b), minus(a, c)]
}

fn normal([a, b, c]: [Point; 3]) -> Axis {
    cross(minus(b, a), minus(c, a))
}

/// True when all of one set lie strictly before all of the other along an axis.
fn part(axis: Axis, a: &[Point], b: &[Point]) -> bool {
    let range = |points: &[Point]| {
        let along = points.iter().map(|&p| dot(axis, p.map(i128::from)));
        along.fold((i128::MAX, i128::MIN), |(low, high), x| (low.min(x), high.max(x)))
    };
    let ((a_low, a_high), (b_low, b_high)) = (range(a), range(b));
    a_high < b_low || b_high < a_low
}

/// Whether two closed triangles, at least one of them with area, share a point.
///
/// The differences of their points are a convex set, which holds 0 unless one of its faces' normals parts both: a triangle's normal, the cross
/// product of an edge of each, or, in one plane, that of the normal and an edge.
pub(super) fn triangles_meet(a: [Point; 3], b: [Point; 3]) -> bool {
    let (a_edges, b_edges, normals) = (edges(a), edges(b), [normal(a), normal(b)]);
    let of_edges = a_edges.into_iter().flat_map(|e| b_edges.map(|f| cross(e, f)));
    let in_plane = a_edges.into_iter().chain(b_edges).flat_map(|e| normals.map(|n| cross(n, e)));
    !normals.into_iter().chain(of_edges).chain(in_plane).any(|axis| part(axis, &a, &b))
}

/// A closed box by its least and greatest corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Whole {
    pub(super) min: Point,
    pub(super) max: Point,
}

impl Whole {
    pub(super) fn meets(&self, other: &Self) -> bool {
        (0..3).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }

    /// Whether it shares a point with a triangle; both are solids, of the dimension that they have.
    pub(super) fn meets_triangle(&self, triangle: [Point; 3]) -> bool {
        let corners: Vec<Point> =
            (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 0 { self.min[k] } else { self.max[k] })).collect();
        let own = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
        let of_edges = edges(triangle).into_iter().flat_map(|e| own.map(|axis| cross(axis, e)));
        !own.into_iter().chain([normal(triangle)]).chain(of_edges).any(|axis| part(axis, &corners, &triangle))
    }

    /// When `self`, moving by `motion` while s goes from `from` to `to`, shares a point with `other`: first and last s. No `to` is no end.
    pub(super) fn sweep(&self, motion: Point, other: &Self, from: i64, to: Option<i64>) -> Option<[Ratio; 2]> {
        let whole = |x: i64| Ratio { over: x.into(), under: 1 };
        let (mut enter, mut exit) = (whole(from), to.map(whole));
        for (i, &speed) in motion.iter().enumerate() {
            let (before, after) = (other.min[i] - self.max[i], other.max[i] - self.min[i]);
            if speed == 0 {
                if before > 0 || after < 0 {
                    return None;
                }
                continue;
            }
            let at = |way: i64| Ratio::new(way.into(), speed.into());
            let (first, last) = if speed > 0 { (at(before), at(after)) } else { (at(after), at(before)) };
            enter = if first.compare(enter).is_gt() { first } else { enter };
            exit = Some(exit.map_or(last, |exit| if last.compare(exit).is_lt() { last } else { exit }));
        }
        let exit = exit?;
        (enter.compare(exit).is_le()).then_some([enter, exit])
    }
}

/// A ratio, its divisor positive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ratio {
    over: i128,
    under: i128,
}

impl Ratio {
    fn new(over: i128, under: i128) -> Self {
        if under < 0 { Self { over: -over, under: -under } } else { Self { over, under } }
    }

    fn compare(self, other: Self) -> Ordering {
        (self.over * other.under).cmp(&(other.over * self.under))
    }

    fn least(self, other: Self) -> Self {
        if other.compare(self).is_lt() { other } else { self }
    }

    /// Within three roundings.
    pub(super) fn value(self) -> f64 {
        self.over as f64 / self.under as f64
    }

    /// Whether a squared distance is at most that of a whole one.
    pub(super) fn is_within(self, distance: i64) -> bool {
        self.compare(Self { over: i128::from(distance).pow(2), under: 1 }).is_le()
    }
}

/// The squared distance of a point from a segment.
fn from_segment(p: Point, [a, b]: [Point; 2]) -> Ratio {
    let (way, from) = (minus(b, a), minus(p, a));
    let (along, length) = (dot(from, way), square(way));
    if along <= 0 {
        return Ratio::new(square(from), 1);
    }
    if along >= length {
        return Ratio::new(square(minus(p, b)), 1);
    }
    Ratio::new(square(from) * length - along * along, length)
}

/// The squared distance of a point from a triangle with area.
pub(super) fn from_triangle(p: Point, triangle: [Point; 3]) -> Ratio {
    let [a, b, c] = triangle;
    let normal = normal(triangle);
    let is_inside =
        [[a, b], [b, c], [c, a]].iter().all(|&[from, to]| dot(cross(minus(to, from), minus(p, from)), normal) >= 0);
    if is_inside {
        return Ratio::new(dot(normal, minus(p, a)).pow(2), square(normal));
    }
    from_segment(p, [a, b]).least(from_segment(p, [b, c])).least(from_segment(p, [c, a]))
}

/// The squared distance of two segments.
fn of_segments([a, b]: [Point; 2], [c, d]: [Point; 2]) -> Ratio {
    let ends = from_segment(a, [c, d])
        .least(from_segment(b, [c, d]))
        .least(from_segment(c, [a, b]))
        .least(from_segment(d, [a, b]));
    let (u, v, w) = (minus(b, a), minus(d, c), minus(a, c));
    let normal = cross(u, v);
    let whole = square(normal);
    // How far along both the common perpendicular stands, as shares of `whole`.
    let s = dot(u, v) * dot(v, w) - square(v) * dot(u, w);
    let t = square(u) * dot(v, w) - dot(u, v) * dot(u, w);
    let stands = whole > 0 && (0..=whole).contains(&s) && (0..=whole).contains(&t);
    if stands { ends.least(Ratio::new(dot(w, normal).pow(2), whole)) } else { ends }
}

/// The squared distance of a segment from a triangle with area.
pub(super) fn segment_from_triangle(segment: [Point; 2], triangle: [Point; 3]) -> Ratio {
    let [p, q] = segment;
    if triangles_meet([p, q, q], triangle) {
        return Ratio::new(0, 1);
    }
    let [a, b, c] = triangle;
    let ends = from_triangle(p, triangle).least(from_triangle(q, triangle));
    [[a, b], [b, c], [c, a]].into_iter().fold(ends, |best, edge| best.least(of_segments(segment, edge)))
}

/// The squared distance of two triangles with area.
pub(super) fn of_triangles(a: [Point; 3], b: [Point; 3]) -> Ratio {
    if triangles_meet(a, b) {
        return Ratio::new(0, 1);
    }
    let [p, q, r] = a;
    let own = [[p, q], [q, r], [r, p]].map(|edge| segment_from_triangle(edge, b));
    let others = b.map(|corner| from_triangle(corner, a));
    own.into_iter().chain(others).reduce(Ratio::least).unwrap_or(Ratio::new(0, 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLAT: [Point; 3] = [[0, 0, 0], [8, 0, 0], [0, 8, 0]];

    #[test]
    fn triangles_that_touch_meet_and_those_a_step_apart_do_not() {
        for (other, due) in [
            ([[4, 4, 0], [9, 9, 0], [9, 9, 5]], true),
            ([[5, 4, 0], [9, 9, 0], [9, 9, 5]], false),
            ([[8, 0, 0], [9, -3, 0], [9, 3, 0]], true),
            ([[9, 0, 0], [9, -3, 0], [10, 3, 0]], false),
            ([[1, 1, -1], [1, 1, 1], [2, 1, 1]], true),
            ([[1, 1, 1], [2, 2, 1], [2, 1, 9]], false),
            ([[1, 1, -3], [1, 1, 3], [1, 1, 3]], true),
            ([[5, 5, -3], [5, 5, 3], [5, 5, 3]], false),
        ] {
            assert_eq!(triangles_meet(FLAT, other), due, "{other:?}");
            assert_eq!(triangles_meet(other, FLAT), due, "{other:?}");
        }
    }

    #[test]
    fn distances_are_those_of_faces_edges_and_corners() {
        for (p, due) in [([1, 1, 3], 9.0), ([-3, -4, 0], 25.0), ([3, -2, 1], 5.0), ([8, 8, 0], 32.0), ([2, 2, 0], 0.0)]
        {
            assert_eq!(from_triangle(p, FLAT).value().to_bits(), f64::to_bits(due), "{p:?}");
        }
        // Above an edge, across it.
        assert_eq!(of_triangles(FLAT, [[3, -5, 2], [3, 5, 2], [3, 0, 9]]).value().to_bits(), 4.0_f64.to_bits());
        assert!(of_triangles(FLAT, [[0, 0, 5], [0, 0, 6], [1, 0, 6]]).is_within(5));
        assert!(!of_triangles(FLAT, [[0, 0, 5], [0, 0, 6], [1, 0, 6]]).is_within(4));
    }

    #[test]
    fn boxes_are_entered_and_left_when_they_touch() {
        let unit = Whole { min: [0; 3], max: [1; 3] };
        let far = Whole { min: [3, 0, 1], max: [5, 1, 2] };
        let [enter, exit] = unit.sweep([4, 0, 0], &far, 0, Some(1)).expect("they meet");
        assert_eq!((enter.value().to_bits(), exit.value().to_bits()), (0.5_f64.to_bits(), 1.0_f64.to_bits()));
        assert!(unit.sweep([4, 0, -1], &far, 0, Some(1)).is_none() && !unit.meets(&far));
        assert!(
            unit.meets_triangle([[1, 1, 1], [2, 2, 2], [2, 2, 3]])
                && !unit.meets_triangle([[2, 1, 1], [1, 1, 2], [2, 2, 2]])
        );
    }
}
