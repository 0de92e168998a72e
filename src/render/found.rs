//! What the rays of a block found: a spot a lane, and its numbers by component.

use glam::{Vec3, Vec4};

use super::{
    context::{FrameContext, InstanceInfo},
    material::{Binding, Channel, ShadeMaterial, tex_coord},
    patch::Patch,
    texture::{Footprint, Pyramid, Source, sample, sample_one},
    wide::{Bits, Floats, LANES, Row, V2, V3, put2, put3},
};
use crate::{
    geom::{Hit, InstanceId},
    scene::MeshPart,
};

/// A point on a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot<'a> {
    pub(crate) info: &'a InstanceInfo,
    pub(crate) material: &'a ShadeMaterial,
    pub(crate) part: &'a MeshPart,
    pyramids: &'a [Pyramid],
    vertices: [u32; 3],
    pub(crate) instance: InstanceId,
}

/// The spots of a block's lanes.
#[derive(Debug)]
pub(crate) struct Spots<'a> {
    /// Lanes that have a spot; in others anything stands, and numbers are 0.
    pub(crate) mask: u32,
    found: [Option<Spot<'a>>; LANES],
    /// A spot of the one instance that all spots are on; `None` when there are several.
    only: Option<Spot<'a>>,
    corners: [[Row; 3]; 3],
    t: Row,
    u: Row,
    v: Row,
}

/// Four channels of texels or vertex colours.
pub(crate) type Channels<F> = [F; 4];

impl<'a> Spots<'a> {
    /// The spots of `hits`.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn new(ctx: &FrameContext<'a>, hits: &[Option<Hit>]) -> Self {
        let zero = [0.0; LANES];
        let mut out =
            Self { mask: 0, found: [None; LANES], only: None, corners: [[zero; 3]; 3], t: zero, u: zero, v: zero };
        let (mut first, mut uniform) = (None, true);
        for (lane, hit) in hits.iter().enumerate() {
            if let Some(hit) = hit {
                out.put(ctx, lane & (LANES - 1), hit);
                uniform &= *first.get_or_insert(hit.instance) == hit.instance;
            }
        }
        if uniform && out.mask != 0 {
            out.only = out.found[out.mask.trailing_zeros() as usize & (LANES - 1)];
        }
        out
    }

    #[inline(always)]
    fn put(&mut self, ctx: &FrameContext<'a>, lane: usize, hit: &Hit) {
        let info = ctx.info(hit.instance);
        let scene = ctx.scene(info);
        let (material, part) = (&scene.materials[info.material as usize], scene.scene.part(info.part));
        let (vertices, corners) = ctx.triangle(hit.instance, part, hit.prim);
        for (rows, corner) in self.corners.iter_mut().zip(corners) {
            put3(rows, lane, corner);
        }
        (self.t[lane], self.u[lane], self.v[lane]) = (hit.t, hit.u, hit.v);
        let pyramids = &scene.pyramids;
        self.found[lane] = Some(Spot { info, material, part, pyramids, vertices, instance: hit.instance });
        self.mask |= 1 << lane;
    }

    /// The triangles with the places on them.
    #[inline(always)]
    pub(crate) fn patch<F: Floats>(&self) -> Patch<F> {
        let [a, b, c] = &self.corners;
        Patch::new([V3::load(a), V3::load(b), V3::load(c)], F::load(&self.u), F::load(&self.v))
    }

    /// Edges from the first corner to the second crossed with those to the third.
    #[inline(always)]
    pub(crate) fn cross<F: Floats>(&self) -> V3<F> {
        let [a, b, c] = &self.corners;
        let a = V3::<F>::load(a);
        (V3::load(b) - a).cross(V3::load(c) - a)
    }

    /// Ray parameters.
    #[inline(always)]
    pub(crate) fn t<F: Floats>(&self) -> F {
        F::load(&self.t)
    }

    /// Lanes whose spot is one of those asked for, by what holds for an instance as a whole.
    #[inline(always)]
    pub(crate) fn lanes(&self, wanted: impl Fn(&Spot<'a>) -> bool) -> u32 {
        if let Some(spot) = &self.only {
            return if wanted(spot) { self.mask } else { 0 };
        }
        let mut mask = 0;
        for lane in Bits(self.mask) {
            if self.found[lane].as_ref().is_some_and(&wanted) {
                mask |= 1 << lane;
            }
        }
        mask
    }

    /// A number of every spot's instance.
    #[inline(always)]
    pub(crate) fn number<F: Floats>(&self, of: impl Fn(&Spot<'a>) -> f32) -> F {
        if let Some(spot) = &self.only {
            return F::splat(of(spot));
        }
        let mut out = [0.0; LANES];
        for lane in Bits(self.mask) {
            if let Some(spot) = &self.found[lane] {
                out[lane] = of(spot);
            }
        }
        F::load(&out)
    }

    /// A vector of every spot's instance.
    #[inline(always)]
    pub(crate) fn vector<F: Floats>(&self, of: impl Fn(&Spot<'a>) -> Vec3) -> V3<F> {
        if let Some(spot) = &self.only {
            return V3::splat(of(spot));
        }
        let mut out = [[0.0; LANES]; 3];
        for lane in Bits(self.mask) {
            if let Some(spot) = &self.found[lane] {
                put3(&mut out, lane, of(spot));
            }
        }
        V3::load(&out)
    }

    /// Vectors at the corners by `of` and the lanes that have all three.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn at_corners<F: Floats>(
        &self,
        mask: u32,
        of: impl Fn(&Spot<'a>, u32) -> Option<Vec3>,
    ) -> (u32, [V3<F>; 3]) {
        let mut rows = [[[0.0; LANES]; 3]; 3];
        let mut found = 0;
        for lane in Bits(mask & self.mask) {
            let Some(spot) = &self.found[lane] else { continue };
            let [i, j, k] = spot.vertices;
            if let (Some(a), Some(b), Some(c)) = (of(spot, i), of(spot, j), of(spot, k)) {
                put3(&mut rows[0], lane, a);
                put3(&mut rows[1], lane, b);
                put3(&mut rows[2], lane, c);
                found |= 1 << lane;
            }
        }
        (found, [V3::load(&rows[0]), V3::load(&rows[1]), V3::load(&rows[2])])
    }

    /// Lanes of `mask` whose first corner is one of those asked for.
    #[inline(always)]
    pub(crate) fn lanes_at_corner(&self, mask: u32, wanted: impl Fn(&Spot<'a>, u32) -> bool) -> u32 {
        let mut out = 0;
        for lane in Bits(mask & self.mask) {
            if self.found[lane].as_ref().is_some_and(|spot| wanted(spot, spot.vertices[0])) {
                out |= 1 << lane;
            }
        }
        out
    }

    /// Vertex colours, and the lanes that have some.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn colors<F: Floats>(&self, patch: &Patch<F>) -> (u32, Channels<F>) {
        let mut out = [F::splat(0.0); 4];
        if self.only.is_some_and(|spot| spot.part.colors.is_empty()) {
            return (0, out);
        }
        let mut rows = [[[0.0; LANES]; 4]; 3];
        let mut found = 0;
        for lane in Bits(self.mask) {
            let Some(spot) = &self.found[lane] else { continue };
            if spot.part.colors.is_empty() {
                continue;
            }
            for (rows, vertex) in rows.iter_mut().zip(spot.vertices) {
                put4(rows, lane, spot.part.colors[vertex as usize]);
            }
            found |= 1 << lane;
        }
        if found != 0 {
            let [a, b, c] = &rows;
            for channel in 0..4 {
                out[channel] = patch.blend(F::load(&a[channel]), F::load(&b[channel]), F::load(&c[channel]));
            }
        }
        (found, out)
    }
}

/// Texture look-ups at the spots of a block: coordinates are found once for maps that share a set.
pub(crate) struct Maps<'a, 'b, F> {
    spots: &'b Spots<'a>,
    patch: &'b Patch<F>,
    /// TEXCOORD set and coordinates of the corners, a lane.
    known: Option<([u32; LANES], Corners<F>)>,
}

/// File coordinates of a patch' corners.
#[derive(Clone, Copy, Debug)]
struct Corners<F>([V2<F>; 3]);

/// Where a channel's textures are read: the lanes that have one, and the map from file to texture coordinates.
pub(crate) struct Placed<'a, F> {
    pub(crate) mask: u32,
    bindings: [Option<&'a Binding>; LANES],
    rows: [V2<F>; 2],
    corners: [V2<F>; 3],
    offset: V2<F>,
}

impl<F: Floats> Placed<'_, F> {
    /// True when both read the same textures at the same places.
    #[inline(always)]
    pub(crate) fn is(&self, other: &Self) -> bool {
        self.mask == other.mask && Bits(self.mask).all(|lane| self.bindings[lane] == other.bindings[lane])
    }

    /// Differences of file coordinates as differences of texture coordinates.
    #[inline(always)]
    fn turn(&self, uv: V2<F>) -> V2<F> {
        let [x, y] = self.rows;
        V2 { x: x.x * uv.x + x.y * uv.y, y: y.x * uv.x + y.y * uv.y }
    }

    /// Differences of texture coordinates along the two edges from the first corner.
    #[inline(always)]
    pub(crate) fn edges(&self) -> [V2<F>; 2] {
        let [a, b, c] = self.corners;
        [self.turn(b - a), self.turn(c - a)]
    }
}

impl<'a, 'b, F: Floats> Maps<'a, 'b, F> {
    /// Look-ups at `spots`, where `patch` is their triangles with footprints.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn new(spots: &'b Spots<'a>, patch: &'b Patch<F>) -> Self {
        Self { spots, patch, known: None }
    }

    /// Where the textures of a channel are read; `None` when no lane has one.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn place(&mut self, channel: Channel) -> Option<Placed<'a, F>> {
        if let Some(spot) = &self.spots.only {
            let binding = spot.material.map(channel)?;
            return Some(self.place_all(binding));
        }
        let mut bindings = [None; LANES];
        let (mut mask, mut sets) = (0, [0; LANES]);
        let mut transform = [[0.0; LANES]; 6];
        for lane in Bits(self.spots.mask) {
            let binding = self.spots.found[lane].as_ref().and_then(|spot| spot.material.map(channel));
            let Some(binding) = binding else { continue };
            bindings[lane] = Some(binding);
            sets[lane] = binding.set;
            mask |= 1 << lane;
            let ([x, y], o) = (binding.rows, binding.offset);
            for (row, number) in transform.iter_mut().zip([x.x, x.y, y.x, y.y, o.x, o.y]) {
                row[lane] = number;
            }
        }
        if mask == 0 {
            return None;
        }
        let corners = self.corners(mask, &sets);
        let [a, b, c, d, e, f] = &transform;
        let rows = [V2 { x: F::load(a), y: F::load(b) }, V2 { x: F::load(c), y: F::load(d) }];
        let offset = V2 { x: F::load(e), y: F::load(f) };
        Some(Placed { mask, bindings, rows, corners: corners.0, offset })
    }

    /// [`Maps::place`] where all spots read the same texture.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn place_all(&mut self, binding: &'a Binding) -> Placed<'a, F> {
        let mask = self.spots.mask;
        let corners = self.corners(mask, &[binding.set; LANES]);
        let rows = [V2::splat(binding.rows[0]), V2::splat(binding.rows[1])];
        Placed { mask, bindings: [Some(binding); LANES], rows, corners: corners.0, offset: V2::splat(binding.offset) }
    }

    /// Coordinates of the corners in the sets asked for.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn corners(&mut self, mask: u32, sets: &[u32; LANES]) -> Corners<F> {
        if let Some((known, corners)) = &self.known
            && Bits(mask).all(|lane| known[lane] == sets[lane])
        {
            return *corners;
        }
        let mut rows = [[[0.0; LANES]; 2]; 3];
        for lane in Bits(self.spots.mask) {
            if let Some(spot) = &self.spots.found[lane] {
                let corners = tex_coord(spot.part, sets[lane], spot.vertices);
                for (rows, uv) in rows.iter_mut().zip(corners) {
                    put2(rows, lane, uv);
                }
            }
        }
        let corners = Corners([V2::load(&rows[0]), V2::load(&rows[1]), V2::load(&rows[2])]);
        self.known = Some((*sets, corners));
        corners
    }

    /// The filtered texels.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn read(&self, placed: &Placed<'a, F>) -> Channels<F> {
        let [a, b, c] = placed.corners;
        let (du, dv) = (b - a, c - a);
        let [right, down] = self.patch.steps();
        let footprint =
            Footprint { dx: placed.turn(du * right.x + dv * right.y), dy: placed.turn(du * down.x + dv * down.y) };
        let [w, u, v] = self.patch.weights;
        let uv = placed.turn(a * w + b * u + c * v) + placed.offset;
        if let (Some(spot), Some(binding)) = (&self.spots.only, placed.bindings[0]) {
            let source = Source { pyramid: &spot.pyramids[binding.pyramid as usize], sampler: binding.sampler };
            return sample_one(&source, placed.mask, uv, &footprint);
        }
        let mut sources = [None; LANES];
        for lane in Bits(placed.mask) {
            if let (Some(spot), Some(binding)) = (&self.spots.found[lane], placed.bindings[lane]) {
                let pyramid = &spot.pyramids[binding.pyramid as usize];
                sources[lane] = Some(Source { pyramid, sampler: binding.sampler });
            }
        }
        sample(&sources, uv, &footprint)
    }
}

#[inline(always)]
fn put4(rows: &mut [Row; 4], lane: usize, v: Vec4) {
    for (row, number) in rows.iter_mut().zip(v.to_array()) {
        row[lane] = number;
    }
}
