//! Picking under the mouse: what of an animated character is under a pixel, at its exact pose.
//!
//! `cargo run --release --example pick -- [X Y]` in a window of 1280 x 720.

use std::{error::Error, sync::Arc};

use kinora::{
    anim::ActiveClip,
    collide::{CollisionConfig, CollisionWorld, Layers},
    geom::{Aabb, Ray},
    glam::{DAffine3, Vec3},
    scene::{ClipId, builtin},
};

const SIZE: [f32; 2] = [1280.0, 720.0];

/// The ray through the middle of a pixel, from an eye before a box that it sees whole.
fn ray_of_pixel(bounds: &Aabb, [x, y]: [f32; 2]) -> Ray {
    let center = bounds.center();
    let eye = center + Vec3::Z * (bounds.extent().z * 0.5 + bounds.extent().max_element());
    // Half of the picture's height at a distance of 1.
    let half = 0.6;
    let right = (2.0 * (x + 0.5) / SIZE[0] - 1.0) * half * SIZE[0] / SIZE[1];
    let up = (1.0 - 2.0 * (y + 0.5) / SIZE[1]) * half;
    Ray::new(eye, Vec3::new(right, up, -1.0))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<f32>());
    let mouse = match (numbers.next(), numbers.next()) {
        (Some(x), Some(y)) => [x?, y?],
        _ => [SIZE[0] * 0.5, SIZE[1] * 0.5],
    };
    let mut world = CollisionWorld::new(&CollisionConfig::default())?;
    let character = world.add_scene(Arc::new(builtin::load("walk")?), DAffine3::IDENTITY)?;
    for time_s in [0.0, 0.25, 0.5, 0.75] {
        world.set_time(character, &[ActiveClip { clip: ClipId(0), time_s }])?;
        let snapshot = world.snapshot()?;
        let ray = ray_of_pixel(&snapshot.bounds(), mouse);
        let Some(hit) = snapshot.closest_hit(&ray, Layers::ALL)? else {
            println!("{time_s:.2} s: nothing at {mouse:?}");
            continue;
        };
        let (surface, part) = (hit.surface, snapshot.part(hit.surface.part)?);
        println!(
            "{time_s:.2} s: {}, triangle {} ({:?}) at {:.3}, uv {:?}",
            part.path(),
            surface.triangle,
            hit.side,
            surface.point,
            surface.uv.map(|uv| uv.to_array()),
        );
    }
    Ok(())
}
