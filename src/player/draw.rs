//! The [`Player`] as pixels.

use super::{
    canvas::Canvas,
    overlay::{self, Status},
    state::Player,
    view::View,
};
use crate::scene::{NodeId, Scene};

impl Player {
    /// Draws the picture and what lies over it.
    pub(super) fn draw(&self, now_s: f64, canvas: &mut Canvas<'_>) {
        let Some(picture) = &self.picture else {
            canvas.picture(&[], 0, 0);
            return;
        };
        canvas.picture(&picture.rgba, picture.width as usize, picture.height as usize);
        let scale = overlay::text_scale(self.size.0, self.size.1);
        let time_s = if self.clock.is_running() { picture.shot.time_s } else { self.clock.time_s(now_s) };
        if self.layers.overlay {
            let camera = self.camera_label();
            let status = Status {
                file: &self.stage.scene.file,
                clips: self.stage.playlist.label(),
                time_s,
                duration_s: self.clock.duration_s(),
                speed: self.clock.speed(),
                is_paused: self.clock.is_paused(),
                camera: &camera,
                shading: self.shading.name(),
                fps: self.fps(now_s),
            };
            overlay::draw_status(canvas, &overlay::status_lines(&status, picture), scale);
        }
        let bar = self.bar();
        if self.clock.duration_s() > 0.0 && (self.layers.overlay || self.is_on_bar()) {
            bar.draw(canvas, time_s, self.clock.duration_s(), &self.stage.ticks);
        }
        if let Some(message) = self.message() {
            overlay::draw_message(canvas, &message.text, message.is_error, bar.top() - 4 * scale, scale);
        }
        if self.layers.help {
            overlay::draw_help(canvas, scale);
        }
    }

    fn camera_label(&self) -> String {
        match self.view {
            View::File(camera) => {
                let cameras = &self.stage.cameras;
                let name = cameras.get(camera).map_or("", |&node| camera_name(&self.stage.scene, node));
                format!("camera {} of {} {name}", camera + 1, cameras.len()).trim_end().to_owned()
            }
            View::Framed => "framed".to_owned(),
            View::Free(_) => "free camera".to_owned(),
        }
    }
}

/// The name of the camera at a node, else that of the node.
fn camera_name(scene: &Scene, node: NodeId) -> &str {
    let node = &scene.nodes[node.index()];
    let camera = node.camera.map(|c| scene.cameras[c.index()].name.as_str());
    camera.filter(|name| !name.is_empty()).unwrap_or(&node.name)
}
