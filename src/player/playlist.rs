//! The clips that N walks through: each playable one, all together, none.

use std::sync::Arc;

use crate::scene::{ClipId, Scene};

/// What can be played, and which of it is.
#[derive(Clone, Debug)]
pub(super) struct Playlist {
    entries: Vec<Entry>,
    current: usize,
}

#[derive(Clone, Debug, PartialEq)]
struct Entry {
    clips: Arc<[ClipId]>,
    label: String,
    duration_s: f64,
}

impl Playlist {
    /// Every choice that `scene` offers, at the one whose clips are `start` (one of its own kind is added when the
    /// usual ones lack it). Without `start`, the first playable clip, or the rest pose.
    pub(super) fn new(scene: &Scene, start: Option<&[ClipId]>) -> Self {
        let ids = (0u32..).map(ClipId).zip(&scene.clips);
        let playable: Vec<_> = ids.filter(|(_, clip)| clip.disabled.is_none()).map(|(id, _)| id).collect();
        let mut choices: Vec<Vec<_>> = playable.iter().map(|&id| vec![id]).collect();
        if playable.len() > 1 {
            choices.push(playable);
        }
        choices.push(vec![]);
        let current = match start {
            None => 0,
            Some(start) => choices.iter().position(|c| c == start).unwrap_or_else(|| {
                choices.push(start.to_vec());
                choices.len() - 1
            }),
        };
        let entries = choices.into_iter().map(|clips| Entry::new(scene, clips)).collect();
        Self { entries, current }
    }

    /// Goes to the next choice, from the last to the first.
    pub(super) fn advance(&mut self) {
        self.current = (self.current + 1) % self.entries.len();
    }

    /// The clips of the choice.
    pub(super) fn clips(&self) -> &Arc<[ClipId]> {
        &self.entries[self.current].clips
    }

    /// How the choice is shown.
    pub(super) fn label(&self) -> &str {
        &self.entries[self.current].label
    }

    /// Length of the choice's longest clip in seconds.
    pub(super) fn duration_s(&self) -> f64 {
        self.entries[self.current].duration_s
    }
}

impl Entry {
    fn new(scene: &Scene, clips: Vec<ClipId>) -> Self {
        let label = match clips[..] {
            [] => "rest pose".to_owned(),
            [id] => {
                let name = &scene.clips[id.index()].name;
                let number = format!("animation {} of {}", id.0 + 1, scene.clips.len());
                if name.is_empty() { number } else { format!("{number}: {name}") }
            }
            _ => format!("{} animations together", clips.len()),
        };
        let duration_s = clips.iter().map(|c| scene.clips[c.index()].duration_s).fold(0.0, f64::max);
        Self { clips: clips.into(), label, duration_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Clip;

    fn scene() -> Scene {
        let clip = |name: &str, duration_s, disabled: Option<&str>| Clip {
            name: name.to_owned(),
            duration_s,
            disabled: disabled.map(str::to_owned),
            ..Clip::default()
        };
        Scene {
            clips: vec![clip("a", 1.0, None), clip("b", 9.0, Some("bad")), clip("", 2.0, None)],
            ..Scene::default()
        }
    }

    #[test]
    fn choices_are_each_playable_clip_then_all_then_none() {
        let mut list = Playlist::new(&scene(), None);
        let mut seen = vec![];
        for _ in 0..5 {
            seen.push((list.label().to_owned(), list.duration_s()));
            list.advance();
        }
        let labels: Vec<_> = seen.iter().map(|(l, _)| l.as_str()).collect();
        let all = "2 animations together";
        assert_eq!(labels, ["animation 1 of 3: a", "animation 3 of 3", all, "rest pose", "animation 1 of 3: a"]);
        assert!((seen[2].1 - 2.0).abs() < 1e-12, "disabled clips do not count");
    }

    #[test]
    fn start_is_found_or_added() {
        let scene = scene();
        assert_eq!(Playlist::new(&scene, Some(&[])).label(), "rest pose");
        assert_eq!(Playlist::new(&scene, Some(&[ClipId(2)])).duration_s().to_bits(), 2.0f64.to_bits());
        let odd = [ClipId(2), ClipId(0)];
        assert_eq!(Playlist::new(&scene, Some(&odd)).clips()[..], odd);
    }

    #[test]
    fn scene_without_clips_has_the_rest_pose_only() {
        let mut list = Playlist::new(&Scene::default(), None);
        assert!(list.clips().is_empty());
        list.advance();
        assert!(list.clips().is_empty());
    }
}
