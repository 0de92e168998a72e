//! How different two pictures look.
//!
//! # Source
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild, "FLIP: A Difference Evaluator for Alternating Images", 2020, for
//! pictures of low dynamic range: both are filtered by what the eye resolves at 67 pixels a degree and compared in a uniform
//! colour space; edges and points that only one of them has weigh more. Written from the paper.

use std::f64::consts::{PI, SQRT_2};

use rayon::prelude::*;

/// Pixels a degree: a 0.7 m wide display of 3840 pixels at 0.7 m.
const PIXELS_PER_DEGREE: f64 = 67.0;

/// Exponents of the colour and feature differences, and where the colour difference is compressed.
const COLOR_EXPONENT: f64 = 0.7;
const FEATURE_EXPONENT: f64 = 0.5;
const KNEE: f64 = 0.4;
const KNEE_TO: f64 = 0.95;

/// Width of the feature detectors in degrees.
const FEATURE_DEGREES: f64 = 0.082;

/// Contrast sensitivity of the achromatic, the red-green and the blue-yellow channel: a1, b1, a2, b2 of two Gaussians.
const SENSITIVITY: [[f64; 4]; 3] = [[1.0, 0.0047, 0.0, 1e-5], [1.0, 0.0053, 0.0, 1e-5], [34.1, 0.04, 13.5, 0.025]];

type Triple = [f64; 3];

/// The mean difference of two pictures of 8-bit sRGB with alpha, which is not looked at: 0 for equal ones, at most 1.
///
/// # Panics
/// When a picture has not `width * height` pixels.
pub(super) fn mean(a: &[u8], b: &[u8], width: usize, height: usize) -> f64 {
    assert!(a.len() == width * height * 4 && b.len() == a.len(), "pictures of one size");
    if a == b || a.is_empty() {
        return 0.0;
    }
    let [a, b] = [a, b].map(|p| Picture::new(p, [width, height]));
    let (colors, features) = (color_difference(&a, &b), feature_difference(&a, &b));
    let sum: f64 = colors.iter().zip(&features).map(|(&c, &f)| libm::pow(c, 1.0 - f)).sum();
    sum / colors.len() as f64
}

/// A picture in opponent colours (Y, Cx, Cz).
struct Picture {
    size: [usize; 2],
    opponent: Vec<Triple>,
}

impl Picture {
    fn new(rgba: &[u8], size: [usize; 2]) -> Self {
        let pixel = |p: &[u8]| opponent(xyz([p[0], p[1], p[2]].map(|c| linear(f64::from(c) / 255.0))));
        Self { size, opponent: rgba.par_chunks_exact(4).map(pixel).collect() }
    }

    /// Convolves each pixel's surroundings; pixels beyond an edge are those at the edge.
    fn filtered<const N: usize>(&self, taps: &[Tap<N>]) -> Vec<[f64; N]> {
        let [width, height] = self.size;
        let at = |x: usize, y: usize, tap: &Tap<N>| {
            let column = x.saturating_add_signed(tap.at[0]).min(width - 1);
            let row = y.saturating_add_signed(tap.at[1]).min(height - 1);
            &self.opponent[row * width + column]
        };
        let pixel = |i: usize| {
            let mut sum = [0.0; N];
            for tap in taps {
                let from = at(i % width, i / width, tap);
                for (n, sum) in sum.iter_mut().enumerate() {
                    // Features are looked for in brightness alone.
                    let value = if N == 3 { from[n] } else { (from[0] + 16.0) / 116.0 };
                    *sum += tap.weights[n] * value;
                }
            }
            sum
        };
        (0..width * height).into_par_iter().map(pixel).collect()
    }
}

/// A neighbour, and what it counts in each channel.
struct Tap<const N: usize> {
    at: [isize; 2],
    weights: [f64; N],
}

/// Taps of a square around the pixel.
fn taps<const N: usize>(radius: f64, weights: impl Fn(f64, f64) -> [f64; N]) -> Vec<Tap<N>> {
    #[expect(clippy::cast_possible_truncation, reason = "a few pixels")]
    let radius = libm::ceil(radius) as isize;
    let square = (-radius..=radius).flat_map(|y| (-radius..=radius).map(move |x| [x, y]));
    square.map(|at| Tap { at, weights: weights(at[0] as f64, at[1] as f64) }).collect()
}

fn color_difference(a: &Picture, b: &Picture) -> Vec<f64> {
    let widest = SENSITIVITY[2][1];
    let mut kernel = taps(3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE, |x, y| {
        let degrees2 = (x * x + y * y) / (PIXELS_PER_DEGREE * PIXELS_PER_DEGREE);
        SENSITIVITY.map(|[a1, b1, a2, b2]| {
            let bell = |a: f64, b: f64| a * (PI / b).sqrt() * libm::exp(-PI * PI * degrees2 / b);
            bell(a1, b1) + bell(a2, b2)
        })
    });
    let sums: [f64; 3] = std::array::from_fn(|n| kernel.iter().map(|t| t.weights[n]).sum());
    for tap in &mut kernel {
        tap.weights = std::array::from_fn(|n| tap.weights[n] / sums[n]);
    }
    let seen = |p: &Picture| -> Vec<Triple> {
        p.filtered(&kernel).into_iter().map(|c| uniform(rgb(c).map(|x| x.clamp(0.0, 1.0)))).collect()
    };
    let most = libm::pow(distance(uniform([0.0, 1.0, 0.0]), uniform([0.0, 0.0, 1.0])), COLOR_EXPONENT);
    let compressed = |(a, b): (Triple, Triple)| {
        let d = libm::pow(distance(a, b), COLOR_EXPONENT);
        let knee = KNEE * most;
        if d < knee { KNEE_TO / knee * d } else { KNEE_TO + (d - knee) / (most - knee) * (1.0 - KNEE_TO) }
    };
    seen(a).into_iter().zip(seen(b)).map(compressed).collect()
}

fn feature_difference(a: &Picture, b: &Picture) -> Vec<f64> {
    let sigma = 0.5 * FEATURE_DEGREES * PIXELS_PER_DEGREE;
    let bell = |x: f64, y: f64| libm::exp(-(x * x + y * y) / (2.0 * sigma * sigma));
    // Edges: first derivatives along x and y; points: second ones.
    let mut kernel = taps(3.0 * sigma, |x, y| {
        let g = bell(x, y);
        let second = |x: f64| (x * x / (sigma * sigma) - 1.0) * g;
        [-x * g, -y * g, second(x), second(y)]
    });
    for n in 0..4 {
        let sum = |sign: f64| -> f64 { kernel.iter().map(|t| (t.weights[n] * sign).max(0.0)).sum() };
        let (above, below) = (sum(1.0), sum(-1.0));
        for tap in &mut kernel {
            tap.weights[n] /= if tap.weights[n] > 0.0 { above } else { below };
        }
    }
    let found = |p: &Picture| -> Vec<[f64; 2]> {
        let strength = |[ex, ey, px, py]: [f64; 4]| [libm::hypot(ex, ey), libm::hypot(px, py)];
        p.filtered(&kernel).into_iter().map(strength).collect()
    };
    let differ = |(a, b): ([f64; 2], [f64; 2])| {
        let most = (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
        libm::pow(most / SQRT_2, FEATURE_EXPONENT).min(1.0)
    };
    found(a).into_iter().zip(found(b)).map(differ).collect()
}

fn linear(c: f64) -> f64 {
    if c <= 0.040_45 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }
}

/// Linear sRGB to XYZ, and back.
const XYZ_FROM_RGB: [Triple; 3] = [
    [0.412_390_799_265_959_5, 0.357_584_339_383_878, 0.180_480_788_401_834_3],
    [0.212_639_005_871_510_4, 0.715_168_678_767_756, 0.072_192_315_360_733_7],
    [0.019_330_818_715_591_9, 0.119_194_779_794_626, 0.950_532_152_249_660_6],
];
const RGB_FROM_XYZ: [Triple; 3] = [
    [3.240_969_941_904_521, -1.537_383_177_570_093, -0.498_610_760_293_003],
    [-0.969_243_636_280_88, 1.875_967_501_507_721, 0.041_555_057_407_176],
    [0.055_630_079_696_994, -0.203_976_958_888_977, 1.056_971_514_242_879],
];

fn times(m: &[Triple; 3], v: Triple) -> Triple {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn xyz(rgb: Triple) -> Triple {
    times(&XYZ_FROM_RGB, rgb)
}

/// XYZ of white.
fn white() -> Triple {
    xyz([1.0; 3])
}

/// XYZ to the opponent colours that the eye's contrast sensitivity is known in.
fn opponent(c: Triple) -> Triple {
    let w = white();
    let [x, y, z] = std::array::from_fn(|i| c[i] / w[i]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Opponent colours to linear sRGB.
fn rgb([y, cx, cz]: Triple) -> Triple {
    let w = white();
    let y = (y + 16.0) / 116.0;
    let relative = [cx / 500.0 + y, y, y - cz / 200.0];
    times(&RGB_FROM_XYZ, std::array::from_fn(|i| relative[i] * w[i]))
}

/// Linear sRGB to CIELAB, with a and b scaled by lightness: colours of dark surfaces are told apart less (Hunt).
fn uniform(rgb: Triple) -> Triple {
    const D: f64 = 6.0 / 29.0;
    let w = white();
    let c = xyz(rgb);
    let f = |t: f64| if t > D * D * D { libm::cbrt(t) } else { t / (3.0 * D * D) + 4.0 / 29.0 };
    let [x, y, z] = std::array::from_fn(|i| f(c[i] / w[i]));
    let l = 116.0 * y - 16.0;
    [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
}

/// Of lightness and of hue and chroma, added: better for large differences than Euclid's (Abasi et al.).
fn distance(a: Triple, b: Triple) -> f64 {
    (a[0] - b[0]).abs() + libm::hypot(a[1] - b[1], a[2] - b[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(rgb: [u8; 3], n: usize) -> Vec<u8> {
        (0..n * n).flat_map(|_| [rgb[0], rgb[1], rgb[2], 255]).collect()
    }

    #[test]
    fn equal_pictures_differ_by_nothing_and_black_from_white_by_almost_all() {
        let (black, white) = (flat([0; 3], 24), flat([255; 3], 24));
        assert_eq!(mean(&black, &black, 24, 24).to_bits(), 0);
        let far = mean(&black, &white, 24, 24);
        assert!(far > 0.95 && far <= 1.0, "{far}");
        // The largest difference of colours by definition.
        let most = mean(&flat([0, 255, 0], 24), &flat([0, 0, 255], 24), 24, 24);
        assert!((most - 1.0).abs() < 0.02, "{most}");
        let near = mean(&flat([100; 3], 24), &flat([101; 3], 24), 24, 24);
        assert!(near > 0.0 && near < 0.05, "{near}");
    }

    #[test]
    fn a_difference_counts_more_where_it_makes_an_edge() {
        let gray = flat([100; 3], 40);
        let mut line = gray.clone();
        for row in 0..40 {
            line[(row * 40 + 20) * 4..][..3].fill(180);
        }
        let [a, b] = [&gray, &line].map(|p| Picture::new(p, [40, 40]));
        let of_colors = color_difference(&a, &b).iter().sum::<f64>() / 1600.0;
        let found = mean(&gray, &line, 40, 40);
        assert!(found > of_colors && of_colors > 0.0, "{found} {of_colors}");
        assert!((found - mean(&line, &gray, 40, 40)).abs() < 1e-12);
    }

    #[test]
    fn opponent_colours_turn_back() {
        for c in [[0.2, 0.5, 0.9], [0.0; 3], [1.0; 3]] {
            let back = rgb(opponent(xyz(c)));
            assert!((0..3).all(|i| (back[i] - c[i]).abs() < 1e-9), "{c:?} {back:?}");
        }
    }
}
