use super::{Pyramid, pyramid::Level};
use crate::{
    render::wide::{Bits, Floats, LANES, V2, log2, row},
    scene::{Filter, TexSampler, Wrap},
    simd::{Simd, Task},
};

/// Most taps along the longer axis of a footprint.
const MAX_TAPS: usize = 4;

/// How far texture coordinates move for one pixel to the right and one down.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint<F> {
    pub(crate) dx: V2<F>,
    pub(crate) dy: V2<F>,
}

/// A texture and how it is read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source<'a> {
    pub(crate) pyramid: &'a Pyramid,
    pub(crate) sampler: TexSampler,
}

impl PartialEq for Source<'_> {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.pyramid, other.pyramid) && self.sampler == other.sampler
    }
}

/// Where and how finely to read, a look-up a lane: level of detail and, for stretched footprints, taps along the longer axis.
struct Plan<F> {
    lod: F,
    taps: F,
    step: V2<F>,
}

impl<F: Floats> Plan<F> {
    /// Plans the look-ups of textures that have `texels` (width and height) on their finest level; `layered` lanes have
    /// coarser levels.
    ///
    /// # Source
    /// Heckbert, "Survey of Texture Mapping", 1986, for the level; taps along the longer axis as in the OpenGL
    /// extension `EXT_texture_filter_anisotropic`.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn new(texels: V2<F>, layered: u32, footprint: &Footprint<F>) -> Self {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let x2 = scaled(footprint.dx, texels).length_squared();
        let y2 = scaled(footprint.dy, texels).length_squared();
        let wide = y2.le(x2);
        let long = V2::select(wide, footprint.dx, footprint.dy);
        let (long2, short2) = (F::select(wide, x2, y2), F::select(wide, y2, x2));
        let round = F::splat(0.5) * log2(long2.max(F::splat(1e-12)).min(F::splat(1e30)));
        let ratio = (long2 / short2.max(F::splat(1e-12))).sqrt().min(F::splat(MAX_TAPS as f32));
        let mut count = one;
        for whole in 1..MAX_TAPS {
            let whole = whole as f32;
            count = F::select(F::splat(whole).lt(ratio), F::splat(whole + 1.0), count);
        }
        let sharp = round - log2(ratio.max(one));
        let stretched = layered & one.lt(long2) & long2.lt(F::splat(f32::INFINITY));
        let lod = F::select(long2.le(long2), F::select(stretched, sharp, round), zero);
        let several = stretched & zero.lt(lod);
        let none = V2 { x: zero, y: zero };
        let step = V2 { x: long.x / count, y: long.y / count };
        Self { lod, taps: F::select(several, count, one), step: V2::select(several, step, none) }
    }
}

#[inline(always)]
fn scaled<F: Floats>(step: V2<F>, texels: V2<F>) -> V2<F> {
    V2 { x: step.x * texels.x, y: step.y * texels.y }
}

/// What each lane reads of one texture: up to two levels, blended.
struct Levels<F> {
    near: Chosen<F>,
    far: Chosen<F>,
    /// Weight of the second.
    part: F,
    /// Lanes that read two.
    blended: u32,
    /// Lanes that read single texels.
    nearest: u32,
}

impl<F: Floats> Levels<F> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn new(Source { pyramid, sampler }: &Source<'_>, mask: u32, lod: F) -> Self {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let last = pyramid.level_count() - 1;
        let smaller = mask & zero.lt(lod);
        let lod = F::select(smaller, lod.min(F::splat(last as f32)), zero);
        let level = match sampler.mip {
            None => zero,
            Some(Filter::Nearest) => (lod + F::splat(0.5)).floor().min(F::splat(last as f32)),
            Some(Filter::Linear) => lod.floor(),
        };
        let (mut part, mut blended) = (zero, 0);
        if sampler.mip == Some(Filter::Linear) {
            part = lod - level;
            blended = smaller & zero.lt(part);
        }
        let finest = pyramid.level(0);
        // A single texel is what it is, not a blend of itself.
        let single = last == 0 && finest.width == 1 && finest.height == 1;
        let mut nearest = if single || sampler.min == Filter::Nearest { smaller } else { 0 };
        if single || sampler.mag == Filter::Nearest {
            nearest |= !smaller & F::ALL;
        }
        let near = Chosen::new(pyramid, mask, level);
        let far = if blended == 0 { near } else { Chosen::new(pyramid, blended, level + one) };
        Self { near, far, part, blended, nearest }
    }
}

/// A level of a texture, a lane.
#[derive(Clone, Copy)]
struct Chosen<F> {
    width: F,
    height: F,
    stride: [u32; LANES],
    /// Its first texel among those of the coarser levels.
    first: [u32; LANES],
    /// Lanes that read the finest level.
    finest: u32,
}

impl<F: Floats> Chosen<F> {
    /// The levels of whole numbers that the lanes of `mask` name, at most the last; others name any.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn new(pyramid: &Pyramid, mask: u32, level: F) -> Self {
        let last = pyramid.level_count() - 1;
        let numbers = whole(level);
        let lead = numbers[mask.trailing_zeros() as usize % LANES];
        let one = F::splat(lead as f32);
        let finest = level.le(F::splat(0.0));
        if mask & !(level.le(one) & one.le(level)) == 0 {
            let Level { width, height, first } = pyramid.level(last.min(lead as usize));
            return Self {
                width: F::splat(width as f32),
                height: F::splat(height as f32),
                stride: [width; LANES],
                first: [first; LANES],
                finest: finest | !mask,
            };
        }
        let (mut sizes, mut stride, mut starts) = ([[1.0; LANES]; 2], [1; LANES], [0; LANES]);
        for lane in Bits(mask) {
            let Level { width, height, first } = pyramid.level(last.min(numbers[lane] as usize));
            (sizes[0][lane], sizes[1][lane]) = (width as f32, height as f32);
            (stride[lane], starts[lane]) = (width, first);
        }
        Self { width: F::load(&sizes[0]), height: F::load(&sizes[1]), stride, first: starts, finest }
    }

    /// The blend of the four texels around the folded coordinates `u` and `v`, for the lanes of `mask`.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn read(&self, Source { pyramid, sampler }: &Source<'_>, mask: u32, [u, v]: [F; 2], nearest: u32) -> [F; 4] {
        let repeat = |wrap: Wrap| if wrap == Wrap::Repeat { F::ALL } else { 0 };
        let (columns, right) = pair(u * self.width, self.width, repeat(sampler.wrap_u), nearest);
        let (rows, lower) = pair(v * self.height, self.height, repeat(sampler.wrap_v), nearest);
        let (columns, rows) = ([whole(columns[0]), whole(columns[1])], [whole(rows[0]), whole(rows[1])]);
        let (left, upper) = (F::splat(1.0) - right, F::splat(1.0) - lower);
        let a = self.texels(pyramid, mask, &rows[0], &columns[0]);
        let b = self.texels(pyramid, mask, &rows[0], &columns[1]);
        let c = self.texels(pyramid, mask, &rows[1], &columns[0]);
        let d = self.texels(pyramid, mask, &rows[1], &columns[1]);
        let mut out = a;
        for i in 0..4 {
            let top = a[i] * left + b[i] * right;
            let bottom = c[i] * left + d[i] * right;
            out[i] = top * upper + bottom * lower;
        }
        out
    }

    /// The texels of the lanes of `mask` in these rows and columns.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn texels(&self, pyramid: &Pyramid, mask: u32, rows: &[u32; LANES], columns: &[u32; LANES]) -> [F; 4] {
        let mut places = [0; LANES];
        for lane in 0..F::LEN {
            // Numbers past 2^24 are not exact in f32.
            let row = rows[lane].wrapping_mul(self.stride[lane]);
            places[lane] = row.wrapping_add(columns[lane]).wrapping_add(self.first[lane]);
        }
        pyramid.texels::<F>(&places, mask, self.finest)
    }
}

/// The textures' linear RGBA at `uv` (v down), filtered over `footprint` as their samplers say; 0 in lanes without one.
/// Any float is taken. Lanes that read one texture in one way are read together.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(crate) fn sample<F: Floats>(sources: &[Option<Source<'_>>; LANES], uv: V2<F>, footprint: &Footprint<F>) -> [F; 4] {
    let mut out = [F::splat(0.0); 4];
    let mut left = F::ALL;
    while left != 0 {
        let lead = &sources[left.trailing_zeros() as usize % LANES];
        let mut same = 0;
        for (lane, source) in sources.iter().enumerate() {
            same |= u32::from(source == lead) << lane;
        }
        same &= left;
        left &= !same;
        if let Some(source) = lead {
            let texels = sample_one(source, same, uv, footprint);
            for i in 0..4 {
                out[i] = F::select(same, texels[i], out[i]);
            }
        }
    }
    out
}

/// [`sample`] of one texture for the lanes of `mask`, at least one; anything in others.
#[inline(always)]
pub(crate) fn sample_one<F: Floats>(source: &Source<'_>, mask: u32, uv: V2<F>, footprint: &Footprint<F>) -> [F; 4] {
    F::Level::call(SampleOne { source, mask, uv, footprint })
}

/// [`sample_one`] as a function of its own: it is long, and asked for in many places.
struct SampleOne<'a, F> {
    source: &'a Source<'a>,
    mask: u32,
    uv: V2<F>,
    footprint: &'a Footprint<F>,
}

impl<F: Floats> Task for SampleOne<'_, F> {
    type Output = [F; 4];

    #[inline(always)]
    fn run<S: Simd>(self) -> [F; 4] {
        look_up(self.source, self.mask, self.uv, self.footprint)
    }
}

#[cfg_attr(not(debug_assertions), inline(always))]
fn look_up<F: Floats>(source: &Source<'_>, mask: u32, uv: V2<F>, footprint: &Footprint<F>) -> [F; 4] {
    let Source { pyramid, sampler } = source;
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    let size = pyramid.level(0);
    let layered = if pyramid.level_count() > 1 { F::ALL } else { 0 };
    let texels = V2 { x: F::splat(size.width as f32), y: F::splat(size.height as f32) };
    let plan = Plan::new(texels, layered, footprint);
    let levels = Levels::new(source, mask, plan.lod);
    let first = F::splat(-0.5) * (plan.taps - one);
    let mut sum = [zero; 4];
    for tap in 0..MAX_TAPS {
        let tap = F::splat(tap as f32);
        let open = mask & tap.lt(plan.taps);
        if open == 0 {
            break;
        }
        let at = uv + plan.step * (first + tap);
        let place = [fold(at.x, sampler.wrap_u), fold(at.y, sampler.wrap_v)];
        let mut texel = levels.near.read(source, open, place, levels.nearest);
        let blended = levels.blended & open;
        if blended != 0 {
            let far = levels.far.read(source, blended, place, levels.nearest);
            for i in 0..4 {
                texel[i] = F::select(blended, texel[i] + (far[i] - texel[i]) * levels.part, texel[i]);
            }
        }
        for i in 0..4 {
            sum[i] = F::select(open, sum[i] + texel[i], sum[i]);
        }
    }
    let several = mask & one.lt(plan.taps);
    if several != 0 {
        for sum in &mut sum {
            *sum = F::select(several, *sum / plan.taps, *sum);
        }
    }
    sum
}

/// Coordinates brought into [0, 1] as the wrap modes say; 0 for NaN and infinities.
#[cfg_attr(not(debug_assertions), inline(always))]
fn fold<F: Floats>(x: F, wrap: Wrap) -> F {
    let (zero, one, two) = (F::splat(0.0), F::splat(1.0), F::splat(2.0));
    let folded = match wrap {
        Wrap::Clamp => x,
        Wrap::Repeat => x - x.floor(),
        Wrap::Mirror => {
            let pair = x - two * (x * F::splat(0.5)).floor();
            F::select(one.lt(pair), two - pair, pair)
        }
    };
    F::select(zero.le(folded), folded.min(one), zero)
}

/// The two texels whose centres enclose `x` (in texels, within [0, size]), or twice the one that holds it, and the weight
/// of the second.
#[cfg_attr(not(debug_assertions), inline(always))]
fn pair<F: Floats>(x: F, size: F, repeat: u32, nearest: u32) -> ([F; 2], F) {
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    let last = size - one;
    let centred = x - F::splat(0.5);
    let below = centred.floor();
    let above = below + one;
    // A mirrored neighbour of an edge texel is the edge texel itself.
    let first = F::select(repeat & below.lt(zero), last, below.max(zero).min(last));
    let second = F::select(repeat & last.lt(above), zero, above.max(zero).min(last));
    if nearest == 0 {
        return ([first, second], centred - below);
    }
    let holds = x.floor().min(last);
    let pair = [F::select(nearest, holds, first), F::select(nearest, holds, second)];
    (pair, F::select(nearest, zero, centred - below))
}

/// Numbers of texels, from 0 to 2^23 - 1: the low bits of what 2^23 more has for a mantissa.
#[cfg_attr(not(debug_assertions), inline(always))]
fn whole<F: Floats>(x: F) -> [u32; LANES] {
    const BEYOND: u32 = 1 << 23;
    let x = row(x + F::splat(BEYOND as f32));
    let mut out = [0; LANES];
    for i in 0..F::LEN {
        out[i] = x[i].to_bits() & (BEYOND - 1);
    }
    out
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec4};

    use super::{super::pyramid::tests::image, *};
    use crate::{
        render::{
            texture::Encoding,
            wide::{One, Row, only},
        },
        simd::{Lanes, Simd, SimdLevel, Task, dispatch},
    };

    /// Steps of the coordinates for one pixel right and down.
    #[derive(Clone, Copy, Default)]
    struct Steps {
        dx: Vec2,
        dy: Vec2,
    }

    fn sample(p: &Pyramid, s: TexSampler, uv: Vec2, steps: &Steps) -> Vec4 {
        let mut sources = [None; LANES];
        sources[0] = Some(Source { pyramid: p, sampler: s });
        let footprint = Footprint { dx: V2::splat(steps.dx), dy: V2::splat(steps.dy) };
        Vec4::from(super::sample::<One>(&sources, V2::splat(uv), &footprint).map(only))
    }

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
                    let (fast, slow) = (sample(&p, s, uv, &Steps::default()), slow_linear(&p, s, uv));
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
            let got = sample(&p, s, Vec2::new(u, 0.1), &Steps::default());
            assert_eq!(got, p.texel(0, x, 0), "{u}");
        }
    }

    #[test]
    fn the_level_follows_the_footprint() {
        let p = pyramid(64, 64);
        let s = TexSampler { mip: Some(Filter::Nearest), min: Filter::Nearest, ..TexSampler::default() };
        for level in 1..=6usize {
            let width = (1 << level) as f32 / 64.0;
            let f = Steps { dx: Vec2::new(width, 0.0), dy: Vec2::new(0.0, width) };
            let got = sample(&p, s, Vec2::splat(0.001), &f);
            assert_eq!(got, p.texel(level, 0, 0), "level {level}");
        }
        let far = Steps { dx: Vec2::splat(1e9), dy: Vec2::splat(1e9) };
        assert_eq!(sample(&p, s, Vec2::splat(0.4), &far), p.texel(6, 0, 0));
    }

    #[test]
    fn between_levels_both_are_blended() {
        let p = pyramid(64, 64);
        let s = TexSampler { mip: Some(Filter::Linear), min: Filter::Nearest, ..TexSampler::default() };
        for (level, part) in [(0, 0.25), (1, 0.5), (4, 0.75), (5, 0.125)] {
            let width = libm::exp2f(level as f32 + part) / 64.0;
            let f = Steps { dx: Vec2::new(width, 0.0), dy: Vec2::new(0.0, width) };
            let (fine, coarse) = (p.texel(level, 0, 0), p.texel(level + 1, 0, 0));
            let got = sample(&p, s, Vec2::splat(0.001), &f);
            assert!((got - fine.lerp(coarse, part)).abs().max_element() < 1e-3, "level {level}: {got}");
        }
    }

    #[test]
    fn a_stretched_footprint_keeps_detail_across_it() {
        let stripes = Pyramid::new(
            &image(64, 64, |x, _| if x % 16 < 8 { [255; 4] } else { [0, 0, 0, 255] }),
            Encoding::Linear,
            true,
        );
        let f = Steps { dx: Vec2::new(1.0 / 64.0, 0.0), dy: Vec2::new(0.0, 4.0 / 64.0) };
        let s = TexSampler::default();
        assert!(sample(&stripes, s, Vec2::new(4.0 / 64.0, 0.5), &f).x > 0.95);
        assert!(sample(&stripes, s, Vec2::new(12.0 / 64.0, 0.5), &f).x < 0.05);
    }

    #[test]
    fn without_mip_filter_the_finest_level_is_read() {
        let p = pyramid(8, 8);
        let s = TexSampler { mip: None, min: Filter::Nearest, ..TexSampler::default() };
        let f = Steps { dx: Vec2::splat(0.7), dy: Vec2::new(0.7, -0.7) };
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
                    let f = Steps { dx: Vec2::new(u, v), dy: Vec2::new(v, u) };
                    let got = sample(&p, s, Vec2::new(v, u), &f);
                    assert!(got.x >= 0.0 && got.x <= 1.0, "{u} {v}: {got}");
                }
            }
        }
    }

    /// Look-ups of a lane's own texture, sampler, place and footprint.
    struct Mixed<'a> {
        sources: &'a [Option<Source<'a>>; LANES],
        rows: &'a [Row; 6],
    }

    impl Task for Mixed<'_> {
        type Output = (usize, [Row; 4]);

        #[inline(always)]
        fn run<S: Simd>(self) -> (usize, [Row; 4]) {
            let [x, y, a, b, c, d] = self.rows;
            let footprint = Footprint { dx: V2::load(&[*a, *b]), dy: V2::load(&[*c, *d]) };
            let mut sources = *self.sources;
            sources[S::F::LEN..].fill(None);
            let [r, g, b, a] = super::sample::<S::F>(&sources, V2::load(&[*x, *y]), &footprint);
            (S::F::LEN, [row(r), row(g), row(b), row(a)])
        }
    }

    #[test]
    fn lanes_do_not_see_each_other() {
        let pyramids = [pyramid(64, 32), pyramid(5, 7), pyramid(1, 1)];
        let wraps = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];
        let mips = [None, Some(Filter::Nearest), Some(Filter::Linear), Some(Filter::Linear)];
        for seed in 0..300_u64 {
            let random = |lane: usize, what: u64| crate::render::pattern::hash(seed << 16 | (lane as u64) << 8 | what);
            let sources: [_; LANES] = std::array::from_fn(|lane| {
                let pick = |what: u64, count: u32| (random(lane, what) % count) as usize;
                let filter = |nearest: bool| if nearest { Filter::Nearest } else { Filter::Linear };
                let sampler = TexSampler {
                    mag: filter(pick(0, 4) == 0),
                    min: filter(pick(1, 4) == 0),
                    mip: mips[pick(2, 4)],
                    wrap_u: wraps[pick(3, 3)],
                    wrap_v: wraps[pick(4, 3)],
                };
                (pick(5, 9) > 0).then(|| Source { pyramid: &pyramids[pick(6, 3)], sampler })
            });
            let rows: [Row; 6] = std::array::from_fn(|i| {
                let size = if i < 2 { 3.0 } else { 0.4 };
                std::array::from_fn(|lane| (random(lane, 10 + i as u64) as f32 / 4.3e9 - 0.5) * size)
            });
            for level in SimdLevel::available() {
                let (len, wide) = dispatch(level, Mixed { sources: &sources, rows: &rows });
                for lane in 0..len {
                    let at = |i: usize| Vec2::new(rows[i][lane], rows[i + 1][lane]);
                    let due = sources[lane].map_or(Vec4::ZERO, |source| {
                        sample(source.pyramid, source.sampler, at(0), &Steps { dx: at(2), dy: at(4) })
                    });
                    let got = Vec4::new(wide[0][lane], wide[1][lane], wide[2][lane], wide[3][lane]);
                    assert_eq!(got, due, "{level}, seed {seed}, lane {lane}");
                }
            }
        }
    }
}
