//! From hits to surface points: positions, normals.

use glam::Vec3;

use super::{
    context::FrameContext,
    departure::Departure,
    found::{Maps, Placed, Spots},
    material::Channel,
    offset::off_surface,
    patch::Patch,
    wide::{Floats, V3},
};
use crate::geom::Precision;

/// Surface points ready for shading, a lane each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface<'p, F> {
    pub(crate) point: V3<F>,
    /// How rays leave; `None` where a fixed way off the surface does.
    departure: Option<Departure<'p, F>>,
    /// Unit geometric normal on the viewer's side.
    pub(crate) n_geom: V3<F>,
    /// Unit shading normal on the viewer's side, never turned away from the viewer.
    pub(crate) n_shade: V3<F>,
    /// Cosine between the interpolated (not mapped) normal and the geometric one.
    pub(crate) between: F,
    /// Unit direction to the viewer.
    pub(crate) view: V3<F>,
    /// How far the smooth surface that the normals suggest bulges over the facet here.
    bulge: V3<F>,
    /// Length of the filtered normal map vector: below 1 where normals vary within the footprint.
    pub(crate) map_length: F,
}

impl<'p, F: Floats> Surface<'p, F> {
    /// The surfaces at `spots`, whose triangles are `patch`, where rays along `dir` met them.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn new<'a>(
        ctx: &FrameContext<'a>,
        spots: &Spots<'a>,
        patch: &'p Patch<F>,
        maps: &mut Maps<'a, '_, F>,
        dir: V3<F>,
    ) -> Self {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let view = (-dir).unit_or(V3::splat(Vec3::Z));
        let point = patch.blend3(patch.corners);
        let exact = ctx.world.forms().offset == Precision::Exact;
        let departure = if exact { Some(Departure::new(patch, point, spots.mask)) } else { None };
        let side = F::select(spots.lanes(|spot| spot.info.mirrored), -one, one);
        // Outward by the file's winding, before it is turned to the viewer.
        let outward = (patch.cross * side).unit_or(view);
        let facing = F::select(zero.le(outward.dot(view)), one, -one);
        let n_geom = outward * facing;

        let (smoothed, normals) = spots.at_corners(spots.mask, |spot, i| ctx.normal(spot.instance, spot.info, i));
        let smooth = V3::select(smoothed, patch.blend3(normals).unit_or(outward), outward);
        let [na, nb, nc] = normals;
        let bulge = bulge(point, patch, [na * facing, nb * facing, nc * facing]);
        let lifts = F::splat(0.0).le(bulge.dot(n_geom));
        let bulge = V3::select(smoothed & lifts, bulge, V3::zero());
        let (mapped, map_length) = match maps.place(Channel::Normal) {
            Some(placed) => mapped_normal(ctx, spots, patch, maps, &placed, smooth),
            None => (smooth, one),
        };
        // Normals that contradict the winding are taken as an artist's inverted normals.
        let turn = F::select(smooth.dot(outward).lt(zero), -facing, facing);
        let n_shade = towards_viewer(mapped * turn, view);
        let between = (smooth * turn).dot(n_geom);
        Self { point, departure, n_geom, n_shade, between, view, bulge, map_length }
    }

    /// Where rays that leave along `dir` start.
    #[inline(always)]
    pub(crate) fn origin(&self, dir: V3<F>) -> V3<F> {
        if let Some(departure) = &self.departure {
            return departure.origin(self.n_geom, dir);
        }
        off_surface(self.point, self.n_geom, dir)
    }

    /// [`Surface::origin`] for shadow rays: lifted to the smooth surface, so that facets do not shadow themselves.
    #[inline(always)]
    pub(crate) fn shadow_origin(&self, dir: V3<F>) -> V3<F> {
        self.origin(dir) + self.bulge
    }
}

/// Distance from the facet to the surface that the corner normals suggest; zero where that lies below.
///
/// # Source
/// Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021.
#[cfg_attr(not(debug_assertions), inline(always))]
fn bulge<F: Floats>(point: V3<F>, patch: &Patch<F>, normals: [V3<F>; 3]) -> V3<F> {
    let mut sum = V3::zero();
    for ((corner, weight), normal) in patch.corners.into_iter().zip(patch.weights).zip(normals) {
        let below = (point - corner).dot(normal).min(F::splat(0.0));
        sum = sum - normal * (below * weight);
    }
    sum
}

/// Keeps shading normals on the viewer's side: tilted just enough where interpolation or a map turned them away.
#[cfg_attr(not(debug_assertions), inline(always))]
fn towards_viewer<F: Floats>(n: V3<F>, view: V3<F>) -> V3<F> {
    let least = F::splat(0.02);
    let cos = n.dot(view);
    let upright = least.le(cos);
    if upright == F::ALL {
        return n;
    }
    V3::select(upright, n, (n + view * (least - cos)).unit_or(view))
}

/// The normal maps' normals around `smooth`, on the side of the file's winding, and the lengths of the filtered
/// vectors; `smooth` and 1 in lanes without a map.
#[cfg_attr(not(debug_assertions), inline(always))]
fn mapped_normal<'a, F: Floats>(
    ctx: &FrameContext<'a>,
    spots: &Spots<'a>,
    patch: &Patch<F>,
    maps: &Maps<'a, '_, F>,
    placed: &Placed<'a, F>,
    smooth: V3<F>,
) -> (V3<F>, F) {
    let one = F::splat(1.0);
    let [x, y, z, _] = maps.read(placed);
    let raw = V3 { x, y, z } * F::splat(2.0) - V3::all(one);
    let scale = spots.number(|spot| spot.material.normal_scale);
    let (framed, tangent, bitangent) = tangent_frame(ctx, spots, patch, placed, smooth);
    let n = tangent * (raw.x * scale) + bitangent * (raw.y * scale) + smooth * raw.z;
    let normal = V3::select(framed, n.unit_or(smooth), smooth);
    (normal, F::select(framed, raw.length().min(one), one))
}

/// Unit tangents and bitangents perpendicular to `smooth`: the file's, else from the texture coordinates; and the lanes
/// that have them.
#[cfg_attr(not(debug_assertions), inline(always))]
fn tangent_frame<'a, F: Floats>(
    ctx: &FrameContext<'a>,
    spots: &Spots<'a>,
    patch: &Patch<F>,
    placed: &Placed<'a, F>,
    smooth: V3<F>,
) -> (u32, V3<F>, V3<F>) {
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    let asked = placed.mask & spots.lanes(|spot| !spot.part.tangents.is_empty());
    let mut along = V3::zero();
    let mut sign = one;
    let mut stored = 0;
    if asked != 0 {
        let (found, corners) =
            spots.at_corners(asked, |spot, i| ctx.tangent(spot.instance, spot.info, i).map(|(t, _)| t));
        let negative = spots.lanes_at_corner(found, |spot, i| {
            ctx.tangent(spot.instance, spot.info, i).is_some_and(|(_, sign)| sign < 0.0)
        });
        (stored, along, sign) = (found, patch.blend3(corners), F::select(negative, -one, one));
    }
    let mut known = stored;
    if placed.mask & !stored != 0 {
        let [du, dv] = placed.edges();
        let [a, b, c] = patch.corners;
        let (e1, e2) = (b - a, c - a);
        let det = du.x * dv.y - dv.x * du.y;
        let turned = F::select(det.lt(zero), -one, one);
        let tangent = (e1 * dv.y - e2 * du.y) * turned;
        let bitangent = (e1 * dv.x - e2 * du.x) * turned;
        let spans = zero.lt(det.abs()) & det.abs().lt(F::splat(f32::INFINITY));
        let left = F::select(smooth.cross(tangent).dot(bitangent).lt(zero), -one, one);
        along = V3::select(stored, along, tangent);
        sign = F::select(stored, sign, left);
        known |= placed.mask & spans;
    }
    let across = (along - smooth * smooth.dot(along)).unit_or(V3::zero());
    let framed = known & zero.lt(across.abs().max_element());
    (framed, across, smooth.cross(across) * sign)
}
