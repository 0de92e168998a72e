//! A cloth against itself: where it cuts through itself in a frame, and what touches on the way to the next.
//!
//! `cargo run --release --example cloth_self`

use std::{error::Error, sync::Arc};

use kinora::{
    anim::ActiveClip,
    collide::{CollisionConfig, CollisionWorld, ContactOptions, Continuous},
    glam::DAffine3,
    scene::{ClipId, builtin},
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut world = CollisionWorld::new(&CollisionConfig { contacts: true, ..CollisionConfig::default() })?;
    let cloth = world.add_scene(Arc::new(builtin::load("cloth")?), DAffine3::IDENTITY)?;
    // Triangles that share a vertex, or a place in the rest pose, always touch: they are left out.
    let options = ContactOptions { within: true, ..ContactOptions::default() };
    // A hair's breadth counts as touching.
    let settings = Continuous { min_separation: 1e-4, tolerance: 1e-6, ..Continuous::default() };
    let mut last = None;
    for frame in 0..12_u32 {
        let time_s = f64::from(frame) / 30.0;
        world.set_time(cloth, &[ActiveClip { clip: ClipId(0), time_s }])?;
        let snapshot = world.snapshot()?;
        let contacts = snapshot.contacts(&options)?;
        let deepest = contacts.iter().map(|c| c.depth).fold(0.0, f64::max);
        println!("frame {frame}: {} pairs of triangles meet, {deepest:.4} deep at most", contacts.len());
        if let Some(last) = &last {
            let moving = snapshot_to_next(last, &snapshot, &options, &settings)?;
            println!("    on the way: {moving}");
        }
        last = Some(snapshot);
    }
    Ok(())
}

/// What touched between two frames, in words.
fn snapshot_to_next(
    last: &kinora::collide::Snapshot,
    next: &kinora::collide::Snapshot,
    options: &ContactOptions<'_>,
    settings: &Continuous,
) -> Result<String, kinora::collide::CollideError> {
    let moving = last.moving_contacts(next, options, settings)?;
    let first = moving.iter().min_by(|a, b| a.impact.time.total_cmp(&b.impact.time));
    Ok(match first {
        None => "nothing touches".to_owned(),
        Some(first) => format!(
            "{} features touch, the first at {:.1} % of the step: {:?}",
            moving.len(),
            100.0 * first.impact.time,
            first.features
        ),
    })
}
