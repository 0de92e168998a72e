//! Who is right where kinora and an oracle in f64 differ.

use std::fs;

use kinora::{
    geom::{Hit, InstanceId, PrimId, Ray, Triangles},
    glam::Vec3,
    rayon::prelude::*,
    report::reference::{Reference, Truth, exact},
};

/// What the oracle says about a ray.
#[derive(Clone, Copy)]
struct Oracle {
    ray: usize,
    prim: u32,
    t: f64,
}

/// Classes of rays on which the two differ, and of all rays by what is right.
#[derive(Clone, Copy, Default)]
struct Counts {
    rays: u64,
    both_miss: u64,
    same: u64,
    differ: u64,
    /// The harness's three kinds of difference, with how often the exact answer is ours, the oracle's, or neither.
    missed: [u64; 3],
    false_hit: [u64; 3],
    other_surface: [u64; 3],
    /// The same surface within 1e-3 by another triangle: tie of both, only ours right, only the oracle's right, neither.
    other_triangle: [u64; 4],
    /// Our answers that are not the exact one, rounded.
    ours_inexact: u64,
    /// The oracle's answers that are not right: state, or a triangle that is not among the first.
    oracle_wrong: u64,
}

impl Counts {
    fn plus(mut self, other: Self) -> Self {
        fn add<const N: usize>(a: &mut [u64; N], b: [u64; N]) {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        }
        self.rays += other.rays;
        self.both_miss += other.both_miss;
        self.same += other.same;
        self.differ += other.differ;
        add(&mut self.missed, other.missed);
        add(&mut self.false_hit, other.false_hit);
        add(&mut self.other_surface, other.other_surface);
        add(&mut self.other_triangle, other.other_triangle);
        self.ours_inexact += other.ours_inexact;
        self.oracle_wrong += other.oracle_wrong;
        self
    }
}

/// Reads the four files and prints the counts; true when every answer of ours is exact.
pub(crate) fn run(files: &[String]) -> Result<bool, String> {
    let [tris, rays, oracle, hits] = files else { return Err("edges TRIS RAYS ORC HITS".to_owned()) };
    let (positions, indices) = read_tris(tris)?;
    let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 1 };
    let (rays, oracle, hits) = (read_rays(rays)?, read_oracle(oracle)?, read_hits(hits)?);
    if rays.len() != hits.len() || oracle.iter().any(|o| o.ray >= rays.len()) {
        return Err("the files do not belong together".to_owned());
    }
    let reference = Reference::new(&prims);
    let counts = oracle
        .par_iter()
        .map(|o| judged(&reference, &prims, &rays[o.ray], o, hits[o.ray].as_ref()))
        .reduce(Counts::default, Counts::plus);
    print(&counts);
    Ok(counts.ours_inexact == 0)
}

fn judged(reference: &Reference, prims: &Triangles<'_>, ray: &Ray, oracle: &Oracle, ours: Option<&Hit>) -> Counts {
    // Where they differ, or the reference left a doubt of its own, integers alone decide between the triangles named.
    let truth = reference.closest(ray);
    let mut c = Counts { rays: 1, ..Counts::default() };
    let theirs = (oracle.prim != u32::MAX).then_some(oracle);
    let ours_right = is_right(truth.as_ref(), ours.map(|h| h.prim));
    let oracle_right = is_right(truth.as_ref(), theirs.map(|o| PrimId(o.prim)));
    c.ours_inexact = u64::from(!is_exact(truth.as_ref(), ours));
    c.oracle_wrong = u64::from(!oracle_right);
    let who = match (ours_right, oracle_right) {
        (true, false) => 0,
        (false, true) => 1,
        _ => 2,
    };
    match (theirs, ours) {
        (None, None) => c.both_miss = 1,
        (Some(_), None) => c.missed[who] = 1,
        (None, Some(_)) => c.false_hit[who] = 1,
        (Some(o), Some(h)) if o.prim == h.prim.0 => c.same = 1,
        (Some(o), Some(h)) => {
            let far = (f64::from(h.t) - o.t).abs() > 1e-3 * o.t.abs().max(1e-30);
            match (far, ours_right, oracle_right) {
                (true, ..) => c.other_surface[who] = 1,
                (false, true, true) => c.other_triangle[0] = 1,
                (false, true, false) => c.other_triangle[1] = 1,
                (false, false, true) => c.other_triangle[2] = 1,
                (false, false, false) => c.other_triangle[3] = 1,
            }
        }
    }
    c.differ = 1 - c.both_miss - c.same;
    if c.differ == 1 {
        confirm(prims, ray, theirs, ours, truth.as_ref());
    }
    c
}

/// Tests both triangles by integers and holds the reference to what they say.
fn confirm(prims: &Triangles<'_>, ray: &Ray, theirs: Option<&Oracle>, ours: Option<&Hit>, truth: Option<&Truth>) {
    let meeting = |prim: PrimId| exact::meeting(ray, &prims.corners(prim));
    for prim in theirs.map(|o| PrimId(o.prim)).into_iter().chain(ours.map(|h| h.prim)) {
        let met = meeting(prim);
        let accepted = truth.is_some_and(|t| t.find(prim).is_some());
        match (&met, truth.map(|t| meeting(t.accepted[0].prim))) {
            (Some(m), Some(Some(first))) => assert_eq!(m.t == first.t, accepted, "triangle {}", prim.0),
            (Some(_), _) => panic!("triangle {} is met, but the reference meets nothing", prim.0),
            (None, _) => assert!(!accepted, "triangle {} is not met", prim.0),
        }
    }
}

fn is_right(truth: Option<&Truth>, prim: Option<PrimId>) -> bool {
    match (truth, prim) {
        (None, None) => true,
        (Some(truth), Some(prim)) => truth.find(prim).is_some(),
        _ => false,
    }
}

#[allow(clippy::float_cmp, reason = "roundings are compared")]
fn is_exact(truth: Option<&Truth>, hit: Option<&Hit>) -> bool {
    match (truth, hit) {
        (None, None) => true,
        (Some(t), Some(h)) => {
            let first = &t.accepted[0];
            first.prim == h.prim && t.t_rounded == h.t && first.rounded == [h.u, h.v]
        }
        _ => false,
    }
}

fn print(c: &Counts) {
    println!("rays {}: both miss {}, same triangle {}, differ {}", c.rays, c.both_miss, c.same, c.differ);
    for (name, [ours, oracle, neither]) in [
        ("only the oracle hits", c.missed),
        ("only we hit", c.false_hit),
        ("surfaces more than 1e-3 apart", c.other_surface),
    ] {
        println!("  {name}: we are right {ours}, the oracle {oracle}, neither {neither}");
    }
    let [both, ours, oracle, neither] = c.other_triangle;
    println!(
        "  another triangle within 1e-3: exact tie {both}, only ours is met first {ours}, only the oracle's {oracle}, neither {neither}"
    );
    println!("our answers that are not exact: {}; the oracle's that are wrong: {}", c.ours_inexact, c.oracle_wrong);
}

/// The records of a file of `count` records of `size` bytes behind a magic word.
fn records(file: &str, magic: [u8; 4], size: usize) -> Result<Vec<u8>, String> {
    let bytes = fs::read(file).map_err(|e| format!("{file}: {e}"))?;
    let (head, body) = bytes.split_at_checked(8).ok_or_else(|| format!("{file}: no header"))?;
    let count = u32::from_le_bytes([head[4], head[5], head[6], head[7]]) as usize;
    if head[..4] != magic[..] || body.len() != count * size {
        return Err(format!("{file}: not {count} records of {}", String::from_utf8_lossy(&magic)));
    }
    Ok(body.to_vec())
}

fn word(record: &[u8], i: usize) -> u32 {
    u32::from_le_bytes([record[4 * i], record[4 * i + 1], record[4 * i + 2], record[4 * i + 3]])
}

fn float(record: &[u8], i: usize) -> f32 {
    f32::from_bits(word(record, i))
}

fn vec3(record: &[u8], i: usize) -> Vec3 {
    Vec3::new(float(record, i), float(record, i + 1), float(record, i + 2))
}

fn read_tris(file: &str) -> Result<(Vec<Vec3>, Vec<[u32; 3]>), String> {
    let body = records(file, *b"TRI1", 36)?;
    let positions: Vec<Vec3> = body.chunks_exact(12).map(|r| vec3(r, 0)).collect();
    let count = u32::try_from(positions.len() / 3).map_err(|e| e.to_string())?;
    Ok((positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect()))
}

fn read_rays(file: &str) -> Result<Vec<Ray>, String> {
    let body = records(file, *b"RAY1", 32)?;
    let ray = |r: &[u8]| Ray { origin: vec3(r, 0), t_near: float(r, 3), dir: vec3(r, 4), t_far: float(r, 7) };
    Ok(body.chunks_exact(32).map(ray).collect())
}

fn read_oracle(file: &str) -> Result<Vec<Oracle>, String> {
    let body = records(file, *b"ORC1", 40)?;
    let t = |r: &[u8]| f64::from_bits(u64::from(word(r, 2)) | u64::from(word(r, 3)) << 32);
    Ok(body.chunks_exact(40).map(|r| Oracle { ray: word(r, 0) as usize, prim: word(r, 1), t: t(r) }).collect())
}

fn read_hits(file: &str) -> Result<Vec<Option<Hit>>, String> {
    let body = records(file, *b"HIT1", 16)?;
    let hit = |r: &[u8]| Hit {
        t: float(r, 1),
        u: float(r, 2),
        v: float(r, 3),
        prim: PrimId(word(r, 0)),
        instance: InstanceId(0),
    };
    Ok(body.chunks_exact(16).map(|r| (word(r, 0) != u32::MAX).then(|| hit(r))).collect())
}
