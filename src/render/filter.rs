//! Which hits count: culled back faces, holes of masked materials, layers already passed.

use std::cell::Cell;

use super::{
    context::{FrameContext, InstanceInfo},
    found::{Maps, Spots},
    material::{Channel, Coverage},
    patch::Patch,
    wide::{One, V3, only},
};
use crate::{
    geom::{Hit, Ray},
    simd::Lanes,
};

/// Place of a hit in the order of blending: least `t`, then instance, then triangle.
type LayerKey = (f32, u32, u32);

/// A layer of blending that a ray has met.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Layer {
    key: LayerKey,
    on_edge: bool,
}

impl Layer {
    #[inline(always)]
    pub(crate) fn new(hit: &Hit) -> Self {
        const EDGE: f32 = 1e-6;
        let on_edge = hit.u.min(hit.v).min(1.0 - hit.u - hit.v) <= EDGE;
        Self { key: (hit.t, hit.instance.0, hit.prim.0), on_edge }
    }

    /// True when both are one surface: two triangles of a part that share the edge or corner where the ray meets them.
    #[inline(always)]
    fn joins(&self, other: &Self) -> bool {
        self.on_edge && other.on_edge && (self.key.0.to_bits(), self.key.1) == (other.key.0.to_bits(), other.key.1)
    }
}

/// True when a camera ray sees `hit`: not a culled back face, not in a hole, behind the layer `after`.
#[inline(always)]
pub(crate) fn is_seen(ctx: &FrameContext<'_>, ray: &Ray, after: Option<&Layer>, hit: &Hit) -> bool {
    if let Some(last) = after {
        let layer = Layer::new(hit);
        if layer.key <= last.key || layer.joins(last) {
            return false;
        }
    }
    let info = ctx.info(hit.instance);
    let material = ctx.material(info);
    (material.double_sided && material.coverage == Coverage::Opaque) || is_seen_closer(ctx, ray, info, hit)
}

/// The part of [`is_seen`] that looks at the triangle.
#[inline(never)]
fn is_seen_closer(ctx: &FrameContext<'_>, ray: &Ray, info: &InstanceInfo, hit: &Hit) -> bool {
    let material = ctx.material(info);
    if !material.double_sided {
        let part = ctx.scene(info).scene.part(info.part);
        let (_, [a, b, c]) = ctx.triangle(hit.instance, part, hit.prim);
        if ((b - a).cross(c - a).dot(ray.dir) > 0.0) != info.mirrored {
            return false;
        }
    }
    // Without blending, what is mostly there is drawn.
    let cutoff = match material.coverage {
        Coverage::Mask(cutoff) => cutoff,
        Coverage::Blend if !ctx.settings.shading.is_lit() => 0.5,
        Coverage::Opaque | Coverage::Blend => return true,
    };
    let spots = Spots::new(ctx, &[Some(*hit)]);
    let patch = spots.patch::<One>();
    alpha(&spots, &patch.with_steps(&ctx.rays, V3::splat(ray.dir), spots.t())) >= cutoff
}

/// Alpha of the one surface of `spots` at `patch`: factor, texture and vertex colour.
fn alpha(spots: &Spots<'_>, patch: &Patch<One>) -> f32 {
    let mut alpha = spots.number::<One>(|spot| spot.material.base.w);
    let mut maps = Maps::new(spots, patch);
    if let Some(placed) = maps.place(Channel::Base) {
        alpha = alpha * maps.read(&placed)[3];
    }
    let (colored, color) = spots.colors(patch);
    if colored != 0 {
        alpha = alpha * color[3];
    }
    only(alpha)
}

/// Most blended layers that a secondary ray keeps; more are dark enough.
const KEPT: usize = 16;

/// Blended layers on a secondary ray's way: the nearest ones, in order.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Layers {
    count: usize,
    kept: [(Layer, f32); KEPT],
}

impl Layers {
    /// Keeps a layer, once; the farthest falls off when there are too many.
    fn add(&mut self, layer: Layer, alpha: f32) {
        let kept = &mut self.kept[..self.count];
        if let Some(same) = kept.iter_mut().find(|(k, _)| k.key == layer.key || k.joins(&layer)) {
            if layer.key < same.0.key {
                *same = (layer, alpha);
            }
            return;
        }
        let at = kept.iter().take_while(|(k, _)| k.key < layer.key).count();
        if at < KEPT {
            self.count = (self.count + 1).min(KEPT);
            self.kept[at..self.count].rotate_right(1);
            self.kept[at] = (layer, alpha);
        }
    }

    /// The part of the light that all layers together let through.
    pub(crate) fn transmittance(&self) -> f32 {
        self.kept[..self.count].iter().fold(1.0, |through, (_, alpha)| through * (1.0 - alpha))
    }
}

impl FrameContext<'_> {
    /// True when `hit` stops a secondary ray; `width` is the footprint's width in metres. Blended layers let it pass
    /// and are kept in `layers`.
    #[inline(always)]
    pub(crate) fn stops(&self, width: f32, hit: &Hit, layers: &Cell<Layers>) -> bool {
        let info = self.info(hit.instance);
        self.material(info).coverage == Coverage::Opaque || self.stops_partly(info, width, hit, layers)
    }

    #[inline(never)]
    fn stops_partly(&self, info: &InstanceInfo, width: f32, hit: &Hit, layers: &Cell<Layers>) -> bool {
        let spots = Spots::new(self, &[Some(*hit)]);
        let alpha = alpha(&spots, &spots.patch::<One>().with_width(One::splat(width)));
        match self.material(info).coverage {
            Coverage::Opaque => true,
            Coverage::Mask(cutoff) => alpha >= cutoff,
            Coverage::Blend => {
                if alpha > 0.0 && alpha < 1.0 {
                    let mut all = layers.get();
                    all.add(Layer::new(hit), alpha);
                    layers.set(all);
                }
                alpha >= 1.0
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(t: f32, instance: u32, prim: u32) -> Layer {
        Layer { key: (t, instance, prim), on_edge: false }
    }

    #[test]
    fn layers_multiply_in_order_whatever_the_order_they_come_in() {
        let all: Vec<(Layer, f32)> =
            (0..12u32).map(|i| (layer(1.0 + (i / 3) as f32, i % 3, i), 0.1 + 0.03 * i as f32)).collect();
        let product = all.iter().fold(1.0f32, |p, (_, a)| p * (1.0 - a));
        for turn in 0..12 {
            let mut layers = Layers::default();
            for i in 0..12 {
                let (key, alpha) = all[(i * 5 + turn) % 12];
                layers.add(key, alpha);
                layers.add(key, alpha);
            }
            assert_eq!(layers.transmittance(), product);
        }
    }

    #[test]
    fn the_nearest_layers_are_kept_when_there_are_many() {
        let (mut up, mut down) = (Layers::default(), Layers::default());
        for i in 0..40u32 {
            up.add(layer(i as f32, 0, 0), 0.5);
            down.add(layer((39 - i) as f32, 0, 0), 0.5);
        }
        assert_eq!(up.kept.map(|k| k.0.key.0), std::array::from_fn(|i| i as f32));
        assert_eq!(down.kept.map(|k| k.0.key.0), up.kept.map(|k| k.0.key.0));
    }

    #[test]
    fn triangles_that_meet_at_an_edge_are_one_layer() {
        let edge = |instance, prim| Layer { key: (2.0, instance, prim), on_edge: true };
        let mut layers = Layers::default();
        for (instance, prim) in [(0, 4), (0, 3), (1, 4), (0, 4)] {
            layers.add(edge(instance, prim), 0.5);
        }
        layers.add(layer(2.0, 0, 5), 0.5);
        assert_eq!(layers.transmittance(), 0.125);
    }
}
