//! The window itself: translates its events for the [`Player`] and shows what the player draws. The only file that
//! names window types.

use std::{
    num::NonZeroU32,
    path::PathBuf,
    rc::Rc,
    sync::Arc,
    time::{Duration, Instant},
};

use softbuffer::{Context, Surface};
use winit::{
    application::ApplicationHandler,
    dpi::PhysicalSize,
    error::EventLoopError,
    event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent},
    event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy, OwnedDisplayHandle},
    keyboard::{Key as WinitKey, NamedKey},
    window::{Window, WindowId},
};

use super::{
    LoadFile, PlayError, PlayOptions, Stop,
    canvas::Canvas,
    input::{Button, Input, Key},
    request::Report,
    state::{Command, Player},
    worker::{Engine, Worker},
};
use crate::scene::Scene;

/// How often the request to stop is looked at.
const STOP_POLL: Duration = Duration::from_millis(100);
/// Pixels of a touchpad that make a notch of the wheel.
const NOTCH_PIXELS: f64 = 40.0;

/// What wakes the event loop.
#[derive(Debug)]
enum Wake {
    Report(Report),
    Opened(PathBuf, Result<Arc<Scene>, String>),
}

/// A connection to the display, before there is a window.
#[derive(Debug)]
pub(super) struct Display(EventLoop<Wake>);

impl Display {
    /// Connects.
    ///
    /// # Errors
    /// [`PlayError::NoDisplay`] when there is none.
    pub(super) fn connect() -> Result<Self, PlayError> {
        let reason = |e: EventLoopError| PlayError::NoDisplay(reason(&e.to_string()));
        EventLoop::<Wake>::with_user_event().build().map(Self).map_err(reason)
    }

    /// Plays until the window is closed.
    ///
    /// # Errors
    /// When the window cannot be opened, the first frame cannot be made, or the screenshot cannot be written.
    pub(super) fn run(
        self,
        scene: Arc<Scene>,
        options: &PlayOptions,
        engine: impl Engine,
        load: LoadFile,
        stop: Stop,
    ) -> Result<(), PlayError> {
        let proxy = self.0.create_proxy();
        let wake = proxy.clone();
        // A loop that is gone needs no reports.
        let worker = Worker::start(engine, move |report| drop(wake.send_event(Wake::Report(report))))
            .map_err(|e| PlayError::Failed(format!("cannot start the render thread: {e}")))?;
        let context = Context::new(self.0.owned_display_handle()).map_err(|e| PlayError::NoDisplay(e.to_string()))?;
        let begun = Instant::now();
        let player = Player::new(0.0, scene, options);
        let mut app =
            App { player, worker, context, shown: None, begun, proxy, load, stop, result: Ok(()), is_visible: false };
        self.0.run_app(&mut app).map_err(|e| PlayError::Failed(e.to_string()))?;
        app.result
    }
}

/// The reason within winit's text, on one line and without the place in winit's source.
fn reason(text: &str) -> String {
    let after_place =
        text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": ")).map_or(text, |(_, rest)| rest);
    let words: Vec<_> = after_place.split_whitespace().collect();
    words.join(" ").trim_end_matches('.').to_owned()
}

type Screen = Surface<OwnedDisplayHandle, Rc<Window>>;

struct Shown {
    window: Rc<Window>,
    screen: Screen,
}

struct App {
    player: Player,
    worker: Worker,
    context: Context<OwnedDisplayHandle>,
    shown: Option<Shown>,
    begun: Instant,
    proxy: EventLoopProxy<Wake>,
    load: LoadFile,
    stop: Stop,
    result: Result<(), PlayError>,
    is_visible: bool,
}

impl App {
    fn now_s(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    fn open(&self, event_loop: &ActiveEventLoop) -> Result<Shown, String> {
        let (width, height) = self.player.size();
        let attributes = Window::default_attributes()
            .with_title(self.player.title())
            .with_inner_size(PhysicalSize::new(width, height))
            .with_visible(false);
        let window = Rc::new(event_loop.create_window(attributes).map_err(|e| e.to_string())?);
        let screen = Surface::new(&self.context, Rc::clone(&window)).map_err(|e| e.to_string())?;
        Ok(Shown { window, screen })
    }

    fn fail(&mut self, event_loop: &ActiveEventLoop, reason: String) {
        self.result = Err(PlayError::Failed(reason));
        event_loop.exit();
    }

    /// Does what the player asks for, posts its next job, and says when to look again.
    fn go_on(&mut self, event_loop: &ActiveEventLoop) {
        if (self.stop)() {
            event_loop.exit();
            return;
        }
        if self.worker.is_dead() {
            self.fail(event_loop, "the render thread panicked".to_owned());
            return;
        }
        let now_s = self.now_s();
        self.player.tick(now_s);
        while let Some(command) = self.player.next_command() {
            match command {
                Command::Still(job) => self.worker.post_still(job),
                Command::Open(file) => self.load_file(file),
                Command::Quit(Ok(())) => return event_loop.exit(),
                Command::Quit(Err(reason)) => return self.fail(event_loop, reason),
            }
        }
        if self.shown.is_some()
            && let Some(job) = self.player.next_job(now_s)
        {
            self.worker.post(job);
        }
        if self.player.take_redraw()
            && let Some(shown) = &self.shown
        {
            if !self.is_visible && self.player.has_picture() {
                self.reveal(event_loop);
            } else {
                shown.window.request_redraw();
            }
        }
        let poll = Instant::now() + STOP_POLL;
        let wake = self.player.wake_s(now_s).and_then(|s| Duration::try_from_secs_f64(s).ok());
        let wake = wake.and_then(|after| self.begun.checked_add(after)).map_or(poll, |at| at.min(poll));
        event_loop.set_control_flow(ControlFlow::WaitUntil(wake));
    }

    /// Shows the window with its first picture already drawn.
    fn reveal(&mut self, event_loop: &ActiveEventLoop) {
        self.redraw(event_loop);
        self.is_visible = true;
        if let Some(shown) = &self.shown {
            shown.window.set_visible(true);
            // What was drawn while the window was hidden may be lost.
            shown.window.request_redraw();
        }
    }

    fn redraw(&mut self, event_loop: &ActiveEventLoop) {
        let now_s = self.now_s();
        if let Some(shown) = &mut self.shown
            && let Err(reason) = present(&self.player, now_s, shown)
        {
            self.fail(event_loop, format!("cannot draw into the window: {reason}"));
        }
    }

    fn load_file(&self, file: PathBuf) {
        let (load, proxy) = (Arc::clone(&self.load), self.proxy.clone());
        let task = move || {
            let result = load(&file);
            // A loop that is gone needs no scene.
            drop(proxy.send_event(Wake::Opened(file, result)));
        };
        // The import runs beside everything else; if there is no thread for it the drop does nothing.
        if let Err(error) = std::thread::Builder::new().name("kinora-open".to_owned()).spawn(task) {
            tracing::warn!("cannot start a thread to open a file: {error}");
        }
    }
}

fn present(player: &Player, now_s: f64, shown: &mut Shown) -> Result<(), softbuffer::SoftBufferError> {
    let size = shown.window.inner_size();
    let (Some(width), Some(height)) = (NonZeroU32::new(size.width), NonZeroU32::new(size.height)) else {
        return Ok(());
    };
    shown.screen.resize(width, height)?;
    let mut pixels = shown.screen.buffer_mut()?;
    let mut canvas = Canvas::new(size.width as usize, size.height as usize, &mut pixels);
    player.draw(now_s, &mut canvas);
    shown.window.pre_present_notify();
    pixels.present()
}

impl ApplicationHandler<Wake> for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.shown.is_some() {
            return;
        }
        match self.open(event_loop) {
            Ok(shown) => {
                let size = shown.window.inner_size();
                self.shown = Some(shown);
                let now_s = self.now_s();
                self.player.opened_window(now_s, size.width, size.height);
            }
            Err(reason) => self.fail(event_loop, format!("cannot open a window: {reason}")),
        }
    }

    fn user_event(&mut self, _event_loop: &ActiveEventLoop, event: Wake) {
        let now_s = self.now_s();
        match event {
            Wake::Report(report) => {
                if let Some(rgba) = self.player.report(now_s, report) {
                    self.worker.recycle(rgba);
                }
            }
            Wake::Opened(file, result) => {
                self.player.opened(now_s, &file, result);
                if let Some(shown) = &self.shown {
                    shown.window.set_title(&self.player.title());
                }
            }
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _window: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => self.player.act(self.now_s(), super::input::Action::Quit),
            WindowEvent::RedrawRequested => self.redraw(event_loop),
            other => {
                if let Some(input) = translated(other) {
                    self.player.handle(self.now_s(), input);
                }
            }
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        self.go_on(event_loop);
    }
}

/// A window event in the player's words; `None` for those it does not care about.
fn translated(event: WindowEvent) -> Option<Input> {
    Some(match event {
        WindowEvent::Resized(size) => Input::Resized(size.width, size.height),
        WindowEvent::DroppedFile(file) => Input::Dropped(file),
        WindowEvent::ModifiersChanged(modifiers) => Input::Shift(modifiers.state().shift_key()),
        WindowEvent::CursorMoved { position, .. } => Input::Pointer { x: position.x, y: position.y },
        WindowEvent::MouseInput { state, button, .. } => Input::Button(pointer_button(button)?, state.is_pressed()),
        WindowEvent::MouseWheel { delta, .. } => Input::Wheel(match delta {
            MouseScrollDelta::LineDelta(_, lines) => f64::from(lines),
            MouseScrollDelta::PixelDelta(pixels) => pixels.y / NOTCH_PIXELS,
        }),
        WindowEvent::KeyboardInput { event, is_synthetic: false, .. } if event.state == ElementState::Pressed => {
            let key = pressed_key(&event.logical_key)?;
            // A key that is held down steps on, but does not switch things to and fro.
            if event.repeat && !key.repeats() {
                return None;
            }
            Input::Key(key)
        }
        _ => return None,
    })
}

fn pointer_button(button: MouseButton) -> Option<Button> {
    match button {
        MouseButton::Left => Some(Button::Left),
        MouseButton::Middle => Some(Button::Middle),
        MouseButton::Right => Some(Button::Right),
        _ => None,
    }
}

fn pressed_key(key: &WinitKey) -> Option<Key> {
    Some(match key {
        WinitKey::Named(NamedKey::Space) => Key::Space,
        WinitKey::Named(NamedKey::Escape) => Key::Escape,
        WinitKey::Named(NamedKey::Home) => Key::Home,
        WinitKey::Named(NamedKey::ArrowLeft) => Key::Left,
        WinitKey::Named(NamedKey::ArrowRight) => Key::Right,
        WinitKey::Named(NamedKey::F1) => Key::F1,
        WinitKey::Named(NamedKey::F12) => Key::F12,
        WinitKey::Character(text) => {
            let mut characters = text.chars();
            match (characters.next(), characters.next()) {
                (Some(' '), None) => Key::Space,
                (Some(character), None) => Key::Char(character.to_ascii_lowercase()),
                _ => return None,
            }
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reason_leaves_out_where_winit_noticed() {
        let text = "os error at /a/winit/src/linux/mod.rs:765: neither WAYLAND_DISPLAY\n nor DISPLAY is set.";
        assert_eq!(reason(text), "neither WAYLAND_DISPLAY nor DISPLAY is set");
        assert_eq!(reason("not supported"), "not supported");
    }
}
