//! From a hit to a surface point: position with its error, normals, texture footprints.

use glam::{Vec2, Vec3};

use super::{
    context::{FrameContext, InstanceInfo},
    material::{Binding, tex_coord},
    math::unit_or,
    texture::Footprint,
};
use crate::{
    geom::{Hit, Ray},
    scene::MeshPart,
};

/// Least share that an axis has of the largest error: on a coordinate plane the error is 0, and a ray that starts a
/// denormal number above the plane could be decided by integers only.
const LEAST_ERROR: f32 = 1.0 / 256.0;

/// Bound of the relative rounding error of a barycentric point: seven roundings.
const POINT_ERROR: f32 = 7.0 * 0.5 * f32::EPSILON / (1.0 - 7.0 * 0.5 * f32::EPSILON);

/// A triangle as a ray meets it: what texture look-ups need, without normals.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch<'a> {
    pub(crate) part: &'a MeshPart,
    pub(crate) vertices: [u32; 3],
    pub(crate) corners: [Vec3; 3],
    /// Weights of the corners.
    pub(crate) weights: [f32; 3],
    /// Cross product of the edges: normal of the file's winding times twice the area.
    pub(crate) cross: Vec3,
    /// Change of the weights of the second and third corner for one pixel right and one down.
    steps: [Vec2; 2],
}

impl<'a> Patch<'a> {
    /// The triangle of `hit`; its footprint is unknown until [`Patch::with_steps`].
    #[inline(always)]
    pub(crate) fn new(ctx: &FrameContext<'a>, info: &InstanceInfo, hit: &Hit) -> Self {
        let part = ctx.part(info);
        let (vertices, corners) = ctx.triangle(hit.instance, part, hit.prim);
        let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        Self { part, vertices, corners, weights, cross, steps: [Vec2::ZERO; 2] }
    }

    /// Sets the footprint that a pixel of the camera's picture has here.
    ///
    /// # Source
    /// Igehy, "Tracing Ray Differentials", 1999, section 3.1: the transfer to the plane.
    #[inline(always)]
    #[must_use]
    pub(crate) fn with_steps(mut self, ctx: &FrameContext<'_>, ray: &Ray, t: f32) -> Self {
        let slope = 1.0 / self.cross.dot(ray.dir);
        let pixel = ctx.rays.pixel_steps(t);
        self.steps = pixel.map(|q| self.weight_change(q - ray.dir * (q.dot(self.cross) * slope)));
        self
    }

    /// Sets a round footprint `width` across, in metres.
    #[inline(always)]
    #[must_use]
    pub(crate) fn with_width(mut self, width: f32) -> Self {
        let edge = unit_or(self.corners[1] - self.corners[0], Vec3::X);
        let other = unit_or(self.cross.cross(edge), Vec3::Y);
        self.steps = [self.weight_change(edge * width), self.weight_change(other * width)];
        self
    }

    /// Change of the second and third weight for a step `d` in the triangle's plane.
    #[inline(always)]
    fn weight_change(&self, d: Vec3) -> Vec2 {
        let inv = 1.0 / self.cross.length_squared();
        let (e1, e2) = (self.corners[1] - self.corners[0], self.corners[2] - self.corners[0]);
        Vec2::new(d.cross(e2).dot(self.cross) * inv, e1.cross(d).dot(self.cross) * inv)
    }

    /// Coordinates of a TEXCOORD set here and their footprint.
    #[inline(always)]
    pub(crate) fn coordinates(&self, set: u32) -> (Vec2, Footprint) {
        let [a, b, c] = tex_coord(self.part, set, self.vertices);
        let [w, u, v] = self.weights;
        let (du, dv) = (b - a, c - a);
        let step = |s: Vec2| du * s.x + dv * s.y;
        (a * w + b * u + c * v, Footprint { dx: step(self.steps[0]), dy: step(self.steps[1]) })
    }

    /// Width of the footprint in metres: the longer of its two steps.
    #[inline(always)]
    pub(crate) fn width(&self) -> f32 {
        let (e1, e2) = (self.corners[1] - self.corners[0], self.corners[2] - self.corners[0]);
        let step = |s: Vec2| (e1 * s.x + e2 * s.y).length_squared();
        step(self.steps[0]).max(step(self.steps[1])).sqrt()
    }

    /// Directions of growing u and of falling v (a normal map's x and y) of a binding's coordinates; `None` where
    /// they do not span the plane.
    #[inline(always)]
    fn tangents(&self, binding: &Binding) -> Option<(Vec3, Vec3)> {
        let [a, b, c] = tex_coord(self.part, binding.set, self.vertices);
        let (du, dv) = (binding.turn(b - a), binding.turn(c - a));
        let (e1, e2) = (self.corners[1] - self.corners[0], self.corners[2] - self.corners[0]);
        let det = du.x * dv.y - dv.x * du.y;
        let sign = if det < 0.0 { -1.0 } else { 1.0 };
        let tangent = (e1 * dv.y - e2 * du.y) * sign;
        let bitangent = (e1 * dv.x - e2 * du.x) * sign;
        (det != 0.0 && det.is_finite()).then_some((tangent, bitangent))
    }
}

/// A surface point ready for shading.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub(crate) point: Vec3,
    /// Bound of the error of `point` along each axis.
    error: Vec3,
    /// Unit geometric normal on the viewer's side.
    pub(crate) n_geom: Vec3,
    /// Unit shading normal on the viewer's side, never turned away from the viewer.
    pub(crate) n_shade: Vec3,
    /// Cosine between the interpolated (not mapped) normal and the geometric one.
    pub(crate) between: f32,
    /// Unit direction to the viewer.
    pub(crate) view: Vec3,
    /// How far the smooth surface that the normals suggest bulges over the facet here.
    bulge: Vec3,
    /// Length of the filtered normal map vector: below 1 where normals vary within the footprint.
    pub(crate) map_length: f32,
}

impl Surface {
    /// The surface of `patch`, where `ray` met it.
    pub(crate) fn new(ctx: &FrameContext<'_>, info: &InstanceInfo, patch: &Patch<'_>, ray: &Ray, hit: &Hit) -> Self {
        let view = unit_or(-ray.dir, Vec3::Z);
        let [w, u, v] = patch.weights;
        let [a, b, c] = patch.corners;
        let point = a * w + b * u + c * v;
        let error = ((a * w).abs() + (b * u).abs() + (c * v).abs()) * POINT_ERROR;
        let error = error.max(Vec3::splat(error.max_element() * LEAST_ERROR));
        let side = if info.mirrored { -1.0 } else { 1.0 };
        // Outward by the file's winding, before it is turned to the viewer.
        let outward = unit_or(patch.cross * side, view);
        let front = outward.dot(view) >= 0.0;
        let facing = if front { 1.0 } else { -1.0 };
        let n_geom = outward * facing;

        let normals = patch.vertices.map(|i| ctx.normal(hit, info, i));
        let (smooth, bulge) = match normals {
            [Some(na), Some(nb), Some(nc)] => {
                let smooth = unit_or(na * w + nb * u + nc * v, outward);
                (smooth, bulge(point, [a, b, c], [na, nb, nc].map(|n| n * facing), patch.weights))
            }
            _ => (outward, Vec3::ZERO),
        };
        let (mapped, map_length) = match ctx.material(info).normal_map {
            Some(binding) => mapped_normal(ctx, info, patch, hit, &binding, smooth),
            None => (smooth, 1.0),
        };
        // Normals that contradict the winding are taken as an artist's inverted normals.
        let turn = |n: Vec3| if smooth.dot(outward) < 0.0 { n * -facing } else { n * facing };
        let n_shade = towards_viewer(turn(mapped), view);
        let between = turn(smooth).dot(n_geom);
        Self { point, error, n_geom, n_shade, between, view, bulge, map_length }
    }

    /// Where a ray that leaves along `dir` starts: past the error of the point, on the side that it leaves to.
    ///
    /// # Source
    /// Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th edition, section 6.8.6.
    #[inline(always)]
    pub(crate) fn origin(&self, dir: Vec3) -> Vec3 {
        let away = if dir.dot(self.n_geom) < 0.0 { -self.n_geom } else { self.n_geom };
        let offset = away * away.abs().dot(self.error);
        let start = self.point + offset;
        Vec3::new(past(start.x, away.x), past(start.y, away.y), past(start.z, away.z))
    }

    /// [`Surface::origin`] for shadow rays: lifted to the smooth surface, so that facets do not shadow themselves.
    #[inline(always)]
    pub(crate) fn shadow_origin(&self, dir: Vec3) -> Vec3 {
        self.origin(dir) + self.bulge
    }
}

/// The next float in the direction of `away`: a point with error zero, as on a coordinate plane, must leave it too.
#[inline(always)]
fn past(x: f32, away: f32) -> f32 {
    if away > 0.0 {
        x.next_up()
    } else if away < 0.0 {
        x.next_down()
    } else {
        x
    }
}

/// Distance from the facet to the surface that the corner normals suggest; zero where that lies below.
///
/// # Source
/// Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021.
#[inline(always)]
fn bulge(point: Vec3, corners: [Vec3; 3], normals: [Vec3; 3], weights: [f32; 3]) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for i in 0..3 {
        let below = (point - corners[i]).dot(normals[i]).min(0.0);
        sum -= normals[i] * (below * weights[i]);
    }
    sum
}

/// Keeps a shading normal on the viewer's side: tilted just enough where interpolation or a map turned it away.
#[inline(always)]
fn towards_viewer(n: Vec3, view: Vec3) -> Vec3 {
    const LEAST: f32 = 0.02;
    let cos = n.dot(view);
    if cos >= LEAST { n } else { unit_or(n + view * (LEAST - cos), view) }
}

/// The normal map's normal around `smooth`, on the side of the file's winding, and the length of the filtered vector.
fn mapped_normal(
    ctx: &FrameContext<'_>,
    info: &InstanceInfo,
    patch: &Patch<'_>,
    hit: &Hit,
    binding: &Binding,
    smooth: Vec3,
) -> (Vec3, f32) {
    let (uv, footprint) = patch.coordinates(binding.set);
    let texel = binding.read(&ctx.scene(info).pyramids, uv, &footprint);
    let raw = Vec3::new(texel.x, texel.y, texel.z) * 2.0 - Vec3::ONE;
    let scale = ctx.material(info).normal_scale;
    let Some((tangent, bitangent)) = tangent_frame(ctx, info, patch, hit, binding, smooth) else {
        return (smooth, 1.0);
    };
    let n = tangent * (raw.x * scale) + bitangent * (raw.y * scale) + smooth * raw.z;
    (unit_or(n, smooth), raw.length().min(1.0))
}

/// Unit tangent and bitangent perpendicular to `smooth`: the file's, else from the texture coordinates.
fn tangent_frame(
    ctx: &FrameContext<'_>,
    info: &InstanceInfo,
    patch: &Patch<'_>,
    hit: &Hit,
    binding: &Binding,
    smooth: Vec3,
) -> Option<(Vec3, Vec3)> {
    let stored =
        if patch.part.tangents.is_empty() { [None; 3] } else { patch.vertices.map(|i| ctx.tangent(hit, info, i)) };
    let (along, sign) = if let [Some((ta, sign)), Some((tb, _)), Some((tc, _))] = stored {
        let [w, u, v] = patch.weights;
        (ta * w + tb * u + tc * v, sign)
    } else {
        let (tangent, bitangent) = patch.tangents(binding)?;
        (tangent, if smooth.cross(tangent).dot(bitangent) < 0.0 { -1.0 } else { 1.0 })
    };
    let across = unit_or(along - smooth * smooth.dot(along), Vec3::ZERO);
    (across != Vec3::ZERO).then(|| (across, smooth.cross(across) * sign))
}
