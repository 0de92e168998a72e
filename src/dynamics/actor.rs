use std::sync::Arc;

use glam::DAffine3;

use super::{Playing, pool::Pool};
use crate::{
    anim::{ActiveClip, MotionClass, Pose, classify},
    scene::{PartInstance, Scene},
};

/// A scene at a place, with the pose of the last frame.
#[derive(Debug)]
pub(super) struct Actor {
    pub(super) scene: Arc<Scene>,
    pub(super) world_from_scene: DAffine3,
    /// Class of each instance of the scene; nothing is static in an actor that travels.
    pub(super) classes: Vec<MotionClass>,
    /// True once the actor was moved as a whole.
    pub(super) travels: bool,
    pub(super) pose: Arc<Pose>,
    /// The pose before, while a frame in which it changed is made.
    pub(super) previous: Option<Arc<Pose>>,
    clips: Vec<ActiveClip>,
    /// What the clips were faded in from, and how far.
    fade: Option<f64>,
    faded: Vec<ActiveClip>,
    posed: bool,
    poses: Pool<Pose>,
}

impl Actor {
    pub(super) fn new(scene: Arc<Scene>, world_from_scene: DAffine3) -> Self {
        Self {
            classes: classify(&scene),
            pose: Arc::new(Pose::rest(&scene)),
            scene,
            world_from_scene,
            travels: false,
            previous: None,
            clips: Vec::new(),
            fade: None,
            faded: Vec::new(),
            posed: false,
            poses: Pool::default(),
        }
    }

    /// Moves the actor as a whole; true when its parts stop being static by that.
    pub(super) fn place(&mut self, world_from_scene: DAffine3) -> bool {
        if bits(&self.world_from_scene) == bits(&world_from_scene) {
            return false;
        }
        self.world_from_scene = world_from_scene;
        self.posed = false;
        let first = !self.travels;
        self.travels = true;
        for class in &mut self.classes {
            *class = (*class).max(MotionClass::Rigid);
        }
        first
    }

    /// Poses the actor unless clips, times and place are those of the last call; true when it did.
    pub(super) fn pose(&mut self, playing: Playing<'_>) -> bool {
        self.previous = None;
        let Playing { clips, fade } = playing;
        let faded = fade.map_or(&[][..], |fade| fade.from);
        let alpha = fade.map(|fade| fade.alpha);
        let same_fade = self.fade.map(f64::to_bits) == alpha.map(f64::to_bits) && same_clips(&self.faded, faded);
        if self.posed && same_clips(&self.clips, clips) && same_fade {
            return false;
        }
        let mut next = self.poses.take(|| Pose::clone(&self.pose));
        let pose = Arc::get_mut(&mut next).expect("a taken buffer has one owner");
        match fade {
            Some(fade) => pose.evaluate_faded(&self.scene, fade, clips, &self.world_from_scene),
            None => pose.evaluate(&self.scene, clips, &self.world_from_scene),
        }
        self.poses.keep(next.clone());
        self.previous = Some(std::mem::replace(&mut self.pose, next));
        self.clips.clear();
        self.clips.extend_from_slice(clips);
        self.fade = alpha;
        self.faded.clear();
        self.faded.extend_from_slice(faded);
        self.posed = true;
        true
    }

    /// The clip that the actor plays by itself, if it does.
    pub(super) fn sole_clip(&self) -> Option<ActiveClip> {
        match &self.clips[..] {
            &[only] if self.fade.is_none() && !self.travels => Some(only),
            _ => None,
        }
    }

    /// True when this frame's pose places or shapes `part` other than the last one did.
    pub(super) fn moved(&self, part: PartInstance) -> bool {
        let Some(previous) = &self.previous else { return false };
        let node = &self.scene.nodes[part.node.index()];
        let skin = node.skin.filter(|_| self.scene.part(part).influences.is_some());
        let placed = match skin {
            Some(skin) => {
                let (old, new) = (previous.joint_matrices(skin), self.pose.joint_matrices(skin));
                old.len() == new.len() && old.iter().zip(new).all(|(a, b)| bits(a) == bits(b))
            }
            None => bits(previous.world_from_node(part.node)) == bits(self.pose.world_from_node(part.node)),
        };
        let (old, new) = (previous.weights(part.node), self.pose.weights(part.node));
        let shaped = old.len() == new.len() && old.iter().zip(new).all(|(a, b)| a.to_bits() == b.to_bits());
        !(placed && shaped)
    }
}

fn bits(transform: &DAffine3) -> [u64; 12] {
    transform.to_cols_array().map(f64::to_bits)
}

fn same_clips(a: &[ActiveClip], b: &[ActiveClip]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.clip == b.clip && a.time_s.to_bits() == b.time_s.to_bits())
}
