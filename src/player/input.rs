//! What keys and the pointer mean, without naming a window type.

use std::path::PathBuf;

/// A key that the player listens to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Key {
    /// A key that types this character; letters in lower case.
    Char(char),
    /// The space bar.
    Space,
    /// Escape.
    Escape,
    /// Home.
    Home,
    /// Left arrow.
    Left,
    /// Right arrow.
    Right,
    /// F1.
    F1,
    /// F12.
    F12,
}

/// A button of the pointer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Button {
    /// Left.
    Left,
    /// Middle.
    Middle,
    /// Right.
    Right,
}

/// What the window reports. Places are in pixels from the window's top left.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Input {
    /// A key went down (or repeats).
    Key(Key),
    /// Shift went down or up.
    Shift(bool),
    /// The pointer moved.
    Pointer {
        /// To the right.
        x: f64,
        /// Down.
        y: f64,
    },
    /// A button went down or up.
    Button(Button, bool),
    /// The wheel turned; positive away from the user.
    Wheel(f64),
    /// The window has another size in pixels.
    Resized(u32, u32),
    /// A file was dropped on the window.
    Dropped(PathBuf),
}

/// What a key does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    /// Pause or go on.
    TogglePause,
    /// Pause and step this many frames of 1/30 s.
    Step(i32),
    /// Next speed of the ladder, up or down.
    ChangeSpeed(i32),
    /// Play the other way.
    Reverse,
    /// Speed 1.
    NormalSpeed,
    /// To the clip's start.
    Rewind,
    /// Next clip, then all together, then none.
    NextClips,
    /// Next shading.
    NextShading,
    /// Next acceleration structure.
    NextStructure,
    /// Next camera of the file, then the free camera.
    NextCamera,
    /// Frame the whole animation.
    FrameAll,
    /// Write a picture to a file.
    Screenshot,
    /// Show or hide figures and scrub bar.
    ToggleOverlay,
    /// Show or hide the keys.
    ToggleHelp,
    /// Close the help, else the window.
    Back,
    /// Close the window.
    Quit,
}

impl Key {
    /// True when holding the key down does its action again and again.
    pub(super) fn repeats(self) -> bool {
        matches!(self.action(), Some(Action::Step(_) | Action::ChangeSpeed(_)))
    }

    /// What the key does; `None` for keys without a meaning.
    pub(super) fn action(self) -> Option<Action> {
        Some(match self {
            Self::Space => Action::TogglePause,
            Self::Char(',') | Self::Left => Action::Step(-1),
            Self::Char('.') | Self::Right => Action::Step(1),
            Self::Char('[') => Action::ChangeSpeed(-1),
            Self::Char(']') => Action::ChangeSpeed(1),
            Self::Char('r') => Action::Reverse,
            Self::Char('1') => Action::NormalSpeed,
            Self::Char('0') => Action::Rewind,
            Self::Char('n') => Action::NextClips,
            Self::Char('s') => Action::NextShading,
            Self::Char('a') => Action::NextStructure,
            Self::Char('c') => Action::NextCamera,
            Self::Char('f') | Self::Home => Action::FrameAll,
            Self::Char('p') | Self::F12 => Action::Screenshot,
            Self::Char('o') => Action::ToggleOverlay,
            Self::Char('h' | '?') | Self::F1 => Action::ToggleHelp,
            Self::Escape => Action::Back,
            Self::Char('q') => Action::Quit,
            Self::Char(_) => return None,
        })
    }
}

/// The controls as the help shows them: what to press, what it does.
pub(super) const HELP: [(&str, &str); 19] = [
    ("left drag", "turn"),
    ("right or Shift drag", "pan"),
    ("wheel", "zoom"),
    ("F or Home", "frame the whole animation"),
    ("C", "next camera of the file, then free"),
    ("Space", "pause, go on"),
    (", and .  or arrows", "step one frame of 1/30 s"),
    ("bar at the bottom", "click or drag to a time"),
    ("[ and ]", "slower, faster, down to backwards"),
    ("R", "reverse"),
    ("1", "normal speed"),
    ("0", "back to the start"),
    ("N", "next animation, all, none"),
    ("S", "next shading"),
    ("A", "next acceleration structure"),
    ("P or F12", "write a picture (PNG)"),
    ("O", "figures on or off"),
    ("H, ? or F1", "this help on or off"),
    ("Q or Esc", "quit; drop a file to open it"),
];

/// What a drag that began with `button` does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Drag {
    /// Turns the camera.
    Turn,
    /// Moves the camera sideways.
    Pan,
    /// Moves along the scrub bar.
    Scrub,
}

impl Drag {
    /// The drag that a button begins, on or off the scrub bar.
    pub(super) fn begin(button: Button, shift: bool, on_bar: bool) -> Self {
        match (button, on_bar) {
            (Button::Left, true) => Self::Scrub,
            (Button::Left, false) if !shift => Self::Turn,
            _ => Self::Pan,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every key there is a meaning for.
    fn bound_keys() -> impl Iterator<Item = (Key, Action)> {
        let named = [Key::Space, Key::Escape, Key::Home, Key::Left, Key::Right, Key::F1, Key::F12];
        let typed = (' '..='~').map(Key::Char);
        named.into_iter().chain(typed).filter_map(|k| k.action().map(|a| (k, a)))
    }

    #[test]
    fn help_names_every_bound_key() {
        for (key, action) in bound_keys() {
            let shown = match key {
                Key::Char(c) => c.to_ascii_uppercase().to_string(),
                Key::Space => "Space".to_owned(),
                Key::Escape => "Esc".to_owned(),
                Key::Home => "Home".to_owned(),
                Key::Left | Key::Right => "arrows".to_owned(),
                Key::F1 => "F1".to_owned(),
                Key::F12 => "F12".to_owned(),
            };
            let named =
                HELP.iter().any(|(keys, _)| keys.split(' ').any(|k| k.trim_end_matches(',') == shown || k == shown));
            assert!(named, "{key:?} ({action:?}) is not in the help");
        }
    }

    #[test]
    fn every_letter_in_the_help_is_bound() {
        let bound: Vec<_> = bound_keys().map(|(k, _)| k).collect();
        for (keys, _) in HELP {
            for word in keys.split(' ').map(|w| if w.len() > 1 { w.trim_end_matches(',') } else { w }) {
                let [c] = word.chars().collect::<Vec<_>>()[..] else { continue };
                assert!(bound.contains(&Key::Char(c.to_ascii_lowercase())), "{c} of `{keys}` does nothing");
            }
        }
    }

    #[test]
    fn shift_or_another_button_pans_and_the_bar_scrubs() {
        assert_eq!(Drag::begin(Button::Left, false, false), Drag::Turn);
        assert_eq!(Drag::begin(Button::Left, true, false), Drag::Pan);
        assert_eq!(Drag::begin(Button::Right, false, true), Drag::Pan);
        assert_eq!(Drag::begin(Button::Left, true, true), Drag::Scrub);
    }
}
