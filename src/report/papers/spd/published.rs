//! Published counts of the databases' pictures at their default sizes, 513 x 513 rays from the eye.

use super::counts::{RayCounts, RayTally};
use crate::scene::spd::SpdKind;

const fn counts(primary_hits: u64, shadow: [u64; 2], secondary: [u64; 2]) -> RayCounts {
    RayCounts {
        primary: RayTally { rays: 513 * 513, hits: primary_hits },
        shadow: RayTally { rays: shadow[0], hits: shadow[1] },
        secondary: RayTally { rays: secondary[0], hits: secondary[1] },
    }
}

/// # Source
/// V. Havran and F. Sixta, "Comparison of Hierarchical Grids", Ray Tracing News 12(1), 1999: additional material in the
/// package.
pub const HAVRAN: [(SpdKind, RayCounts); 8] = [
    (SpdKind::Balls, counts(263_169, [959_244, 285_178], [179_884, 134_368])),
    (SpdKind::Gears, counts(245_332, [2_088_012, 1_057_557], [494_338, 365_338])),
    (SpdKind::Lattice, counts(261_170, [1_180_774, 943_159], [243_210, 178_786])),
    (SpdKind::Mount, counts(173_685, [361_037, 74_555], [710_436, 472_351])),
    (SpdKind::Rings, counts(263_169, [1_077_336, 510_719], [312_879, 175_688])),
    (SpdKind::Teapot, counts(161_546, [406_340, 34_757], [226_235, 67_688])),
    (SpdKind::Tetra, counts(49_950, [46_262, 5538], [0, 0])),
    (SpdKind::Tree, counts(169_907, [1_110_323, 47_506], [0, 0])),
];

/// Rays that hit from the eye, shadow rays, and reflected and refracted ones together.
///
/// # Source
/// The package's Readme, "Database Analysis".
pub const README: [(SpdKind, [u64; 3]); 7] = [
    (SpdKind::Balls, [263_169, 954_368, 175_095]),
    (SpdKind::Gears, [245_086, 2_246_955, 304_643 + 207_564]),
    (SpdKind::Mount, [173_125, 412_922, 2 * 354_769]),
    (SpdKind::Rings, [263_169, 1_085_002, 315_236]),
    (SpdKind::Teapot, [161_120, 407_656, 225_248]),
    (SpdKind::Tetra, [49_788, 46_112, 0]),
    (SpdKind::Tree, [169_836, 1_097_419, 0]),
];

/// A uniform grid by Woo's rule with density 10: cells an axis, tests and steps a ray.
///
/// # Source
/// As [`HAVRAN`].
pub const GRID: [(SpdKind, [u32; 3], [f64; 2]); 8] = [
    (SpdKind::Balls, [103, 103, 7], [72.54, 12.40]),
    (SpdKind::Gears, [71, 71, 18], [22.82, 13.83]),
    (SpdKind::Lattice, [44, 44, 44], [9.26, 10.56]),
    (SpdKind::Mount, [44, 44, 42], [13.17, 18.43]),
    (SpdKind::Rings, [44, 43, 44], [23.36, 24.51]),
    (SpdKind::Teapot, [61, 61, 25], [15.13, 32.50]),
    (SpdKind::Tetra, [35, 35, 35], [10.01, 15.97]),
    (SpdKind::Tree, [117, 118, 5], [246.08, 15.45]),
];
