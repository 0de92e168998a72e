//! Whether things are within a distance of each other, exactly.
//!
//! The square of a distance to a line or a plane is a quotient of two integers, once the coordinates are: squares and products of up to six differences, which take at most
//! 1,674 bits. A closed solid is within a distance when one of its corners is, or the line of an edge or the plane where the nearest point of it lies inside.

use glam::Vec3;

use super::{
    int::Int,
    volumes::{Int3, Scaled, cross, dot, sub, to_ints},
};

/// The points and the distance as integers in one unit.
fn scaled<const N: usize>(points: [Vec3; N], distance: f32) -> ([Int3; N], Int) {
    let least = points.iter().flat_map(Vec3::to_array).chain([distance]).map(|x| Scaled::new(x).exponent).min();
    // That of 0 is the largest: all are 0 then, and any unit will do.
    let exponent = least.filter(|&e| e != i32::MAX).unwrap_or(0);
    (points.map(|p| to_ints(p, exponent)), Scaled::new(distance).to_int(exponent))
}

fn square(v: &Int3) -> Int {
    dot(v, v)
}

/// `a <= b`.
fn at_most(a: &Int, b: &Int) -> bool {
    a.sub(b).signum() <= 0
}

/// Whether `part` lies between 0 and `whole`.
fn is_share(part: &Int, whole: &Int) -> bool {
    part.signum() >= 0 && at_most(part, whole)
}

fn point_of_segment(p: &Int3, [a, b]: [&Int3; 2], distance_square: &Int) -> bool {
    let (way, from) = (sub(b, a), sub(p, a));
    if at_most(&square(&from), distance_square) || at_most(&square(&sub(p, b)), distance_square) {
        return true;
    }
    let whole = square(&way);
    whole.signum() > 0
        && is_share(&dot(&from, &way), &whole)
        && at_most(&square(&cross(&from, &way)), &distance_square.mul(&whole))
}

/// Whether a point is within a distance, not negative, of a closed triangle. All numbers are finite.
///
/// Cost: some microseconds.
#[cold]
#[inline(never)]
pub fn point_within(p: Vec3, corners: &[Vec3; 3], distance: f32) -> bool {
    let ([p, a, b, c], distance) = scaled([p, corners[0], corners[1], corners[2]], distance);
    let distance_square = distance.mul(&distance);
    let edges = [[&a, &b], [&b, &c], [&c, &a]];
    if edges.into_iter().any(|edge| point_of_segment(&p, edge, &distance_square)) {
        return true;
    }
    let normal = cross(&sub(&b, &a), &sub(&c, &a));
    let whole = square(&normal);
    let height = dot(&normal, &sub(&p, &a));
    let is_inside = |[from, to]: [&Int3; 2]| dot(&normal, &cross(&sub(to, from), &sub(&p, from))).signum() >= 0;
    whole.signum() > 0
        && at_most(&height.mul(&height), &distance_square.mul(&whole))
        && edges.into_iter().all(is_inside)
}

/// Whether two closed segments are within a distance, not negative, of each other. All numbers are finite.
///
/// Cost: some microseconds.
#[cold]
#[inline(never)]
pub fn segments_within([a, b]: [Vec3; 2], [c, d]: [Vec3; 2], distance: f32) -> bool {
    let ([a, b, c, d], distance) = scaled([a, b, c, d], distance);
    let distance_square = distance.mul(&distance);
    let ends = [(&a, [&c, &d]), (&b, [&c, &d]), (&c, [&a, &b]), (&d, [&a, &b])];
    if ends.into_iter().any(|(p, segment)| point_of_segment(p, segment, &distance_square)) {
        return true;
    }
    let (u, v, w) = (sub(&b, &a), sub(&d, &c), sub(&a, &c));
    let normal = cross(&u, &v);
    let whole = square(&normal);
    // How far along both the common perpendicular stands, as shares of `whole`.
    let (uu, uv, vv, uw, vw) = (square(&u), dot(&u, &v), square(&v), dot(&u, &w), dot(&v, &w));
    let along_first = uv.mul(&vw).sub(&vv.mul(&uw));
    let along_second = uu.mul(&vw).sub(&uv.mul(&uw));
    let height = dot(&w, &normal);
    whole.signum() > 0
        && is_share(&along_first, &whole)
        && is_share(&along_second, &whole)
        && at_most(&height.mul(&height), &distance_square.mul(&whole))
}

#[cfg(test)]
mod tests {
    use num_rational::BigRational;
    use num_traits::{One, Zero};
    use proptest::prelude::*;

    use super::*;

    type Point = [BigRational; 3];

    fn rational(p: Vec3) -> Point {
        p.to_array().map(|x| BigRational::from_float(x).expect("finite"))
    }

    fn minus(a: &Point, b: &Point) -> Point {
        [0, 1, 2].map(|i| &a[i] - &b[i])
    }

    fn product(a: &Point, b: &Point) -> BigRational {
        (0..3).map(|i| &a[i] * &b[i]).sum()
    }

    fn at(a: &Point, way: &Point, t: &BigRational) -> Point {
        [0, 1, 2].map(|i| &a[i] + &way[i] * t)
    }

    fn clamped(t: BigRational) -> BigRational {
        t.max(BigRational::zero()).min(BigRational::one())
    }

    /// The point of a segment nearest to `p`.
    fn on_segment(p: &Point, [a, b]: [&Point; 2]) -> Point {
        let way = minus(b, a);
        let whole = product(&way, &way);
        if whole.is_zero() { a.clone() } else { at(a, &way, &clamped(product(&minus(p, a), &way) / whole)) }
    }

    fn apart(a: &Point, b: &Point) -> BigRational {
        let way = minus(a, b);
        product(&way, &way)
    }

    /// The least squared distance from a triangle: from the foot on its plane where that lies inside, else from its edges.
    fn from_triangle(p: &Point, [a, b, c]: [&Point; 3]) -> BigRational {
        let edges = [[a, b], [b, c], [c, a]].map(|edge| apart(p, &on_segment(p, edge)));
        let least = edges.into_iter().min().expect("three");
        let (e, f, s) = (minus(b, a), minus(c, a), minus(p, a));
        let (ee, ef, ff, es, fs) =
            (product(&e, &e), product(&e, &f), product(&f, &f), product(&e, &s), product(&f, &s));
        let det = &ee * &ff - &ef * &ef;
        if det.is_zero() {
            return least;
        }
        let (u, v) = ((&ff * &es - &ef * &fs) / &det, (&ee * &fs - &ef * &es) / &det);
        let zero = BigRational::zero();
        if u < zero || v < zero || &u + &v > BigRational::one() {
            return least;
        }
        apart(p, &at(&at(a, &e, &u), &f, &v)).min(least)
    }

    /// The least squared distance of two segments: of the feet of the lines' common perpendicular where both lie inside, else from an end.
    fn of_segments([a, b]: [&Point; 2], [c, d]: [&Point; 2]) -> BigRational {
        let ends = [(a, [c, d]), (b, [c, d]), (c, [a, b]), (d, [a, b])];
        let least = ends.map(|(p, segment)| apart(p, &on_segment(p, segment))).into_iter().min().expect("four");
        let (u, v) = (minus(b, a), minus(d, c));
        let (uu, uv, vv) = (product(&u, &u), product(&u, &v), product(&v, &v));
        let det = &uu * &vv - &uv * &uv;
        if det.is_zero() {
            return least;
        }
        let w = minus(a, c);
        let (uw, vw) = (product(&u, &w), product(&v, &w));
        let (s, t) = ((&uv * &vw - &vv * &uw) / &det, (&uu * &vw - &uv * &uw) / &det);
        if s != clamped(s.clone()) || t != clamped(t.clone()) {
            return least;
        }
        apart(&at(a, &u, &s), &at(c, &v, &t)).min(least)
    }

    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![
            4 => (-4_i16..5).prop_map(f32::from),
            1 => -1.0_f32..1.0,
            1 => prop_oneof![Just(f32::MIN_POSITIVE), Just(f32::from_bits(1)), Just(f32::MAX), Just(-f32::MAX), Just(0.1)],
        ]
    }

    fn point() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(number()).prop_map(Vec3::from)
    }

    proptest! {
        #[test]
        fn within_is_what_rationals_say(mut points in prop::array::uniform4(point()), distance in number(), alike in 0..12_usize) {
            let distance = distance.abs();
            if alike < 4 {
                // Triangles and segments that collapse.
                points[alike] = points[(alike + 1) % 4];
            }
            let [p, a, b, c] = points;
            let [rp, ra, rb, rc] = points.map(rational);
            let most = BigRational::from_float(distance).expect("finite").pow(2);
            prop_assert_eq!(point_within(p, &[a, b, c], distance), from_triangle(&rp, [&ra, &rb, &rc]) <= most);
            prop_assert_eq!(segments_within([p, a], [b, c], distance), of_segments([&rp, &ra], [&rb, &rc]) <= most);
        }
    }

    #[test]
    fn touching_counts_and_the_next_number_does_not() {
        let flat = [Vec3::ZERO, Vec3::new(8.0, 0.0, 0.0), Vec3::new(0.0, 8.0, 0.0)];
        for (p, distance) in
            [(Vec3::new(1.0, 1.0, 3.0), 3.0_f32), (Vec3::new(-3.0, 1.0, 4.0), 5.0), (Vec3::new(-1.0, -2.0, -2.0), 3.0)]
        {
            assert!(point_within(p, &flat, distance) && !point_within(p, &flat, distance.next_down()), "{p}");
        }
        let (one, other) = ([Vec3::ZERO, Vec3::X], [Vec3::new(0.5, -1.0, 2.0), Vec3::new(0.5, 1.0, 2.0)]);
        assert!(segments_within(one, other, 2.0) && !segments_within(one, other, 2.0_f32.next_down()));
    }
}
