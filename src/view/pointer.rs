//! The mouse: drags that turn, pan, and move the light or the divider, and clicks.

use super::viewer::{Button, Viewer};

/// A press that moves less than this many pixels is a click.
pub const CLICK: f64 = 4.0;

/// The divider is taken hold of within this many pixels.
const GRIP: f64 = 6.0;

/// What a held button does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drag {
    /// Turns the camera; a click, unless it moves.
    Turn,
    /// Pans the camera.
    Pan,
    /// Looks around from where the camera is.
    Look,
    /// Moves a light.
    Light,
    /// Moves the divider between picture and reference.
    Divider,
}

impl Viewer {
    /// A button goes down: what a drag from here does.
    pub(super) fn press(&mut self, button: Button) {
        let (shift, ctrl) = self.held;
        let divider = self.split.map(|share| share * f64::from(self.size.0));
        let drag = match button {
            Button::Left if divider.is_some_and(|at| (at - self.pointer.0).abs() <= GRIP) => Drag::Divider,
            Button::Left if ctrl => Drag::Light,
            Button::Left if !shift => Drag::Turn,
            Button::Right if shift => Drag::Look,
            Button::Left | Button::Right => Drag::Pan,
            Button::Middle => Drag::Look,
        };
        self.pressed = Some((drag, self.pointer));
    }

    /// The button goes up: a drag ends, or was a click.
    pub(super) fn release(&mut self) {
        let Some((drag, from)) = self.pressed.take() else { return };
        let moved = (from.0 - self.pointer.0).hypot(from.1 - self.pointer.1);
        let (x, y) = self.pointer;
        let inside = x >= 0.0 && y >= 0.0 && x < self.size.0.into() && y < self.size.1.into();
        if drag == Drag::Turn && moved < CLICK && inside {
            self.want(Some((x as u32, y as u32)));
        }
    }

    /// The pointer moves to column `x` and row `y`.
    pub(super) fn point(&mut self, x: f64, y: f64) {
        let before = std::mem::replace(&mut self.pointer, (x, y));
        let Some((drag, from)) = self.pressed else { return };
        let (dx, dy) = (x - before.0, y - before.1);
        match drag {
            Drag::Turn => {
                // A click that trembles turns nothing; what it trembled is made up for.
                let was = (from.0 - before.0).hypot(from.1 - before.1) >= CLICK;
                let is = (from.0 - x).hypot(from.1 - y) >= CLICK;
                if is || was {
                    let (dx, dy) = if was { (dx, dy) } else { (x - from.0, y - from.1) };
                    self.pressed = Some((Drag::Turn, (f64::INFINITY, f64::INFINITY)));
                    self.fly(|orbit, _| orbit.turn(dx, dy));
                }
            }
            Drag::Pan => self.fly(|orbit, height| orbit.pan(dx, dy, height)),
            Drag::Look => self.fly(|orbit, height| orbit.look(dx, dy, height)),
            Drag::Light => {
                if let (Some(facts), Some(picture)) = (&self.facts, &self.picture) {
                    self.asked.drag_light(&facts.lights, &picture.view, dx as f32, dy as f32);
                    self.reference = None;
                    self.moves();
                }
            }
            Drag::Divider => {
                self.split = Some((x / f64::from(self.size.0)).clamp(0.0, 1.0));
                self.stale = true;
            }
        }
    }
}
