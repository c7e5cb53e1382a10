//! The keys: one table for what they do, the help on the screen, and `--help`.

/// A key, whatever the window system calls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    /// A key that types a character, lower case unless shifted.
    Char(char),
    /// Escape.
    Escape,
    /// Arrow to the left.
    Left,
    /// Arrow to the right.
    Right,
    /// Arrow up.
    Up,
    /// Arrow down.
    Down,
}

/// What a key asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// End the program.
    Quit,
    /// Show or hide the list of keys.
    Help,
    /// Show or hide the figures.
    Overlay,
    /// The next mode: multi-pass or multi-texture.
    Mode,
    /// The next of the paper's equations.
    Equation,
    /// The next reconstruction.
    Reconstruction,
    /// The next way to find visible faces.
    Visibility,
    /// The next choice of shadows.
    Shadows,
    /// One specular bounce more.
    Deeper,
    /// One specular bounce less.
    Shallower,
    /// Multisampling on or off.
    Msaa,
    /// The next number of shaded samples.
    Supersampling,
    /// The next texture filter.
    Filter,
    /// Schlick's approximation for metals on or off.
    Fresnel,
    /// The next picture of the method's data.
    Show,
    /// Back to the image.
    Image,
    /// The next camera of the file.
    Camera,
    /// A camera that frames the scene.
    Frame,
    /// Fly to the left.
    FlyLeft,
    /// Fly to the right.
    FlyRight,
    /// Fly ahead.
    FlyAhead,
    /// Fly back.
    FlyBack,
    /// The reference tracer beside the image.
    Split,
    /// The next light, for dragging.
    Light,
    /// Lights back to where the file has them.
    ResetLights,
    /// Forget the path that a click drew.
    ForgetPath,
    /// Write what the window shows to a file.
    Screenshot,
    /// Print the view as a command line.
    Print,
    /// Read the scene file again.
    Reload,
}

/// Every key with what it does.
pub const KEYS: &[(Key, Action, &str)] = &[
    (Key::Char('?'), Action::Help, "this list"),
    (Key::Char('q'), Action::Quit, "quit; Escape too"),
    (Key::Escape, Action::Quit, ""),
    (Key::Char('o'), Action::Overlay, "figures on or off"),
    (Key::Char('m'), Action::Mode, "multi-texture, multi-pass"),
    (Key::Char('e'), Action::Equation, "equation 3, 4"),
    (Key::Char('r'), Action::Reconstruction, "reconstruction exact, paper"),
    (Key::Char('v'), Action::Visibility, "way to find visible faces"),
    (Key::Char('h'), Action::Shadows, "shadows all, vt, none"),
    (Key::Char('+'), Action::Deeper, "one specular bounce more"),
    (Key::Char('='), Action::Deeper, ""),
    (Key::Char('-'), Action::Shallower, "one specular bounce less"),
    (Key::Char('a'), Action::Msaa, "multisampling 1, 4"),
    (Key::Char('x'), Action::Supersampling, "supersampling 1, 4, 16"),
    (Key::Char('f'), Action::Filter, "texture filter"),
    (Key::Char('g'), Action::Fresnel, "Fresnel of metals on or off"),
    (Key::Char('d'), Action::Show, "data: faces, samples, error, depth, ids, mask"),
    (Key::Char('i'), Action::Image, "back to the image"),
    (Key::Char('t'), Action::Split, "reference tracer beside it; drag the divider"),
    (Key::Char('k'), Action::Camera, "next camera of the file"),
    (Key::Char('b'), Action::Frame, "frame the scene"),
    (Key::Left, Action::FlyLeft, "fly left; other arrows: right, ahead, back"),
    (Key::Right, Action::FlyRight, ""),
    (Key::Up, Action::FlyAhead, ""),
    (Key::Down, Action::FlyBack, ""),
    (Key::Char('l'), Action::Light, "next light, for Ctrl-drag"),
    (Key::Char('L'), Action::ResetLights, "lights as in the file"),
    (Key::Char('n'), Action::ForgetPath, "forget the path of a click"),
    (Key::Char('p'), Action::Screenshot, "write what is seen to vtrace-N.png"),
    (Key::Char('c'), Action::Print, "print the view as a vtrace render line"),
    (Key::Char('u'), Action::Reload, "read the scene again"),
];

/// What the mouse does.
const MOUSE: [(&str, &str); 7] = [
    ("drag", "orbit"),
    ("right drag", "pan; Shift-drag too"),
    ("mid drag", "look around; Shift-right drag too"),
    ("wheel", "zoom; with Ctrl the field of view"),
    ("click", "specular path behind the pixel"),
    ("Ctrl-drag", "move the light"),
    ("drop", "a .glb or .gltf file: show it"),
];

impl Key {
    /// The key called `name`: a character, or `escape`, `left`, `right`, `up`, `down`.
    pub fn named(name: &str) -> Option<Self> {
        let mut chars = name.chars();
        match (chars.next(), chars.next(), name) {
            (Some(char), None, _) => Some(Self::Char(char)),
            (.., "escape") => Some(Self::Escape),
            (.., "left") => Some(Self::Left),
            (.., "right") => Some(Self::Right),
            (.., "up") => Some(Self::Up),
            (.., "down") => Some(Self::Down),
            _ => None,
        }
    }

    /// What it does, if anything.
    pub fn action(self) -> Option<Action> {
        KEYS.iter().find(|(key, ..)| *key == self).map(|&(_, action, _)| action)
    }

    fn label(self) -> String {
        match self {
            Self::Char(char) => char.into(),
            Self::Escape => "Esc".into(),
            Self::Left => "arrows".into(),
            Self::Right | Self::Up | Self::Down => String::new(),
        }
    }
}

/// The list of keys and of what the mouse does, one line each.
pub fn help() -> Vec<String> {
    let keys = KEYS.iter().filter(|(.., help)| !help.is_empty());
    let keys = keys.map(|&(key, _, help)| (key.label(), help));
    let mouse = MOUSE.iter().map(|&(what, help)| (what.to_owned(), help));
    mouse.chain(keys).map(|(what, help)| format!("{what:<10} {help}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_does_one_thing_and_every_action_is_explained() {
        for (at, (key, action, _)) in KEYS.iter().enumerate() {
            assert!(KEYS[..at].iter().all(|(other, ..)| other != key), "{key:?} is listed twice");
            let explained = KEYS.iter().any(|(_, other, help)| other == action && !help.is_empty());
            let arrow = matches!(key, Key::Right | Key::Up | Key::Down);
            assert!(explained || arrow, "{action:?} has no help");
        }
        assert!(help().iter().all(|line| line.is_ascii() && line.len() < 60), "fits into a small window");
    }

    #[test]
    fn names() {
        assert_eq!(Key::named("m").and_then(Key::action), Some(Action::Mode));
        assert_eq!(Key::named("escape").and_then(Key::action), Some(Action::Quit));
        assert_eq!(Key::named("L"), Some(Key::Char('L')));
        assert_eq!((Key::named("escapes"), Key::named("")), (None, None));
        assert_eq!(Key::Char('Q').action(), None);
    }
}
