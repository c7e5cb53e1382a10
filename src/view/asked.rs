//! What the user asked for so far: the options, changed by keys, and the lights.

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::keys::Action;
use crate::{
    options::{CameraChoice, Choice, Msaa, Options, Ss},
    scene::{Camera, Light, LightKind, View},
};

/// Most specular bounces that a key asks for.
const DEEPEST: u32 = 255;

/// A pixel of a drag turns a light without a position by this many radians.
const RADIANS_PER_PIXEL: f32 = 0.01;

/// The options in force, and the lights where they were moved.
pub struct Asked {
    /// What `vtrace render` would be told, its image size that of the window.
    pub options: Options,
    /// All lights, once one of them was moved.
    pub lights: Option<Arc<[Light]>>,
    /// The light that a drag moves.
    pub light: usize,
}

impl Asked {
    /// Takes a key's action into the options; false if it does not concern them.
    pub fn apply(&mut self, action: Action, cameras: &[Camera]) -> bool {
        match action {
            Action::Mode => self.cycle(|o| &mut o.method.mode),
            Action::Equation => self.cycle(|o| &mut o.method.equation),
            Action::Reconstruction => self.cycle(|o| &mut o.method.reconstruction),
            Action::Visibility => self.cycle(|o| &mut o.method.visibility),
            Action::Shadows => self.cycle(|o| &mut o.scene.shadows),
            Action::Msaa => self.cycle::<Msaa>(|o| &mut o.method.msaa),
            Action::Supersampling => self.cycle::<Ss>(|o| &mut o.method.ss),
            Action::Filter => self.cycle(|o| &mut o.method.filter),
            Action::Fresnel => self.options.scene.fresnel ^= true,
            Action::Deeper => self.options.paths.depth = (self.options.paths.depth + 1).min(DEEPEST),
            Action::Shallower => self.options.paths.depth = self.options.paths.depth.saturating_sub(1),
            Action::Show => self.options.show = next_or_none(self.options.show),
            Action::Image => self.options.show = None,
            Action::Camera => self.next_camera(cameras),
            Action::ResetLights => self.lights = None,
            _ => return false,
        }
        true
    }

    /// The next value of an option that goes together with the others.
    fn cycle<T: Choice>(&mut self, field: impl Fn(&mut Options) -> &mut T) {
        for _ in T::ALL {
            let value = field(&mut self.options);
            *value = next(*value);
            if self.options.check().is_ok() {
                return;
            }
        }
    }

    fn next_camera(&mut self, cameras: &[Camera]) {
        if cameras.is_empty() {
            return;
        }
        let now = match &self.options.view.camera {
            CameraChoice::First => Some(0),
            CameraChoice::Named(name) => {
                let named = cameras.iter().position(|camera| camera.name == *name);
                named.or_else(|| name.parse().ok())
            }
            CameraChoice::Eye { .. } => None,
        };
        let index = now.map_or(0, |now| (now + 1) % cameras.len());
        // By index where another camera before it has the same name, or where the name is a number.
        let name = &cameras[index].name;
        let found = cameras.iter().position(|camera| camera.name == *name);
        let name = if found == Some(index) { name.clone() } else { index.to_string() };
        self.options.view.camera = CameraChoice::Named(name);
        self.options.view.fov = None;
    }

    /// Moves the light as a drag of `x` pixels to the right and `y` down in `view` does; `lights` are the file's.
    pub fn drag_light(&mut self, lights: &[Light], view: &View, x: f32, y: f32) {
        let mut moved = self.lights.as_deref().unwrap_or(lights).to_vec();
        let index = self.light.min(moved.len().saturating_sub(1));
        let Some(light) = moved.get_mut(index) else { return };
        match &mut light.kind {
            LightKind::Point { position, .. } | LightKind::Spot { position, .. } => {
                let depth = (*position - view.eye).dot(view.forward).abs();
                let scale = if view.orthographic { 1.0 } else { depth };
                let per_pixel = 2.0 * view.half.y * scale / view.height as f32;
                *position += (view.right * x - view.up * y) * per_pixel;
            }
            LightKind::Directional { direction } => {
                let turn = Quat::from_axis_angle(view.up, x * RADIANS_PER_PIXEL)
                    * Quat::from_axis_angle(view.right, y * RADIANS_PER_PIXEL);
                *direction = (turn * *direction).normalize_or(Vec3::NEG_Y);
            }
        }
        self.lights = Some(moved.into());
    }
}

fn next<T: Choice>(value: T) -> T {
    let at = T::ALL.iter().position(|(other, ..)| *other == value).map_or(0, |at| (at + 1) % T::ALL.len());
    T::ALL[at].0
}

/// `None`, then every value, then `None` again.
fn next_or_none<T: Choice>(value: Option<T>) -> Option<T> {
    let at =
        value.map_or(0, |value| T::ALL.iter().position(|(other, ..)| *other == value).map_or(0, |at| at + 1));
    T::ALL.get(at).map(|&(value, ..)| value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{Mode, Show, ViewOptions, VisibilityWay};

    fn asked() -> Asked {
        Asked { options: Options::default(), lights: None, light: 0 }
    }

    #[test]
    fn keys_go_through_all_values_and_back() {
        let mut asked = asked();
        assert!(asked.apply(Action::Mode, &[]) && asked.options.method.mode == Mode::MultiPass);
        asked.apply(Action::Mode, &[]);
        assert_eq!(asked.options, Options::default());
        for _ in Show::ALL {
            asked.apply(Action::Show, &[]);
            assert!(asked.options.show.is_some());
        }
        asked.apply(Action::Show, &[]);
        assert_eq!(asked.options.show, None);
        assert!(!asked.apply(Action::Quit, &[]));
    }

    #[test]
    fn combinations_that_do_not_go_together_are_passed_over() {
        let mut asked = asked();
        asked.apply(Action::Msaa, &[]);
        for _ in VisibilityWay::ALL {
            asked.apply(Action::Visibility, &[]);
            assert!(asked.options.check().is_ok());
        }
        asked.options.method.msaa = Msaa::One;
        asked.options.method.visibility = VisibilityWay::SinglePass;
        asked.apply(Action::Msaa, &[]);
        assert_eq!(asked.options.method.msaa, Msaa::One);
    }

    #[test]
    fn cameras_of_one_name_are_told_apart() {
        let camera = |name: &str| Camera { name: name.into(), ..Camera::look_at(Vec3::ZERO, Vec3::Z, 1.0) };
        let cameras = [camera("a"), camera("b"), camera("b")];
        let mut asked = asked();
        let names = [(); 4].map(|()| {
            asked.apply(Action::Camera, &cameras);
            match &asked.options.view.camera {
                CameraChoice::Named(name) => name.clone(),
                other => format!("{other:?}"),
            }
        });
        assert_eq!(names, ["b", "2", "a", "b"]);
    }

    #[test]
    fn a_light_follows_the_pointer() {
        let scene = crate::scene::demo::Demo::Cup.scene();
        let view = ViewOptions::default().resolve(&scene).unwrap();
        let light = Light {
            name: "lamp".into(),
            kind: LightKind::Point { position: view.eye + view.forward * 3.0, range: f32::INFINITY },
            intensity: Vec3::ONE,
        };
        let mut asked = asked();
        asked.drag_light(&[light], &view, 20.0, 10.0);
        let LightKind::Point { position, .. } = asked.lights.as_ref().unwrap()[0].kind else { panic!() };
        let (pixel, _) = view.project(position).unwrap();
        let centre = glam::Vec2::new(640.0, 512.0);
        assert!((pixel - centre - glam::Vec2::new(20.0, 10.0)).length() < 0.01, "{pixel}");
    }
}
