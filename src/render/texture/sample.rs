use glam::Vec4;

use super::{Pyramid, pyramid::LevelView};
use crate::{
    render::wide::{Bits, Floats, LANES, Row, V2, log2, row},
    scene::{Filter, TexSampler, Wrap},
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

/// The levels that each lane reads: up to two, blended.
struct Levels<'a> {
    views: [[Option<LevelView<'a>>; LANES]; 2],
    /// Width and height of each.
    sizes: [[Row; 2]; 2],
    /// Weight of the second.
    part: Row,
    /// Lanes that read two.
    blended: u32,
    /// Lanes that read single texels.
    nearest: u32,
}

impl<'a> Levels<'a> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn new(mask: u32, sources: &[Option<Source<'a>>; LANES], lod: &Row) -> Self {
        let mut out = Self {
            views: [[None; LANES]; 2],
            sizes: [[[1.0; LANES]; 2]; 2],
            part: [0.0; LANES],
            blended: 0,
            nearest: 0,
        };
        for lane in Bits(mask) {
            let Some(Source { pyramid, sampler }) = sources[lane] else { continue };
            let last = pyramid.level_count() - 1;
            let (filter, mip) = if lod[lane] > 0.0 { (sampler.min, sampler.mip) } else { (sampler.mag, None) };
            let lod = lod[lane].min(last as f32);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and the last level")]
            let (level, part) = match mip {
                None => (0, 0.0),
                Some(Filter::Nearest) => (((lod + 0.5) as usize).min(last), 0.0),
                Some(Filter::Linear) => (lod as usize, lod - (lod as usize) as f32),
            };
            out.put(0, lane, pyramid.view(level));
            // A single texel is what it is, not a blend of itself.
            let single = last == 0 && pyramid.level(0).width == 1 && pyramid.level(0).height == 1;
            out.nearest |= u32::from(single || filter == Filter::Nearest) << lane;
            if part > 0.0 {
                out.put(1, lane, pyramid.view((level + 1).min(last)));
                out.part[lane] = part;
                out.blended |= 1 << lane;
            }
        }
        out
    }

    #[inline(always)]
    fn put(&mut self, slot: usize, lane: usize, view: LevelView<'a>) {
        self.sizes[slot][0][lane] = view.width as f32;
        self.sizes[slot][1][lane] = view.height as f32;
        self.views[slot][lane] = Some(view);
    }
}

/// The four texels around a point of a level, and the weights of the right and the lower ones; a look-up a lane.
#[derive(Clone, Copy)]
struct Cells {
    /// Columns left and right, rows above and below.
    columns: [[u32; LANES]; 2],
    rows: [[u32; LANES]; 2],
    right: Row,
    lower: Row,
}

impl Cells {
    const NONE: Self =
        Self { columns: [[0; LANES]; 2], rows: [[0; LANES]; 2], right: [0.0; LANES], lower: [0.0; LANES] };

    /// Around the folded coordinates `u` and `v`.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn fill<F: Floats>(&mut self, u: F, v: F, size: &[Row; 2], wraps: &Wraps, nearest: u32) {
        let (width, height) = (F::load(&size[0]), F::load(&size[1]));
        let (columns, right) = pair(u * width, width, wraps.repeat_u, nearest);
        let (rows, lower) = pair(v * height, height, wraps.repeat_v, nearest);
        (self.columns, self.right) = ([whole(columns[0]), whole(columns[1])], row(right));
        (self.rows, self.lower) = ([whole(rows[0]), whole(rows[1])], row(lower));
    }

    /// The blend of a lane's four texels.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn blend(&self, lane: usize, view: &LevelView<'_>) -> Vec4 {
        let [left, right] = [self.columns[0][lane], self.columns[1][lane]];
        let [a, b, c, d] = view.four([left, right], [self.rows[0][lane], self.rows[1][lane]]);
        let (fx, fy) = (self.right[lane], self.lower[lane]);
        let top = a * (1.0 - fx) + b * fx;
        let bottom = c * (1.0 - fx) + d * fx;
        top * (1.0 - fy) + bottom * fy
    }
}

/// Lanes by wrap mode.
struct Wraps {
    repeat_u: u32,
    repeat_v: u32,
    mirror_u: u32,
    mirror_v: u32,
}

impl Wraps {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn new(mask: u32, sources: &[Option<Source<'_>>; LANES]) -> Self {
        let mut out = Self { repeat_u: 0, repeat_v: 0, mirror_u: 0, mirror_v: 0 };
        for lane in Bits(mask) {
            if let Some(Source { sampler, .. }) = sources[lane] {
                out.repeat_u |= u32::from(sampler.wrap_u == Wrap::Repeat) << lane;
                out.repeat_v |= u32::from(sampler.wrap_v == Wrap::Repeat) << lane;
                out.mirror_u |= u32::from(sampler.wrap_u == Wrap::Mirror) << lane;
                out.mirror_v |= u32::from(sampler.wrap_v == Wrap::Mirror) << lane;
            }
        }
        out
    }
}

/// The textures' linear RGBA at `uv` (v down), filtered over `footprint` as their samplers say; 0 in lanes without one.
/// Any float is taken.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(crate) fn sample<F: Floats>(sources: &[Option<Source<'_>>; LANES], uv: V2<F>, footprint: &Footprint<F>) -> [F; 4] {
    let (mut mask, mut layered) = (0, 0);
    let mut texels = [[1.0; LANES]; 2];
    for (lane, source) in sources.iter().enumerate() {
        if let Some(Source { pyramid, .. }) = source {
            let size = pyramid.level(0);
            (texels[0][lane], texels[1][lane]) = (size.width as f32, size.height as f32);
            layered |= u32::from(pyramid.level_count() > 1) << lane;
            mask |= 1 << lane;
        }
    }
    let plan = Plan::new(V2::<F>::load(&texels), layered, footprint);
    let levels = Levels::new(mask, sources, &row(plan.lod));
    let wraps = Wraps::new(mask, sources);
    let taps = row(plan.taps);
    let mut cells = [[Cells::NONE; 2]; MAX_TAPS];
    let first = F::splat(-0.5) * (plan.taps - F::splat(1.0));
    for (tap, cells) in cells.iter_mut().enumerate() {
        if tap > 0 && F::splat(tap as f32).lt(plan.taps) & mask == 0 {
            break;
        }
        let at = uv + plan.step * (first + F::splat(tap as f32));
        let u = fold(at.x, wraps.repeat_u, wraps.mirror_u);
        let v = fold(at.y, wraps.repeat_v, wraps.mirror_v);
        cells[0].fill(u, v, &levels.sizes[0], &wraps, levels.nearest);
        if levels.blended != 0 {
            cells[1].fill(u, v, &levels.sizes[1], &wraps, levels.nearest);
        }
    }
    let mut out = [[0.0; LANES]; 4];
    for lane in Bits(mask) {
        let Some(fine) = &levels.views[0][lane] else { continue };
        let count = taps[lane];
        let mut sum = Vec4::ZERO;
        for (tap, [near, far]) in cells.iter().enumerate() {
            if tap as f32 >= count {
                break;
            }
            let mut texel = near.blend(lane, fine);
            if let Some(coarse) = &levels.views[1][lane] {
                texel += (far.blend(lane, coarse) - texel) * levels.part[lane];
            }
            sum += texel;
        }
        if count > 1.0 {
            sum /= count;
        }
        for (row, channel) in out.iter_mut().zip(sum.to_array()) {
            row[lane] = channel;
        }
    }
    [F::load(&out[0]), F::load(&out[1]), F::load(&out[2]), F::load(&out[3])]
}

/// Coordinates brought into [0, 1] as the wrap modes say; 0 for NaN and infinities.
#[cfg_attr(not(debug_assertions), inline(always))]
fn fold<F: Floats>(x: F, repeat: u32, mirror: u32) -> F {
    let (zero, one, two) = (F::splat(0.0), F::splat(1.0), F::splat(2.0));
    let mut folded = F::select(repeat, x - x.floor(), x);
    if mirror != 0 {
        let pair = x - two * (x * F::splat(0.5)).floor();
        folded = F::select(mirror, F::select(one.lt(pair), two - pair, pair), folded);
    }
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
    use glam::Vec2;

    use super::{super::pyramid::tests::image, *};
    use crate::{
        render::{
            texture::Encoding,
            wide::{One, only},
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
