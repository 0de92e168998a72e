//! A game server without a window: shots at a walking figure, decided on the figure's own skin and not on capsules around it.
//!
//! `cargo run --release --example hits_on_server --no-default-features`

use std::{error::Error, sync::Arc, time::Instant};

use kinora::{
    anim::{ActiveClip, loop_time},
    collide::{CollisionConfig, CollisionWorld, Layers},
    geom::{Aabb, Ray},
    glam::{DAffine3, Vec3},
    scene::{ClipId, builtin},
};

/// Layer of what bullets hit, and of what hides the shooter.
const BODIES: u32 = 0b01;
const WALLS: u32 = 0b10;

fn main() -> Result<(), Box<dyn Error>> {
    let scene = Arc::new(builtin::load("walk")?);
    let duration = scene.clips[0].duration_s;
    let config = CollisionConfig { rays: true, ..CollisionConfig::default() };
    let mut world = CollisionWorld::new(&config)?;
    let figure = world.add_scene(scene, DAffine3::IDENTITY)?;
    let bounds = world.snapshot()?.bounds();
    // A wall before the lower half of the figure.
    let (low, high) = (bounds.min - 0.1, bounds.max + 0.1);
    let wall =
        Aabb { min: high.with_y(low.y).with_x(low.x) + Vec3::Z, max: high.with_y(bounds.center().y) + Vec3::Z * 1.1 };
    let wall = world.add_box("wall", wall, DAffine3::IDENTITY)?;
    for part in world.parts(wall)? {
        world.set_layers(part, Layers { on: WALLS, ..Layers::default() })?;
    }
    let muzzle = bounds.center() + Vec3::Z * 10.0;
    for tick in 0..8_u32 {
        let began = Instant::now();
        let time_s = loop_time(0.0, f64::from(tick) / 20.0, 1.0, duration);
        world.set_time(figure, &[ActiveClip { clip: ClipId(0), time_s }])?;
        let snapshot = world.snapshot()?;
        // A fan of shots over the figure's whole box; those that hit it and that no wall stops.
        let shot = |i: u16| {
            let (x, y) = (f32::from(i % 32) / 31.0, f32::from(i / 32) / 31.0);
            let target = bounds.min + bounds.extent() * Vec3::new(x, y, 0.5);
            Ray { t_far: 2.0, ..Ray::new(muzzle, target - muzzle) }
        };
        let rays: Vec<Ray> = (0..1024).map(shot).collect();
        let mut hits = vec![None; rays.len()];
        snapshot.closest_hits(&rays, BODIES, &mut hits)?;
        let mut counted = 0;
        for (ray, hit) in rays.iter().zip(&hits) {
            let Some(hit) = hit else { continue };
            let way = Ray { t_far: hit.t, ..*ray };
            counted += u32::from(!snapshot.any_hit(&way, WALLS)?);
        }
        let hit = hits.iter().flatten().count();
        println!("tick {tick}: {counted} of {hit} shots at the figure pass the wall, in {:.1?}", began.elapsed());
    }
    Ok(())
}
