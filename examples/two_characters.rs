//! Two animated characters walk into each other: which parts begin to touch, go on and part, with point, normal and depth.
//!
//! `cargo run --release --example two_characters`

use std::{error::Error, sync::Arc};

use kinora::{
    anim::{ActiveClip, loop_time},
    collide::{CollisionConfig, CollisionWorld, ContactLevel, ContactOptions, ContactPhase, ContactTracker, Layers},
    glam::{DAffine3, DVec3},
    scene::{ClipId, builtin},
};

/// Layer of the characters; the stages that they walk on stay on the first one.
const CHARACTERS: u32 = 0b10;

fn main() -> Result<(), Box<dyn Error>> {
    let scene = Arc::new(builtin::load("walk")?);
    let duration = scene.clips[0].duration_s;
    let mut world = CollisionWorld::new(&CollisionConfig { contacts: true, ..CollisionConfig::default() })?;
    // Both share the file's data; each has its own clip time and place.
    let figures = [
        world.add_scene(scene.clone(), DAffine3::IDENTITY)?,
        world.add_scene(scene, DAffine3::from_translation(DVec3::X))?,
    ];
    let rest = world.snapshot()?;
    for part in rest.parts().filter(|part| part.path() == "figure") {
        world.set_layers(part.id(), Layers { on: CHARACTERS, sees: CHARACTERS })?;
    }
    let options = ContactOptions { layers: CHARACTERS, ..ContactOptions::default() };
    let mut tracker = ContactTracker::new(ContactLevel::Part);
    for frame in 0..24_u32 {
        let seconds = f64::from(frame) / 12.0;
        for (figure, start_s) in figures.into_iter().zip([0.0, 0.5]) {
            let time_s = loop_time(start_s, seconds, 1.0, duration);
            world.set_time(figure, &[ActiveClip { clip: ClipId(0), time_s }])?;
        }
        // The second comes through the first.
        let place = DVec3::X * (1.2 - 1.2 * seconds);
        world.set_transform(figures[1], DAffine3::from_translation(place))?;
        let snapshot = world.snapshot()?;
        for event in tracker.update(&snapshot.contacts(&options)?) {
            if event.phase == ContactPhase::Persist {
                continue;
            }
            let [a, b] = event.parts;
            println!(
                "frame {frame}: {:?} {} - {}, {} pairs of triangles, {:.3} deep along {:.2} at {:.3}",
                event.phase,
                snapshot.part(a)?.path(),
                snapshot.part(b)?.path(),
                event.count,
                event.depth,
                event.normal,
                event.point,
            );
        }
    }
    Ok(())
}
