//! Single rays by kinora, obvhs, bvh and parry3d on the same scene in one run, one thread: builds and rays, the best processor time of several turns.
//!
//! `cargo bench --bench peers --features peers [-- FOLDER]`. Without a folder: a dented sphere of 80,000 triangles. A folder holds `frame_0000.tris`
//! and `r0000/{primary_t8,ao,diffuse,shadow}.rays`, in the form that `kinora cast` reads.
//!
//! Every answer is compared with kinora's. The peers' triangle tests are not exact, so a few rays at edges differ; a row says how many.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers")]

#[path = "../meshes/mod.rs"]
mod meshes;
mod peers;
mod scene;

use std::{hint::black_box, path::Path};

use kinora::{geom::Ray, simd::SimdLevel};
use peers::{Hit, Peer};
use scene::{Rays, Scene};

/// Turns of every peer with every set of rays.
const TURNS: usize = 3;

/// Processor time of this thread in seconds.
fn now() -> f64 {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
    }
    #[cfg(not(unix))]
    {
        static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
        START.get_or_init(std::time::Instant::now).elapsed().as_secs_f64()
    }
}

fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let began = now();
    let out = black_box(work());
    (now() - began, out)
}

/// What one peer answers to all rays of a set.
#[derive(PartialEq)]
enum Answers {
    Closest(Vec<Hit>),
    Blocked(Vec<bool>),
}

fn answers(peer: &dyn Peer, set: &Rays) -> Answers {
    if set.is_any { Answers::Blocked(peer.blocked(&set.all)) } else { Answers::Closest(peer.closest(&set.all)) }
}

/// Rays that are answered otherwise: other triangles at about the same distance count as equal.
fn differing(due: &Answers, found: &Answers) -> usize {
    match (due, found) {
        (Answers::Closest(due), Answers::Closest(found)) => {
            let near = |a: f32, b: f32| (a - b).abs() <= 1e-3 * a.abs().max(b.abs()) + 1e-5;
            let same = |(a, b): (&Hit, &Hit)| match (a, b) {
                (Some(a), Some(b)) => a.0 == b.0 || near(a.1, b.1),
                (a, b) => a == b,
            };
            due.iter().zip(found).filter(|&pair| !same(pair)).count()
        }
        (Answers::Blocked(due), Answers::Blocked(found)) => due.iter().zip(found).filter(|(a, b)| a != b).count(),
        _ => due_len(due),
    }
}

fn due_len(answers: &Answers) -> usize {
    match answers {
        Answers::Closest(hits) => hits.len(),
        Answers::Blocked(blocked) => blocked.len(),
    }
}

fn builds(scene: &Scene) -> Vec<Box<dyn Peer>> {
    let mut built = Vec::new();
    println!("{:<22} {:>14}", "build", "M triangles/s");
    for name in peers::NAMES {
        let mut best = f64::INFINITY;
        let mut last = None;
        for _ in 0..TURNS {
            let (seconds, peer) = timed(|| peers::build(name, scene));
            (best, last) = (best.min(seconds), Some(peer));
        }
        println!("{name:<22} {:>14.2}", scene.indices.len() as f64 / best * 1e-6);
        built.extend(last);
    }
    built
}

fn rays(peers: &[Box<dyn Peer>], set: &Rays) {
    let due = answers(&*peers[0], set);
    let mut best = vec![f64::INFINITY; peers.len()];
    let mut wrong = vec![0; peers.len()];
    for _ in 0..TURNS {
        for (i, peer) in peers.iter().enumerate() {
            let (seconds, found) = timed(|| answers(&**peer, set));
            (best[i], wrong[i]) = (best[i].min(seconds), differing(&due, &found));
        }
    }
    for (i, name) in peers::NAMES.iter().enumerate() {
        let rate = set.all.len() as f64 / best[i] * 1e-6;
        println!("{:<9} {name:<22} {rate:8.2} M/s  {:5.2} x  {} differ", set.name, best[i] / best[0], wrong[i]);
    }
    // Ours are equal bit for bit; the others err at edges alone.
    for (name, &wrong) in peers::NAMES.iter().zip(&wrong) {
        let most = if name.starts_with("kinora") { 0 } else { set.all.len() / 50 };
        assert!(wrong <= most, "{name} answers {wrong} of {} rays otherwise", set.all.len());
    }
}

fn main() {
    let folder = std::env::args().skip(1).find(|a| !a.starts_with('-'));
    let scene = match &folder {
        Some(folder) => Scene::read(Path::new(folder)).unwrap_or_else(|e| panic!("{folder}: {e}")),
        None => Scene::sphere(200),
    };
    println!(
        "{}, {} triangles, {}; ratios of times to those of {}",
        folder.as_deref().unwrap_or("dented sphere"),
        scene.indices.len(),
        SimdLevel::best(),
        peers::NAMES[0],
    );
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one");
    pool.install(|| {
        let peers = builds(&scene);
        for set in scene.sets(&*peers[0]) {
            rays(&peers, &set);
        }
    });
}

/// The hit of a ray as the scene needs it to make others.
fn first_hit(peer: &dyn Peer, ray: Ray) -> Hit {
    peer.closest(&[ray])[0]
}
