//! The `--camera` option.

use kinora::{
    anim::animation_bounds,
    render::CameraView,
    scene::{ClipId, NodeId, Scene},
    world::World,
};

use super::error::CliError;

/// Where the picture is seen from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Viewpoint {
    /// A camera of the file, animated with its node.
    Node(NodeId),
    /// One place for every frame.
    Fixed(CameraView),
}

impl Viewpoint {
    /// What `--camera` asks for: an index or name of a camera, or `auto` for the file's first camera, else a view
    /// that holds the whole animation; `framed` is that view whatever the file has.
    ///
    /// # Errors
    /// A usage error when the file has no such camera, or no node of the scene holds it.
    pub(crate) fn select(scene: &Scene, choice: &str, clips: &[ClipId], aspect: f32) -> Result<Self, CliError> {
        let framed = || Self::Fixed(CameraView::framing(animation_bounds(scene, clips), aspect));
        let mut nodes = CameraView::nodes(scene).into_iter();
        match choice {
            "auto" => return Ok(nodes.next().map_or_else(framed, Self::Node)),
            "framed" => return Ok(framed()),
            _ => {}
        }
        let camera_of = |node: &NodeId| scene.nodes[node.index()].camera;
        let by_index = choice.parse::<usize>().ok().filter(|&i| i < scene.cameras.len());
        let found = match by_index {
            Some(index) => nodes.find(|n| camera_of(n).is_some_and(|c| c.index() == index)),
            None => nodes.find(|n| {
                let names = [camera_of(n).map(|c| &scene.cameras[c.index()].name), Some(&scene.nodes[n.index()].name)];
                names.contains(&Some(&choice.to_owned()))
            }),
        };
        found.map(Self::Node).ok_or_else(|| CliError::usage(missing(scene, choice)))
    }

    /// A text that differs where, for one scene and choice of clips, the view does.
    pub(crate) fn key(self) -> String {
        match self {
            Self::Node(node) => format!("node {}", node.0),
            Self::Fixed(_) => "framed".to_owned(),
        }
    }

    /// The view of one frame.
    pub(crate) fn view(self, world: &World) -> Option<CameraView> {
        match self {
            Self::Node(node) => CameraView::at_node(world.actor_scene(0), world.actor_pose(0), node),
            Self::Fixed(view) => Some(view),
        }
    }
}

fn missing(scene: &Scene, choice: &str) -> String {
    let file = &scene.file;
    let names: Vec<_> = scene.cameras.iter().map(|c| c.name.as_str()).enumerate().take(20).collect();
    if names.is_empty() {
        return format!("{file}: no camera `{choice}`: the file has none; use --camera auto");
    }
    let names: Vec<_> =
        names.iter().map(|(i, n)| if n.is_empty() { i.to_string() } else { format!("{i} `{n}`") }).collect();
    format!("{file}: no camera `{choice}` in the scene; the file has {}", names.join(", "))
}
