//! Counts and rates of structures on one mesh: what a ray visits, tests and reads.
//!
//! `cargo run --release --example accel_counts -- MESH.tris RAYS SPEC...`, where RAYS is a `.rays` file or `WxH`, a camera that sees the whole mesh,
//! and SPEC is `NAME[:key=value,...]` as for `--accel`. One thread; times are CPU times where the system tells
//! them, rates medians of five casts without counting.

use std::{error::Error, fs, path::Path, time::Instant};

use kinora::{
    accel::{
        Accel, AccelConfig, AccelSpec, AnyAccel, AnyHit, Closest, ReadCounter, TravRay, grug::Grug, grug::GrugConfig,
    },
    geom::{Aabb, Ray, Triangles},
    glam::Vec3,
    simd::{Scalar, Simd, SimdLevel, Task, dispatch},
};

/// Seconds that this thread has run, or that have passed since `start` where the system does not tell.
fn seconds(start: Instant) -> f64 {
    let text = fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let ran = text.split_whitespace().next().and_then(|ns| ns.parse::<u64>().ok());
    ran.map_or_else(|| start.elapsed().as_secs_f64(), |ns| ns as f64 * 1e-9)
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

/// Rays from a point off the mesh through the pixels of an image.
fn camera(size: &str, bounds: &Aabb) -> Result<Vec<Ray>, Box<dyn Error>> {
    let (width, height) = size.split_once('x').ok_or("rays are a .rays file or WxH")?;
    let (width, height): (u32, u32) = (width.parse()?, height.parse()?);
    let target = bounds.center();
    let origin = target + Vec3::new(0.45, 0.35, 1.0).normalize() * bounds.diagonal() * 1.2;
    let forward = (target - origin).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let pixel = |i: u32| {
        let x = ((i % width) as f32 + 0.5) / height as f32 - 0.5 * width as f32 / height as f32;
        let y = 0.5 - ((i / width) as f32 + 0.5) / height as f32;
        Ray::new(origin, forward + (right * x + up * y) * 0.9)
    };
    Ok((0..width * height).map(pixel).collect())
}

fn read_rays(path: &str, bounds: &Aabb) -> Result<Vec<Ray>, Box<dyn Error>> {
    if Path::new(path).extension().is_none_or(|e| e != "rays") {
        return camera(path, bounds);
    }
    let content = floats(fs::read(path)?.get(8..).ok_or("too short")?);
    let ray = |r: &[f32; 8]| Ray {
        origin: Vec3::new(r[0], r[1], r[2]),
        t_near: r[3],
        dir: Vec3::new(r[4], r[5], r[6]),
        t_far: r[7],
    };
    Ok(content.as_chunks().0.iter().map(ray).collect())
}

/// Casts all rays; the number of hits.
struct Cast<'a> {
    accel: &'a AnyAccel,
    prims: Triangles<'a>,
    rays: &'a [TravRay],
}

impl Task for Cast<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Simd>(self) -> usize {
        let mut hits = 0;
        for ray in self.rays {
            let mut best = Closest::new(ray);
            self.accel.closest::<S, _, _>(&self.prims, ray, &mut best, &AnyHit, &mut ());
            hits += usize::from(best.hit(ray).is_some());
        }
        hits
    }
}

fn counted(accel: &AnyAccel, prims: &Triangles<'_>, rays: &[TravRay]) -> ReadCounter {
    let mut count = ReadCounter::default();
    for ray in rays {
        accel.closest::<Scalar, _, _>(prims, ray, &mut Closest::new(ray), &AnyHit, &mut count);
        count.next_ray();
    }
    count
}

/// The figures of the paper's memory table, for `grug` alone.
fn grug_bytes(spec: &str, prims: &Triangles<'_>) -> Result<String, Box<dyn Error>> {
    let mut config = GrugConfig::default();
    for (key, value) in spec.split_once(':').map_or("", |(_, s)| s).split(',').filter_map(|s| s.split_once('=')) {
        config.set(key, value)?;
    }
    let grug = Grug::build(prims, &config)?;
    let bytes = grug.bytes();
    Ok(format!(
        "  res {} groups {} full tree {} tree {} boundary {} hash {}",
        grug.resolution(),
        grug.groups(),
        bytes.full_tree,
        bytes.tree,
        bytes.boundary,
        bytes.hash
    ))
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [mesh, rays, specs @ ..] = &args[..] else { return Err("MESH.tris RAYS SPEC...".into()) };
    let corners = floats(fs::read(mesh)?.get(8..).ok_or("too short")?);
    let positions: Vec<Vec3> = corners.as_chunks::<3>().0.iter().map(|&p| Vec3::from_array(p)).collect();
    let count = u32::try_from(positions.len() / 3)?;
    let indices: Vec<[u32; 3]> = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 0 };
    let rays = read_rays(rays, &Aabb::from_points(positions.iter().copied()))?;
    let rays: Vec<TravRay> = rays.iter().filter_map(TravRay::new).collect();
    println!("{count} triangles, {} rays; columns after the rate are means a ray", rays.len());
    println!("spec build_ms node_MB total_MB Mrays/s hits nodes blocks prims steps reads words bytes lines");
    let start = Instant::now();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    for text in specs {
        let spec: AccelSpec = text.parse()?;
        let (accel, build_s) = pool.install(|| {
            let began = seconds(start);
            let accel = spec.build(&prims);
            (accel, seconds(start) - began)
        });
        let (accel, build_ms) = (accel?, build_s * 1e3);
        let mut times = [0.0; 5];
        let mut hits = 0;
        for time in &mut times {
            let began = seconds(start);
            hits = dispatch(SimdLevel::best(), Cast { accel: &accel, prims, rays: &rays });
            *time = seconds(start) - began;
        }
        times.sort_by(f64::total_cmp);
        let c = counted(&accel, &prims, &rays);
        let counts = [c.nodes, c.blocks, c.prims, c.steps, c.transactions, c.words, c.bytes, c.lines];
        let each = counts.map(|n| format!("{:.2}", n as f64 / rays.len() as f64)).join(" ");
        let stats = accel.stats();
        let rate = rays.len() as f64 / times[2] / 1e6;
        let (node_mb, total_mb) = (stats.node_bytes as f64 / 1e6, stats.total_bytes as f64 / 1e6);
        println!("{text} {build_ms:.1} {node_mb:.2} {total_mb:.2} {rate:.3} {hits} {each}");
        if text.starts_with("grug") {
            println!("{}", grug_bytes(text, &prims)?);
        }
    }
    Ok(())
}
