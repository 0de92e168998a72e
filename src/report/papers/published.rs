//! The figures that the papers print.

/// A scene of the slab hierarchy's table 1: 640 x 480 rays, first hit and eyelight, one core of a Q6600 at 2.4 GHz, 2 x 2 packets,
/// spatial median, one triangle a leaf. Each pair is the hierarchy of boxes, then the single slab hierarchy.
///
/// # Source
/// Eisemann, Woizischke and Magnor, "Ray Tracing with the Single Slab Hierarchy", 2008, table 1.
#[derive(Clone, Copy, Debug)]
pub struct SlabScene {
    /// The model.
    pub scene: &'static str,
    /// Its triangles.
    pub triangles: usize,
    /// Nodes traversed (`N_T`).
    pub nodes: [f64; 2],
    /// Triangles tested (`N_I`).
    pub tests: [f64; 2],
    /// Seconds of the build (`T_C`).
    pub build_s: [f64; 2],
    /// Seconds of the picture (`T_R`).
    pub render_s: [f64; 2],
    /// How many times sooner the picture is done.
    pub speed_up: f64,
    /// Nodes in MiB.
    pub mebibytes: [f64; 2],
}

const fn slab(
    scene: &'static str,
    triangles: usize,
    counts: [[f64; 2]; 2],
    seconds: [[f64; 2]; 2],
    speed_up: f64,
    mebibytes: [f64; 2],
) -> SlabScene {
    let ([nodes, tests], [build_s, render_s]) = (counts, seconds);
    SlabScene { scene, triangles, nodes, tests, build_s, render_s, speed_up, mebibytes }
}

/// Table 1.
pub const SLABS: [SlabScene; 6] = [
    slab(
        "PowerPlant",
        12_748_510,
        [[43.55, 80.23], [4.24, 5.34]],
        [[28.83, 28.90], [3.31, 2.73]],
        1.22,
        [778.11, 194.53],
    ),
    slab("HappyBuddha", 1_087_716, [[6.45, 14.14], [0.63, 1.53]], [[1.93, 1.98], [0.54, 0.59]], 0.91, [66.39, 16.60]),
    slab("Dragon", 871_414, [[10.47, 23.21], [0.95, 2.11]], [[1.55, 1.57], [0.84, 0.89]], 0.94, [53.19, 13.30]),
    slab("FairyFrame1", 174_117, [[26.52, 45.51], [2.53, 4.23]], [[0.30, 0.31], [2.06, 1.70]], 1.21, [10.63, 2.66]),
    slab("Toys", 11_141, [[29.57, 46.85], [1.31, 3.24]], [[0.02, 0.02], [2.08, 1.57]], 1.33, [0.68, 0.17]),
    slab("Bunny", 69_451, [[8.77, 18.01], [0.55, 1.31]], [[0.09, 0.10], [0.66, 0.65]], 1.03, [4.24, 1.06]),
];

/// A scene of the grouped uniform grid's figure 5: memory in MiB at 512 cells an axis.
///
/// # Source
/// Steffen and Zambreno, "Design and Evaluation of a Hardware Accelerated Ray Tracing Data Structure", 2009, figure 5.
#[derive(Clone, Copy, Debug)]
pub struct GroupScene {
    /// The model.
    pub scene: &'static str,
    /// Its polygons.
    pub polygons: usize,
    /// The kd-tree.
    pub kd: f64,
    /// The nodes that the grid keeps.
    pub tree: f64,
    /// Bounds of the groups.
    pub boundary: f64,
    /// The table of cells.
    pub hash: f64,
    /// Tree, bounds and table.
    pub total: f64,
}

const fn group(scene: &'static str, polygons: usize, [kd, tree, boundary, total]: [f64; 4]) -> GroupScene {
    GroupScene { scene, polygons, kd, tree, boundary, hash: 512.0, total }
}

/// Figure 5. Reads (figure 8) are a chart without numbers; the text says: up to 70 % fewer above 100,000 polygons, more on `UlmBox` alone.
pub const GROUPS: [GroupScene; 6] = [
    group("UlmBox", 492, [0.01, 0.01, 0.01, 512.02]),
    group("StanfordBunny", 69_451, [1.34, 0.87, 1.41, 514.28]),
    group("FairyForest", 172_561, [2.66, 2.32, 1.02, 515.34]),
    group("Cabin", 217_903, [3.12, 2.88, 0.70, 515.58]),
    group("Atrium", 559_992, [9.30, 8.77, 1.61, 522.38]),
    group("Conference", 987_522, [8.54, 8.23, 0.93, 521.17]),
];

/// A scene of the sorted lists' table 1, whose lists are flat; on a machine of 1993.
///
/// # Source
/// Fournier and Poulin, "A Ray Tracing Accelerator Based on a Hierarchy of 1D Sorted Lists", 1993, table 1.
#[derive(Clone, Copy, Debug)]
pub struct ListScene {
    /// The scene.
    pub scene: &'static str,
    /// Its objects.
    pub objects: usize,
    /// Least intersection tests a ray: its hits.
    pub minimum: f64,
    /// Milliseconds a ray when every object is tested.
    pub naive_ms: f64,
    /// Tests a ray of the lists.
    pub tests: f64,
    /// Events a ray.
    pub events: f64,
    /// Milliseconds a ray of the lists.
    pub ms: f64,
}

const fn list(scene: &'static str, objects: usize, [minimum, naive_ms, tests, events, ms]: [f64; 5]) -> ListScene {
    ListScene { scene, objects, minimum, naive_ms, tests, events, ms }
}

/// Table 1.
pub const LISTS: [ListScene; 10] = [
    list("SpheresI", 11, [0.34, 0.25, 1.30, 28.2, 0.58]),
    list("SpheresII", 92, [0.38, 1.29, 1.41, 241.7, 3.67]),
    list("SpheresIII", 821, [0.42, 10.69, 1.50, 2048.8, 29.75]),
    list("TetraI", 4, [0.32, 0.12, 2.07, 4.9, 0.27]),
    list("TetraII", 16, [0.30, 0.20, 2.72, 19.2, 0.51]),
    list("TetraIII", 64, [0.29, 0.54, 3.29, 78.8, 1.41]),
    list("TetraIV", 256, [0.29, 1.90, 3.61, 322.3, 4.92]),
    list("TetraV", 1024, [0.28, 7.30, 3.77, 1315.8, 18.98]),
    list("TetraVI", 4096, [0.27, 28.80, 3.84, 5354.1, 75.58]),
    list("Teapot", 29, [1.00, 1.67, 2.70, 119.9, 2.63]),
];

/// Tests and cells a ray of a uniform grid of Woo's resolution at density 10, over all rays of a database's picture.
///
/// # Source
/// V. Havran and F. Sixta, "Comparison of Hierarchical Grids", Ray Tracing News 12(1), 1999: additional material in the package.
pub const GRIDS: [(&str, f64, f64); 8] = [
    ("balls", 72.54, 12.40),
    ("gears", 22.82, 13.83),
    ("lattice", 9.26, 10.56),
    ("mount", 13.17, 18.43),
    ("rings", 23.36, 24.51),
    ("teapot", 15.13, 32.50),
    ("tetra", 10.01, 15.97),
    ("tree", 246.08, 15.45),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printed_node_memory_is_what_two_nodes_a_triangle_take() {
        for row in SLABS {
            for (bytes, due) in [32.0, 8.0].into_iter().zip(row.mebibytes) {
                let found = 2.0 * bytes * row.triangles as f64 / f64::from(1 << 20);
                assert!((found - due).abs() < 0.006, "{}: {found} {due}", row.scene);
            }
            let ratio = row.render_s[0] / row.render_s[1];
            assert!((ratio - row.speed_up).abs() < 0.02, "{}: {ratio}", row.scene);
        }
    }

    #[test]
    fn printed_bounds_take_three_times_what_the_removed_nodes_took() {
        for row in GROUPS {
            assert!((row.tree + row.boundary + row.hash - row.total).abs() < 0.03, "{}", row.scene);
            assert!((3.0 * (row.kd - row.tree) - row.boundary).abs() < 0.04, "{}", row.scene);
        }
    }
}
