//! `walk`: a skinned figure that walks on a belt of slats.

mod body;
mod gait;
mod paint;
mod rig;
mod skin_mesh;
mod stage;
mod weights;

use glam::{DQuat, DVec3};

use super::{
    glb::{Animation, Glb, Keys, Node},
    maths::deg,
    nets::{self, Surface},
};
use body::Body;
use rig::JOINTS;

/// Gait cycles in the clip: in two of them every slat of the belt comes round once.
const CYCLES: usize = 2;
const KEYS_PER_CYCLE: usize = 30;

/// The file, with a figure whose mesh is finer by `detail` (1 for the one shipped).
pub fn walk(detail: f64) -> Vec<u8> {
    let body = Body::new();
    let surface = sculpt(&body, detail);
    let mut glb = Glb::default();
    let mut animation = Animation::default();
    let joints = rig_nodes(&mut glb);
    animate(&mut glb, &mut animation, &joints);
    let mesh = skin_mesh::add(&mut glb, &body, &surface);
    let binds: Vec<DVec3> = JOINTS.iter().map(|j| -j.position()).collect();
    let binds = glb.translation_matrices(&binds);
    let skin = Some(glb.skin("figure", &joints, binds));
    let figure = glb.node(Node { name: "figure".into(), mesh: Some(mesh), skin, ..Node::default() });
    let camera = glb.camera("three-quarter", DVec3::new(1.70, 1.32, 2.90), DVec3::new(0.0, 0.77, 0.0), deg(32.5));
    let mut roots = vec![joints[0], figure, camera];
    roots.extend(stage::add(&mut glb, &mut animation, CYCLES as f64 * gait::CYCLE));
    glb.animation("walk", &animation);
    glb.finish(&roots)
}

/// The figure's surface as an even mesh, finer at hands and head.
fn sculpt(body: &Body, detail: f64) -> Surface {
    let field = |p: DVec3| body.distance(p);
    let base = 0.0210 / detail;
    let x = |x: f64| if x.abs() > 0.40 { 0.72 * base } else { base };
    let y = |y: f64| if (0.12..=1.36).contains(&y) { 1.12 * base } else { 0.85 * base };
    let axes = [
        nets::grid_lines(-0.62, 0.62, x),
        nets::grid_lines(-0.03, 1.70, y),
        nets::grid_lines(-0.20, 0.25, |_| 0.92 * base),
    ];
    let mut surface = nets::extract(&field, &axes);
    surface.relax(&field, 8);
    surface
}

fn rig_nodes(glb: &mut Glb) -> Vec<usize> {
    let first = 0;
    for joint in JOINTS {
        let children = JOINTS.iter().filter(|c| c.parent() == Some(joint)).map(|&c| first + c as usize).collect();
        let origin = joint.parent().map_or(DVec3::ZERO, rig::Joint::position);
        glb.node(Node { name: joint.name(), translation: joint.position() - origin, children, ..Node::default() });
    }
    (first..first + JOINTS.len()).collect()
}

fn animate(glb: &mut Glb, animation: &mut Animation, joints: &[usize]) {
    let count = CYCLES * KEYS_PER_CYCLE;
    let times: Vec<f64> = (0..=count).map(|k| gait::CYCLE * k as f64 / KEYS_PER_CYCLE as f64).collect();
    // The last key repeats the first: phases are taken within one cycle.
    let postures: Vec<gait::Posture> =
        (0..=count).map(|k| gait::posture((k % KEYS_PER_CYCLE) as f64 / KEYS_PER_CYCLE as f64)).collect();
    let input = glb.scalars(&times);
    let places: Vec<DVec3> = postures.iter().map(|p| p.hips).collect();
    let output = glb.vectors(&places);
    let sampler = animation.sampler(Keys::Linear, input, output);
    animation.channel(sampler, joints[0], "translation");
    for joint in JOINTS {
        let turns: Vec<DQuat> = postures.iter().map(|p| p.rotations[joint as usize]).collect();
        let output = glb.rotations(&turns);
        let sampler = animation.sampler(Keys::Linear, input, output);
        animation.channel(sampler, joints[joint as usize], "rotation");
    }
}
