//! Bytes into hostile geometry: any bytes mean something, and few bytes mean much.

use kinora::{geom::Ray, glam::Vec3};

use crate::trace::Mesh;

/// Numbers that break careless code.
const HOSTILE: [f32; 32] = [
    0.0,
    -0.0,
    1e-45,
    -1e-45,
    1.175_494_2e-38,
    f32::MIN_POSITIVE,
    -f32::MIN_POSITIVE,
    1e-30,
    -1e-20,
    1e-10,
    1.192_092_9e-7,
    -1e-7,
    0.1,
    -0.3,
    0.999_999_94,
    1.000_000_1,
    std::f32::consts::PI,
    8_388_608.0,
    16_777_216.0,
    -16_777_215.0,
    1_000_000.06,
    1_152_921_504_606_846_976.0,
    -1_152_921_642_045_800_448.0,
    1e19,
    -1e30,
    1.7e38,
    f32::MAX,
    f32::MIN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
    -f32::NAN,
];

/// A reader of bytes that goes on with zeros after the end.
#[derive(Clone, Debug)]
pub(crate) struct Bytes<'a> {
    rest: &'a [u8],
    last: f32,
}

impl<'a> Bytes<'a> {
    pub(crate) fn new(data: &'a [u8]) -> Self {
        Self { rest: data, last: 0.0 }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    pub(crate) fn byte(&mut self) -> u8 {
        let Some((&first, rest)) = self.rest.split_first() else { return 0 };
        self.rest = rest;
        first
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n
    }

    /// Mostly small integers and quarters, else a hostile number, the last number again or beside it, or any bits.
    pub(crate) fn float(&mut self) -> f32 {
        let byte = self.byte();
        let small = f32::from(byte & 15) - 8.0;
        let value = match byte >> 4 {
            0..=5 => small,
            6 => small * 0.25,
            7 => small * 1024.0 + 0.125,
            8 => small * 9.536_743e-7 + 1.0,
            9 | 10 => HOSTILE[usize::from(byte - 0x90)],
            11 => self.last,
            12 => f32::from_bits(self.last.to_bits().wrapping_add(u32::from(byte & 15)).wrapping_sub(8)),
            13 => -self.last,
            14 => f32::from_le_bytes(std::array::from_fn(|_| self.byte())),
            _ => f32::from(i16::from_le_bytes([self.byte(), self.byte()])) / 256.0,
        };
        self.last = value;
        value
    }

    pub(crate) fn vec3(&mut self) -> Vec3 {
        Vec3::new(self.float(), self.float(), self.float())
    }

    /// Up to `vertices` vertices and `triangles` triangles between any of them.
    pub(crate) fn mesh(&mut self, vertices: usize, triangles: usize) -> Mesh {
        let (vertices, triangles) = (1 + self.below(vertices), self.below(triangles + 1));
        let positions = (0..vertices).map(|_| self.vec3()).collect();
        let indices = (0..triangles).map(|_| std::array::from_fn(|_| self.below(vertices) as u32)).collect();
        Mesh { positions, indices }
    }

    /// A ray anywhere, or one aimed at a vertex, an edge or the inside of a triangle as well as f32 can.
    pub(crate) fn ray(&mut self, mesh: &Mesh) -> Ray {
        let kind = self.byte();
        let origin = self.vec3();
        let corners = match mesh.indices.len() {
            0 => [Vec3::ZERO; 3],
            n => mesh.corners(self.below(n)),
        };
        let dir = match kind & 7 {
            0 => self.vec3(),
            1 | 2 => corners[0] - origin,
            3 => (corners[0] + corners[1]) * 0.5 - origin,
            4 => corners[1] - corners[2],
            5 => corners[0] * 0.25 + corners[1] * 0.5 + corners[2] * 0.25 - origin,
            6 => Vec3::AXES[usize::from(kind >> 3) % 3] * if kind & 0x80 == 0 { 1.0 } else { -1.0 },
            _ => (corners[2] - origin) * 0.5,
        };
        let mut ray = Ray::new(origin, dir);
        if kind & 0x60 == 0x60 {
            (ray.t_near, ray.t_far) = (self.float(), self.float());
        }
        ray
    }
}
