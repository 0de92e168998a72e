//! Small deterministic mathematics: only `+ - * / sqrt` and the `libm` crate, so that every machine gives the same bytes.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};

/// Radians of an angle in degrees.
pub fn deg(angle: f64) -> f64 {
    angle * PI / 180.0
}

/// Sine of `turns` full turns.
pub fn sin_turns(turns: f64) -> f64 {
    libm::sin(turns * TAU)
}

/// Cosine of `turns` full turns.
pub fn cos_turns(turns: f64) -> f64 {
    libm::cos(turns * TAU)
}

/// Rotation by `angle` radians about the unit vector `axis`.
pub fn about(axis: DVec3, angle: f64) -> DQuat {
    let (sin, cos) = (libm::sin(angle * 0.5), libm::cos(angle * 0.5));
    DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos)
}

/// Rotation about x, then y, then z (applied in that order), radians.
pub fn euler(x: f64, y: f64, z: f64) -> DQuat {
    about(DVec3::Z, z) * about(DVec3::Y, y) * about(DVec3::X, x)
}

/// The rotation whose matrix has the orthonormal columns `x`, `y`, `z`.
pub fn from_axes(x: DVec3, y: DVec3, z: DVec3) -> DQuat {
    let trace = x.x + y.y + z.z;
    let q = if trace > 0.0 {
        DQuat::from_xyzw(y.z - z.y, z.x - x.z, x.y - y.x, 1.0 + trace)
    } else if x.x >= y.y && x.x >= z.z {
        DQuat::from_xyzw(1.0 + x.x - y.y - z.z, x.y + y.x, z.x + x.z, y.z - z.y)
    } else if y.y >= z.z {
        DQuat::from_xyzw(x.y + y.x, 1.0 - x.x + y.y - z.z, y.z + z.y, z.x - x.z)
    } else {
        DQuat::from_xyzw(z.x + x.z, y.z + z.y, 1.0 - x.x - y.y + z.z, x.y - y.x)
    };
    unit(q)
}

/// `q` scaled to length one.
pub fn unit(q: DQuat) -> DQuat {
    let length = (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w).sqrt();
    DQuat::from_xyzw(q.x / length, q.y / length, q.z / length, q.w / length)
}

/// Orientation of something at `eye` that looks along its -Z at `target`, +Y up.
pub fn look_at(eye: DVec3, target: DVec3) -> DQuat {
    let z = (eye - target).normalize();
    let x = DVec3::Y.cross(z).normalize();
    from_axes(x, z.cross(x), z)
}

/// `a` at 0, `b` at 1.
pub fn mix(a: f64, b: f64, alpha: f64) -> f64 {
    a + (b - a) * alpha
}

/// 0 up to `lo`, 1 from `hi`, a smooth cubic between.
pub fn smoothstep(lo: f64, hi: f64, x: f64) -> f64 {
    let s = ((x - lo) / (hi - lo)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// A number in [0, 1) that depends on all bits of `seed`.
pub fn hash(seed: u64) -> f64 {
    let mut h = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((h ^ (h >> 31)) >> 11) as f64 / 9_007_199_254_740_992.0
}

/// Value noise in [0, 1] with cells of size one, smooth between lattice points.
pub fn noise(p: DVec3) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let s = f * f * (DVec3::splat(3.0) - 2.0 * f);
    let at = |dx: f64, dy: f64, dz: f64| {
        let key = |v: f64| (v as i64 as u64) & 0x1f_ffff;
        hash(key(cell.x + dx) | key(cell.y + dy) << 21 | key(cell.z + dz) << 42)
    };
    let plane =
        |dz: f64| mix(mix(at(0.0, 0.0, dz), at(1.0, 0.0, dz), s.x), mix(at(0.0, 1.0, dz), at(1.0, 1.0, dz), s.x), s.y);
    mix(plane(0.0), plane(1.0), s.z)
}

/// Four octaves of [`noise`], in [0, 1].
pub fn fractal(p: DVec3) -> f64 {
    let (mut sum, mut amplitude, mut scale) = (0.0, 0.5, 1.0);
    for octave in 0..4 {
        sum += amplitude * noise(p * scale + DVec3::splat(17.3 * f64::from(octave)));
        amplitude *= 0.5;
        scale *= 2.03;
    }
    sum / 0.9375
}
