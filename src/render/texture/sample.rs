use glam::{Vec2, Vec4};

use super::Pyramid;
use crate::{
    render::math::{floor, log2},
    scene::{Filter, TexSampler, Wrap},
};

/// Most taps along the longer axis of a footprint.
const MAX_TAPS: f32 = 4.0;

/// How far texture coordinates move for one pixel to the right and one down.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Footprint {
    pub(crate) dx: Vec2,
    pub(crate) dy: Vec2,
}

/// Where and how finely to read: level of detail and, for stretched footprints, taps along the longer axis.
struct Plan {
    lod: f32,
    taps: u32,
    step: Vec2,
}

impl Plan {
    /// # Source
    /// Heckbert, "Survey of Texture Mapping", 1986, for the level; taps along the longer axis as in the OpenGL
    /// extension `EXT_texture_filter_anisotropic`.
    #[inline(always)]
    fn new(pyramid: &Pyramid, footprint: &Footprint) -> Self {
        let size = pyramid.level(0);
        let texels = Vec2::new(size.width as f32, size.height as f32);
        let (x2, y2) = ((footprint.dx * texels).length_squared(), (footprint.dy * texels).length_squared());
        let (long, long2, short2) = if x2 >= y2 { (footprint.dx, x2, y2) } else { (footprint.dy, y2, x2) };
        if long2 <= 1.0 || pyramid.level_count() == 1 || !long2.is_finite() {
            let lod = if long2.is_nan() { 0.0 } else { 0.5 * log2(long2.clamp(1e-12, 1e30)) };
            return Self { lod, taps: 1, step: Vec2::ZERO };
        }
        let ratio = (long2 / short2.max(1e-12)).sqrt().min(MAX_TAPS);
        let count = ratio.ceil().max(1.0);
        let lod = 0.5 * log2(long2) - log2(ratio.max(1.0));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to MAX_TAPS")]
        let taps = if lod > 0.0 { count as u32 } else { 1 };
        Self { lod, taps, step: long / count }
    }
}

/// The texture's linear RGBA at `uv` (v down), filtered over `footprint` as `sampler` says. Any float is taken.
pub(crate) fn sample(pyramid: &Pyramid, sampler: TexSampler, uv: Vec2, footprint: &Footprint) -> Vec4 {
    if pyramid.level_count() == 1 && pyramid.level(0).width == 1 && pyramid.level(0).height == 1 {
        return pyramid.texel(0, 0, 0);
    }
    let plan = Plan::new(pyramid, footprint);
    if plan.lod <= 0.0 {
        return at_level(pyramid, sampler, sampler.mag, 0, uv);
    }
    let mut sum = Vec4::ZERO;
    let first = -0.5 * (plan.taps - 1) as f32;
    for tap in 0..plan.taps {
        sum += between_levels(pyramid, sampler, plan.lod, uv + plan.step * (first + tap as f32));
    }
    sum / plan.taps as f32
}

/// Minified look-up at level of detail `lod`.
fn between_levels(pyramid: &Pyramid, sampler: TexSampler, lod: f32, uv: Vec2) -> Vec4 {
    let last = pyramid.level_count() - 1;
    let lod = lod.min(last as f32);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and the last level")]
    let level_of = |x: f32| x as usize;
    match sampler.mip {
        None => at_level(pyramid, sampler, sampler.min, 0, uv),
        Some(Filter::Nearest) => at_level(pyramid, sampler, sampler.min, level_of(lod + 0.5).min(last), uv),
        Some(Filter::Linear) => {
            let level = level_of(lod);
            let fine = at_level(pyramid, sampler, sampler.min, level, uv);
            let part = lod - level as f32;
            if part == 0.0 {
                return fine;
            }
            let coarse = at_level(pyramid, sampler, sampler.min, (level + 1).min(last), uv);
            fine + (coarse - fine) * part
        }
    }
}

/// Look-up in one level.
fn at_level(pyramid: &Pyramid, sampler: TexSampler, filter: Filter, level: usize, uv: Vec2) -> Vec4 {
    let size = pyramid.level(level);
    let (u, v) = (fold(uv.x, sampler.wrap_u), fold(uv.y, sampler.wrap_v));
    let (x, y) = (u * size.width as f32, v * size.height as f32);
    match filter {
        Filter::Nearest => {
            let nearest = |x: f32, size: u32| whole(x).clamp(0, i64::from(size) - 1).unsigned_abs();
            pyramid.texel(level, low(nearest(x, size.width)), low(nearest(y, size.height)))
        }
        Filter::Linear => {
            let (x0, x1, fx) = pair(x, size.width, sampler.wrap_u);
            let (y0, y1, fy) = pair(y, size.height, sampler.wrap_v);
            let top = pyramid.texel(level, x0, y0) * (1.0 - fx) + pyramid.texel(level, x1, y0) * fx;
            let bottom = pyramid.texel(level, x0, y1) * (1.0 - fx) + pyramid.texel(level, x1, y1) * fx;
            top * (1.0 - fy) + bottom * fy
        }
    }
}

/// A coordinate brought into [0, 1] as the wrap mode says; 0 for NaN and infinities.
#[inline(always)]
fn fold(x: f32, wrap: Wrap) -> f32 {
    let folded = match wrap {
        Wrap::Clamp => x,
        Wrap::Repeat => x - floor(x),
        Wrap::Mirror => {
            let two = x - 2.0 * floor(x * 0.5);
            if two > 1.0 { 2.0 - two } else { two }
        }
    };
    if folded >= 0.0 { folded.min(1.0) } else { 0.0 }
}

/// The two texels whose centres enclose `x` (in texels, within [0, size]) and the weight of the second.
#[inline(always)]
fn pair(x: f32, size: u32, wrap: Wrap) -> (u32, u32, f32) {
    let centred = x - 0.5;
    let below = floor(centred);
    let (first, last) = (whole(below), i64::from(size) - 1);
    let wrapped = |i: i64| match wrap {
        Wrap::Repeat if i < 0 => last,
        Wrap::Repeat if i > last => 0,
        // A mirrored neighbour of an edge texel is the edge texel itself.
        _ => i.clamp(0, last),
    };
    (low(wrapped(first).unsigned_abs()), low(wrapped(first + 1).unsigned_abs()), centred - below)
}

#[inline(always)]
fn whole(x: f32) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "at most the texture's size")]
    let i = floor(x) as i64;
    i
}

#[inline(always)]
fn low(i: u64) -> u32 {
    #[expect(clippy::cast_possible_truncation, reason = "below the texture's size")]
    let i = i as u32;
    i
}

#[cfg(test)]
mod tests {
    use super::{super::pyramid::tests::image, *};
    use crate::render::texture::Encoding;

    fn pyramid(width: u32, height: u32) -> Pyramid {
        let noise = image(width, height, |x, y| {
            let h = crate::render::pattern::hash(u64::from(x) << 20 | u64::from(y)).to_le_bytes();
            [h[0], h[1], h[2], h[3]]
        });
        Pyramid::new(&noise, Encoding::Linear, true)
    }

    /// The texel that an index in the endless plane stands for, by the definition of each mode.
    fn wrapped(i: i64, size: i64, wrap: Wrap) -> u32 {
        let at = match wrap {
            Wrap::Repeat => i.rem_euclid(size),
            Wrap::Mirror => {
                let j = i.rem_euclid(2 * size);
                if j < size { j } else { 2 * size - 1 - j }
            }
            Wrap::Clamp => i.clamp(0, size - 1),
        };
        u32::try_from(at).unwrap()
    }

    fn slow_linear(p: &Pyramid, s: TexSampler, uv: Vec2) -> Vec4 {
        let (w, h) = (p.level(0).width, p.level(0).height);
        let (x, y) = (f64::from(uv.x) * f64::from(w) - 0.5, f64::from(uv.y) * f64::from(h) - 0.5);
        let (ix, iy) = (x.floor(), y.floor());
        let mut sum = Vec4::ZERO;
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let weight = |d: i64, f: f64| if d == 1 { f } else { 1.0 - f };
            let part = (weight(dx, x - ix) * weight(dy, y - iy)) as f32;
            let tx = wrapped(ix as i64 + dx, i64::from(w), s.wrap_u);
            let ty = wrapped(iy as i64 + dy, i64::from(h), s.wrap_v);
            sum += p.texel(0, tx, ty) * part;
        }
        sum
    }

    #[test]
    fn linear_filter_and_every_wrap_mode_match_the_definition() {
        let p = pyramid(5, 3);
        for wrap_u in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for wrap_v in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                let s = TexSampler { wrap_u, wrap_v, ..TexSampler::default() };
                for i in 0..900 {
                    let uv = Vec2::new((i % 30) as f32 * 0.171 - 2.5, (i / 30) as f32 * 0.163 - 2.3);
                    let (fast, slow) = (sample(&p, s, uv, &Footprint::default()), slow_linear(&p, s, uv));
                    assert!((fast - slow).abs().max_element() < 1e-5, "{s:?} {uv}: {fast} {slow}");
                }
            }
        }
    }

    #[test]
    fn nearest_filter_reads_the_texel_that_holds_the_point() {
        let p = pyramid(4, 4);
        let s = TexSampler { mag: Filter::Nearest, wrap_u: Wrap::Mirror, ..TexSampler::default() };
        for (u, x) in [(0.1, 0), (0.3, 1), (0.99, 3), (1.01, 3), (1.3, 2), (1.99, 0), (2.01, 0), (-0.01, 0), (-0.3, 1)]
        {
            let got = sample(&p, s, Vec2::new(u, 0.1), &Footprint::default());
            assert_eq!(got, p.texel(0, x, 0), "{u}");
        }
    }

    #[test]
    fn the_level_follows_the_footprint() {
        let p = pyramid(64, 64);
        let s = TexSampler { mip: Some(Filter::Nearest), min: Filter::Nearest, ..TexSampler::default() };
        for level in 1..=6usize {
            let width = (1 << level) as f32 / 64.0;
            let f = Footprint { dx: Vec2::new(width, 0.0), dy: Vec2::new(0.0, width) };
            let got = sample(&p, s, Vec2::splat(0.001), &f);
            assert_eq!(got, p.texel(level, 0, 0), "level {level}");
        }
        let far = Footprint { dx: Vec2::splat(1e9), dy: Vec2::splat(1e9) };
        assert_eq!(sample(&p, s, Vec2::splat(0.4), &far), p.texel(6, 0, 0));
    }

    #[test]
    fn a_stretched_footprint_keeps_detail_across_it() {
        let stripes = Pyramid::new(
            &image(64, 64, |x, _| if x % 16 < 8 { [255; 4] } else { [0, 0, 0, 255] }),
            Encoding::Linear,
            true,
        );
        let f = Footprint { dx: Vec2::new(1.0 / 64.0, 0.0), dy: Vec2::new(0.0, 4.0 / 64.0) };
        let s = TexSampler::default();
        assert!(sample(&stripes, s, Vec2::new(4.0 / 64.0, 0.5), &f).x > 0.95);
        assert!(sample(&stripes, s, Vec2::new(12.0 / 64.0, 0.5), &f).x < 0.05);
    }

    #[test]
    fn without_mip_filter_the_finest_level_is_read() {
        let p = pyramid(8, 8);
        let s = TexSampler { mip: None, min: Filter::Nearest, ..TexSampler::default() };
        let f = Footprint { dx: Vec2::splat(0.7), dy: Vec2::new(0.7, -0.7) };
        assert_eq!(sample(&p, s, Vec2::splat(0.001), &f), p.texel(0, 0, 0));
    }

    #[test]
    fn any_float_is_a_coordinate() {
        let p = pyramid(6, 5);
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1e30, 1e-45, 0.999_999_94];
        for u in odd {
            for v in odd {
                for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                    let s = TexSampler { wrap_u: wrap, wrap_v: wrap, ..TexSampler::default() };
                    let f = Footprint { dx: Vec2::new(u, v), dy: Vec2::new(v, u) };
                    let got = sample(&p, s, Vec2::new(v, u), &f);
                    assert!(got.x >= 0.0 && got.x <= 1.0, "{u} {v}: {got}");
                }
            }
        }
    }
}
