//! The viewer's camera: orbit, pan, zoom and fly around a pivot, in the terms of `vtrace render`.

use glam::{DQuat, DVec3, Vec3};

use crate::{
    options::{CameraChoice, DEFAULT_FOV, ViewOptions},
    scene::View,
};

/// Steepest angle between the line of sight and the horizon, in degrees: straight up or down would roll.
const STEEPEST: f64 = 89.0;

/// A pixel of a drag turns by this many degrees.
const DEGREES_PER_PIXEL: f64 = 0.4;

/// A notch of the wheel multiplies the distance by this.
const ZOOM_PER_NOTCH: f64 = 0.9;

/// A step of flying, as a share of the distance to the pivot.
const FLY_STEP: f64 = 0.05;

/// Narrowest and widest field of view that the wheel reaches, in degrees.
const FIELDS_OF_VIEW: (f32, f32) = (1.0, 120.0);

/// A camera that circles around a pivot, +y up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orbit {
    /// Eye point in world coordinates.
    pub eye: DVec3,
    /// Pivot in world coordinates, at the centre of the image.
    pub target: DVec3,
    /// Vertical field of view in degrees.
    pub fov: f32,
}

impl Orbit {
    /// Takes over from `view` of a scene `size` across, whose coordinates are relative to the world point `origin`.
    ///
    /// The pivot is the point on the line of sight nearest to `focus`. A parallel view becomes a
    /// perspective one that shows the pivot at the same size; a rolled one turns upright.
    pub fn from_view(view: &View, focus: Vec3, size: f32, origin: DVec3) -> Self {
        let size = size.max(f32::MIN_POSITIVE);
        let along = (focus - view.eye).dot(view.forward);
        let along = if along > size * 1e-3 { along } else { size * 0.5 };
        let target = view.eye + view.forward * along;
        let (eye, fov) = if view.orthographic {
            let distance = view.half.y / (DEFAULT_FOV.to_radians() * 0.5).tan();
            (target - view.forward * distance, DEFAULT_FOV)
        } else {
            (view.eye, (view.half.y.atan() * 2.0).to_degrees())
        };
        let mut orbit = Self { eye: origin + eye.as_dvec3(), target: origin + target.as_dvec3(), fov };
        if view.forward.y.abs() > STEEPEST.to_radians().sin() as f32 {
            orbit.turn(0.0, 0.0); // not steeper than it may be
        }
        orbit
    }

    /// The same camera as `options` know it, for an image of their size.
    pub fn options(&self, options: &ViewOptions) -> ViewOptions {
        let camera = CameraChoice::Eye { eye: self.eye, target: Some(self.target) };
        ViewOptions { camera, fov: Some(self.fov), ..options.clone() }
    }

    /// Turns around the pivot as the scene follows a drag of `x` pixels to the right and `y` down.
    pub fn turn(&mut self, x: f64, y: f64) {
        self.eye = self.target + turned(self.eye - self.target, x * DEGREES_PER_PIXEL, y * DEGREES_PER_PIXEL);
    }

    /// Looks around as the scene follows a drag of `x` pixels to the right and `y` down in an image of `height` rows:
    /// the eye stays where it is, to the last bit.
    pub fn look(&mut self, x: f64, y: f64, height: u32) {
        let per_pixel = f64::from(self.fov) / f64::from(height.max(1));
        self.target = self.eye + turned(self.target - self.eye, -x * per_pixel, y * per_pixel);
    }

    /// Narrows the field of view by `notches` of the wheel, or widens it for less than 0.
    pub fn narrow(&mut self, notches: f64) {
        let (low, high) = FIELDS_OF_VIEW;
        let factor = ZOOM_PER_NOTCH.powf(notches.clamp(-50.0, 50.0));
        self.fov = ((f64::from(self.fov) * factor) as f32).clamp(low, high);
    }

    /// Moves eye and pivot so that the pivot follows a drag of `x` pixels to the right and `y` down in an image
    /// of `height` rows.
    pub fn pan(&mut self, x: f64, y: f64, height: u32) {
        let per_pixel =
            2.0 * self.distance() * (f64::from(self.fov).to_radians() * 0.5).tan() / f64::from(height);
        let (right, up, _) = self.axes();
        self.shift((up * y - right * x) * per_pixel);
    }

    /// Comes `notches` of the wheel closer to the pivot, or farther for less than 0.
    pub fn zoom(&mut self, notches: f64) {
        let factor = ZOOM_PER_NOTCH.powf(notches.clamp(-50.0, 50.0));
        let eye = self.target + (self.eye - self.target) * factor;
        // Neither onto the pivot nor out of range.
        if (1e-6..1e12).contains(&(eye - self.target).length()) {
            self.eye = eye;
        }
    }

    /// Flies `steps` to the right and ahead, the pivot with it.
    pub fn fly(&mut self, right_steps: f64, ahead_steps: f64) {
        let (right, _, ahead) = self.axes();
        self.shift((right * right_steps + ahead * ahead_steps) * (self.distance() * FLY_STEP));
    }

    fn shift(&mut self, by: DVec3) {
        self.eye += by;
        self.target += by;
    }

    fn distance(&self) -> f64 {
        (self.eye - self.target).length()
    }

    /// Unit vectors to the right, up and ahead.
    fn axes(&self) -> (DVec3, DVec3, DVec3) {
        let ahead = (self.target - self.eye).normalize_or(DVec3::NEG_Z);
        let right = ahead.cross(DVec3::Y).normalize_or(DVec3::X);
        (right, right.cross(ahead), ahead)
    }
}

/// `arm` turned clockwise, seen from above, and up by so many degrees, not steeper than [`STEEPEST`]; as long as before.
fn turned(arm: DVec3, clockwise: f64, up: f64) -> DVec3 {
    let length = arm.length();
    if length == 0.0 {
        return arm;
    }
    let heading = arm.x.atan2(arm.z) - clockwise.to_radians();
    let limit = STEEPEST.to_radians();
    let height = (arm.y / length).clamp(-1.0, 1.0).asin() + up.to_radians();
    let rotation = DQuat::from_rotation_y(heading) * DQuat::from_rotation_x(-height.clamp(-limit, limit));
    rotation * DVec3::Z * length
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::scene::{Camera, Projection};

    fn orbit() -> Orbit {
        Orbit { eye: DVec3::new(0.0, 0.0, 4.0), target: DVec3::ZERO, fov: 40.0 }
    }

    #[test]
    fn a_drag_to_the_right_carries_the_front_to_the_right() {
        let mut camera = orbit();
        camera.turn(90.0 / DEGREES_PER_PIXEL, 0.0);
        assert!((camera.eye - DVec3::new(-4.0, 0.0, 0.0)).length() < 1e-9, "{}", camera.eye);
        camera.turn(0.0, 30.0 / DEGREES_PER_PIXEL);
        assert!((camera.eye.y - 2.0).abs() < 1e-9, "a drag down looks from above: {}", camera.eye);
        assert!((camera.eye.length() - 4.0).abs() < 1e-9);
    }

    #[test]
    fn a_look_around_carries_the_scene_and_keeps_the_eye() {
        let mut camera = orbit();
        let eye = camera.eye;
        camera.look(10.0, -5.0, 100);
        assert_eq!(camera.eye, eye);
        assert!((camera.distance() - 4.0).abs() < 1e-9);
        let options = camera.options(&ViewOptions { width: 200, height: 100, ..ViewOptions::default() });
        let CameraChoice::Eye { target: Some(target), .. } = options.camera else { panic!("an eye") };
        let view = Camera::look_at(eye.as_vec3(), target.as_vec3(), 40.0_f32.to_radians());
        let bounds = (Vec3::splat(-1.0), Vec3::splat(1.0));
        let (pixel, _) = View::new(&view, 200, 100, bounds).project(Vec3::ZERO).unwrap();
        assert!((pixel - glam::Vec2::new(110.0, 45.0)).length() < 1.5, "{pixel}");
        camera.narrow(100.0);
        assert_eq!(camera.fov, FIELDS_OF_VIEW.0);
        camera.narrow(-100.0);
        assert_eq!((camera.fov, camera.eye), (FIELDS_OF_VIEW.1, eye));
    }

    #[test]
    fn no_turn_reaches_the_poles() {
        let mut camera = orbit();
        for _ in 0..10 {
            camera.turn(1.0, 200.0);
        }
        let height = (camera.eye.y / camera.eye.length()).asin().to_degrees();
        assert!((height - STEEPEST).abs() < 1e-6, "{height}");
        // The renderer's own camera still has +y up there.
        let ahead = (-camera.eye).normalize();
        assert!(ahead.y.abs() < 0.9999);
    }

    #[test]
    fn the_pivot_follows_a_pan() {
        let mut camera = orbit();
        let options = ViewOptions { width: 200, height: 100, ..ViewOptions::default() };
        let bounds = (Vec3::splat(-1.0), Vec3::splat(1.0));
        camera.pan(10.0, -5.0, options.height);
        let eye = Camera::look_at(camera.eye.as_vec3(), camera.target.as_vec3(), 40.0_f32.to_radians());
        let (pixel, _) = View::new(&eye, 200, 100, bounds).project(Vec3::ZERO).unwrap();
        assert!((pixel - glam::Vec2::new(110.0, 45.0)).length() < 1e-3, "{pixel}");
    }

    #[test]
    fn zooming_never_passes_the_pivot() {
        let mut camera = orbit();
        for _ in 0..100 {
            camera.zoom(50.0);
        }
        assert!(camera.distance() >= 1e-6 && camera.eye.z > 0.0);
        camera.eye = DVec3::new(0.0, 0.0, 4.0);
        camera.zoom(1.0);
        assert!((camera.eye.z - 3.6).abs() < 1e-12);
    }

    #[test]
    fn taking_over_keeps_the_view() {
        let camera = Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.2, 0.0, 0.0), 0.6);
        let bounds = (Vec3::splat(-1.0), Vec3::splat(1.0));
        let view = View::new(&camera, 320, 200, bounds);
        let orbit = Orbit::from_view(&view, Vec3::ZERO, 3.0, DVec3::new(1e6, 0.0, 0.0));
        let ahead = (orbit.target - orbit.eye).normalize().as_vec3();
        assert!((ahead - view.forward).length() < 1e-5 && (orbit.fov.to_radians() - 0.6).abs() < 1e-5);
        assert!((orbit.eye - DVec3::new(1e6 + 1.0, 2.0, 3.0)).length() < 1e-5);
    }

    #[test]
    fn a_parallel_view_keeps_the_size_of_what_it_shows() {
        let camera = Camera {
            projection: Projection::Orthographic { xmag: 2.0, ymag: 1.5 },
            ..Camera::look_at(Vec3::new(0.0, 0.0, 50.0), Vec3::ZERO, 1.0)
        };
        let bounds = (Vec3::splat(-1.0), Vec3::splat(1.0));
        let orbit = Orbit::from_view(&View::new(&camera, 100, 100, bounds), Vec3::ZERO, 3.0, DVec3::ZERO);
        let half = orbit.distance() * (f64::from(orbit.fov).to_radians() * 0.5).tan();
        assert!((half - 1.5).abs() < 1e-5, "{half}");
    }
}
