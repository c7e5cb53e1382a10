//! The viewer itself, free of any window: input and updates in, wishes and pictures out.

use std::{
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant},
};

use super::{
    Request,
    asked::Asked,
    camera::Orbit,
    command::render_line,
    exchange::{Facts, Mailbox, Picture, Pixels, Update, Wanted},
    inspect::Path as SpecularPath,
    keys::{Action, Key},
    output,
    pointer::Drag,
    timing::Timing,
    watch::Watch,
};
use crate::{
    error::{Error, Result},
    options::CameraChoice,
    scene::{Camera, Light, View},
};

/// The camera rests once it has not moved for this long.
const REST: Duration = Duration::from_millis(150);

/// What a user does.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// A key is pressed.
    Key(Key),
    /// A mouse button is pressed.
    Press(Button),
    /// The mouse button is let go.
    Release,
    /// The pointer is at this column and row.
    Pointer(f64, f64),
    /// The wheel turns by this many notches, up is positive.
    Wheel(f64),
    /// Whether Shift and Ctrl are held.
    Held {
        /// Shift.
        shift: bool,
        /// Control.
        ctrl: bool,
    },
    /// A file is dropped on the window.
    Drop(PathBuf),
    /// The window has this many columns and rows.
    Resized(u32, u32),
    /// The window is closed.
    Close,
}

/// A mouse button.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Button {
    /// The left one.
    Left,
    /// The one in the middle, or the wheel.
    Middle,
    /// Any other.
    Right,
}

/// A scene as it is looked at.
struct Opened {
    source: (PathBuf, u32),
    view: (CameraChoice, Option<f32>),
    lights: Option<Arc<[Light]>>,
    orbit: Option<Orbit>,
    watch: Watch,
}

/// Everything that the viewer knows.
pub struct Viewer {
    pub(super) asked: Asked,
    pub(super) source: (PathBuf, u32),
    pub(super) budget: Duration,
    coarse: Option<u32>,
    exposure: f32,
    mailbox: Arc<Mailbox>,
    pub(super) facts: Option<Box<Facts>>,
    pub(super) picture: Option<Box<Picture>>,
    pub(super) reference: Option<Pixels>,
    pub(super) path: Option<SpecularPath>,
    pub(super) problem: Option<String>,
    pub(super) timing: Timing,
    /// Column of the divider as a share of the width, if the reference is shown.
    pub(super) split: Option<f64>,
    pub(super) overlay: bool,
    pub(super) help: bool,
    pub(super) size: (u32, u32),
    orbit: Option<Orbit>,
    /// What was shown when a scene was asked for that is not there yet.
    left: Option<Opened>,
    serial: u64,
    /// When the camera comes to rest.
    rests: Option<Instant>,
    pub(super) pointer: (f64, f64),
    pub(super) pressed: Option<(Drag, (f64, f64))>,
    pub(super) held: (bool, bool),
    watch: Watch,
    /// Whether the window shows an older state.
    pub(super) stale: bool,
    quit: bool,
}

impl Viewer {
    /// The viewer of what `request` asks for.
    pub fn new(request: &Request, mailbox: Arc<Mailbox>) -> Self {
        let mut viewer = Self {
            asked: Asked { options: request.options.clone(), lights: None, light: 0 },
            source: (request.scene.clone(), 0),
            budget: request.budget,
            coarse: request.coarse,
            exposure: request.exposure,
            mailbox,
            facts: None,
            picture: None,
            reference: None,
            path: None,
            problem: None,
            timing: Timing::default(),
            split: None,
            overlay: true,
            help: false,
            size: (request.options.view.width, request.options.view.height),
            orbit: None,
            left: None,
            serial: 0,
            rests: None,
            pointer: (0.0, 0.0),
            pressed: None,
            held: (false, false),
            watch: Watch::new(&request.scene, Instant::now()),
            stale: true,
            quit: false,
        };
        viewer.want(None);
        viewer
    }

    /// Whether the user wants to leave.
    pub fn quits(&self) -> bool {
        self.quit
    }

    /// Whether the window's size is drawn completely and the camera rests.
    pub fn complete(&self) -> bool {
        let reference = self.split.is_none() || self.reference.is_some();
        self.rests.is_none()
            && reference
            && self.up_to_date()
            && self.picture.as_ref().is_some_and(|p| p.complete)
    }

    /// Whether what was wanted last is drawn, if only as a preview, or cannot be had.
    pub fn up_to_date(&self) -> bool {
        self.problem.is_some() || self.picture.as_ref().is_some_and(|picture| picture.serial == self.serial)
    }

    /// Takes in what a user did.
    pub fn input(&mut self, input: Input) {
        match input {
            Input::Key(key) => {
                if let Some(action) = key.action() {
                    self.act(action);
                }
            }
            Input::Press(button) => self.press(button),
            Input::Release => self.release(),
            Input::Pointer(x, y) => self.point(x, y),
            Input::Wheel(notches) if self.held.1 => self.fly(|orbit, _| orbit.narrow(notches)),
            Input::Wheel(notches) => self.fly(|orbit, _| orbit.zoom(notches)),
            Input::Held { shift, ctrl } => self.held = (shift, ctrl),
            Input::Drop(file) => self.open(file),
            Input::Resized(width, height) => {
                // A minimised window has no pixels; what it showed is kept for its return.
                if width > 0 && height > 0 && (width, height) != self.size {
                    self.size = (width, height);
                    (self.asked.options.view.width, self.asked.options.view.height) = self.size;
                    self.want(None);
                }
            }
            Input::Close => self.quit = true,
        }
    }

    /// Takes in what the render thread has done.
    ///
    /// # Errors
    /// What ends the program.
    pub fn update(&mut self, update: Update) -> Result<()> {
        match update {
            Update::Scene(facts) => {
                self.left = None;
                self.watch.beside(&facts.beside);
                self.facts = Some(facts);
            }
            // A coarse picture that was overtaken.
            Update::Picture(picture) if self.picture.as_ref().is_some_and(|p| p.serial > picture.serial) => {}
            Update::Picture(picture) => {
                self.problem = None;
                if self.picture.as_ref().is_none_or(|before| before.view != picture.view) {
                    self.reference = None;
                }
                self.picture = Some(picture);
            }
            Update::Reference(pixels) => self.reference = Some(pixels),
            Update::Path(path) => {
                output::tell(&path.lines().join("\n"));
                self.path = Some(path);
            }
            Update::Problem(error) if self.picture.is_none() => return Err(error),
            Update::Problem(error) => {
                self.stay();
                output::complain(&error);
                self.problem = Some(error.to_string());
            }
        }
        self.stale = true;
        Ok(())
    }

    /// The window shows the newest state since `now`.
    pub fn shown(&mut self, now: Instant) {
        self.stale = false;
        if self.rests.is_some() && self.up_to_date() {
            self.timing.shown(now);
        } else if self.complete() {
            self.timing.completed(now);
        }
    }

    /// Does what is due at `now`; returns when to call again.
    pub fn tick(&mut self, now: Instant) -> Instant {
        if self.rests.is_some_and(|rests| rests <= now) {
            self.rests = None;
            self.want(None);
        }
        let (changed, poll) = self.watch.look(now);
        if changed {
            self.reload();
        }
        self.rests.map_or(poll, |rests| rests.min(poll))
    }

    /// The view as a command line; what it cannot say is noted after it.
    pub fn command_line(&self) -> String {
        let line = render_line(&self.source.0, &self.asked.options, self.exposure);
        let moved = if self.asked.lights.is_some() { "  # but for the lights that were moved" } else { "" };
        format!("{line}{moved}")
    }

    fn act(&mut self, action: Action) {
        self.stale = true;
        match action {
            Action::Quit => self.quit = true,
            Action::Help => self.help ^= true,
            Action::Overlay => self.overlay ^= true,
            Action::Split => {
                self.split = if self.split.is_some() { None } else { Some(0.5) };
                self.want(None);
            }
            Action::Frame => {
                if let Some(facts) = &self.facts {
                    let aspect = self.size.0 as f32 / self.size.1 as f32;
                    let camera = Camera::framing(facts.bounds.0, facts.bounds.1, aspect);
                    let view = View::new(&camera, self.size.0, self.size.1, facts.bounds);
                    self.orbit = Some(facts.orbit(&view));
                    self.fly(|_, _| {});
                }
            }
            Action::FlyLeft => self.fly(|orbit, _| orbit.fly(-1.0, 0.0)),
            Action::FlyRight => self.fly(|orbit, _| orbit.fly(1.0, 0.0)),
            Action::FlyAhead => self.fly(|orbit, _| orbit.fly(0.0, 1.0)),
            Action::FlyBack => self.fly(|orbit, _| orbit.fly(0.0, -1.0)),
            Action::Light => {
                let lights = self.facts.as_ref().map_or(0, |facts| facts.lights.len());
                self.asked.light = (self.asked.light + 1) % lights.max(1);
            }
            Action::ForgetPath => self.path = None,
            Action::Screenshot => {
                let written = output::next_screenshot().and_then(|file| {
                    output::write_screenshot(&file, &self.compose())?;
                    Ok(file)
                });
                match written {
                    Ok(file) => output::tell(&format!("wrote    {}", file.display())),
                    Err(error) => self.complain(&error),
                }
            }
            Action::Print => output::tell(&self.command_line()),
            Action::Reload => self.reload(),
            other => {
                let cameras = self.facts.as_ref().map_or(&[][..], |facts| &facts.cameras);
                if self.asked.apply(other, cameras) {
                    if other == Action::Camera {
                        self.orbit = None;
                    }
                    self.reference = None;
                    self.want(None);
                }
            }
        }
    }

    fn complain(&mut self, error: &Error) {
        output::complain(error);
        self.problem = Some(error.to_string());
    }

    /// Moves the camera; the height of the image is told along.
    pub(super) fn fly(&mut self, change: impl FnOnce(&mut Orbit, u32)) {
        let (Some(facts), Some(picture)) = (&self.facts, &self.picture) else { return };
        let mut orbit = self.orbit.unwrap_or_else(|| facts.orbit(&picture.view));
        change(&mut orbit, self.size.1);
        self.orbit = Some(orbit);
        self.asked.options.view = orbit.options(&self.asked.options.view);
        self.moves();
    }

    pub(super) fn moves(&mut self) {
        let now = Instant::now();
        self.timing.moved(now);
        self.rests = Some(now + REST);
        self.want(None);
    }

    fn open(&mut self, file: PathBuf) {
        let view = &self.asked.options.view;
        self.left.get_or_insert_with(|| Opened {
            source: self.source.clone(),
            view: (view.camera.clone(), view.fov),
            lights: self.asked.lights.clone(),
            orbit: self.orbit,
            watch: self.watch.clone(),
        });
        self.watch = Watch::new(&file, Instant::now());
        self.source = (file, 0);
        self.orbit = None;
        self.path = None;
        (self.asked.options.view.camera, self.asked.options.view.fov) = (CameraChoice::First, None);
        self.asked.lights = None;
        self.reference = None;
        self.want(None);
    }

    fn reload(&mut self) {
        self.source.1 += 1;
        self.path = None;
        self.asked.lights = None;
        self.reference = None;
        self.want(None);
    }

    /// Goes back to the scene that is shown, where another was asked for in vain.
    fn stay(&mut self) {
        if let Some(Opened { source, view, lights, orbit, watch }) = self.left.take() {
            (self.source, self.watch) = (source, watch);
            (self.asked.options.view.camera, self.asked.options.view.fov) = view;
            (self.asked.lights, self.orbit) = (lights, orbit);
        }
    }

    /// Asks the render thread for what is asked for now, and for the path behind `pixel`.
    pub(super) fn want(&mut self, pixel: Option<(u32, u32)>) {
        self.serial += 1;
        self.problem = None;
        self.mailbox.post(Wanted {
            serial: self.serial,
            source: self.source.clone(),
            options: self.asked.options.clone(),
            lights: self.asked.lights.clone(),
            moving: self.rests.is_some(),
            budget: self.budget,
            coarse: self.coarse,
            exposure: self.exposure,
            reference: self.split.is_some(),
            pixel,
        });
    }
}

impl Facts {
    /// The camera that takes over from `view`.
    fn orbit(&self, view: &View) -> Orbit {
        Orbit::from_view(view, self.focus, (self.bounds.1 - self.bounds.0).length(), self.origin)
    }
}
