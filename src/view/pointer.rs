//! The mouse: drags that turn, pan, and move the light or the divider, and clicks.

use super::viewer::{Button, Viewer};
use crate::scene::View;

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
                    // The pointer moves over pixels of the window; a moving picture may have fewer.
                    let (width, height) = self.size;
                    let view = View { width, height, ..picture.view };
                    self.asked.drag_light(&facts.lights, &view, dx as f32, dy as f32);
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

#[cfg(test)]
mod tests {
    use std::{sync::Arc, time::Duration};

    use glam::{DVec3, Vec2, Vec3};

    use super::*;
    use crate::{
        options::{Options, ViewOptions},
        scene::{Light, LightKind, demo::Demo},
        view::{
            Request,
            exchange::{Facts, Picture, Pixels, Update},
            viewer::Input,
        },
    };

    #[test]
    fn a_light_keeps_to_the_pointer_while_the_picture_is_coarse() {
        let scene = Demo::Cup.scene();
        let options = Options::default();
        let size = (options.view.width, options.view.height);
        let view = options.view.resolve(&scene).unwrap();
        let (width, height) = (size.0 / 4, size.1 / 4);
        let coarse = ViewOptions { width, height, ..options.view.clone() }.resolve(&scene).unwrap();
        let light = Light {
            name: "lamp".into(),
            kind: LightKind::Point { position: view.eye + view.forward * 3.0, range: f32::INFINITY },
            intensity: Vec3::ONE,
        };
        let request = Request {
            scene: "cup.glb".into(),
            options,
            budget: Duration::from_millis(33),
            coarse: None,
            exposure: 0.0,
            script: None,
        };
        let mut viewer = Viewer::new(&request, Arc::default());
        let facts = Facts {
            bounds: scene.bounds(),
            focus: Vec3::ZERO,
            origin: DVec3::ZERO,
            cameras: Vec::new(),
            lights: vec![light],
            beside: Vec::new(),
        };
        let picture = Picture {
            serial: 1,
            pixels: Pixels::default(),
            view: coarse,
            progress: (0, 0, 0.0),
            stats: None,
            complete: false,
        };
        for update in [Update::Scene(Box::new(facts)), Update::Picture(Box::new(picture))] {
            viewer.update(update).unwrap();
        }
        let (x, y) = (f64::from(size.0) / 2.0, f64::from(size.1) / 2.0);
        for input in [
            Input::Pointer(x, y),
            Input::Held { shift: false, ctrl: true },
            Input::Press(Button::Left),
            Input::Pointer(x + 60.0, y - 20.0),
        ] {
            viewer.input(input);
        }
        let LightKind::Point { position, .. } = viewer.asked.lights.as_ref().unwrap()[0].kind else {
            panic!()
        };
        let (pixel, _) = view.project(position).unwrap();
        let pointer = Vec2::new(viewer.pointer.0 as f32, viewer.pointer.1 as f32);
        assert!((pixel - pointer).length() < 0.01, "the light is at {pixel}, the pointer at {pointer}");
    }
}
