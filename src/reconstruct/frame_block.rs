//! The uniform block of a frame: view and lights, as glsl/frame.glsl reads them.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};

use crate::constants::{LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SPOT, MAX_LIGHTS};
use crate::scene::frustum::Frustum;
use crate::scene::{Light, LightKind, Scene, View};

/// glsl/frame.glsl `Light`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LightBlock {
    /// Of a point or spot light.
    pub position: Vec3,
    /// Distance at which the falloff window ends.
    pub range: f32,
    /// Unit, the way that a directional or spot light travels.
    pub direction: Vec3,
    /// `LIGHT_…`.
    pub kind: u32,
    /// Colour × intensity.
    pub intensity: Vec3,
    /// Cosine of a cone's rim.
    pub outer_cos: f32,
    /// 1 / (inner − outer cosine).
    pub cone_scale: f32,
    /// Fills the last 16 bytes.
    pub pad: [u32; 3],
}

/// glsl/frame.glsl `Frame`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct FrameBlock {
    /// Clip coordinates of positions relative to the eye.
    pub clip_from_eye_relative: Mat4,
    /// Eye point.
    pub eye: Vec3,
    /// Unit vector into the image.
    pub forward: Vec3,
    /// Whether rays are parallel.
    pub orthographic: u32,
    /// Ambient radiance as a factor of base colour.
    pub ambient: f32,
    /// The lights.
    pub lights: [LightBlock; MAX_LIGHTS as usize],
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// How often a pixel's side is halved: it is `1 << halvings` fragments across and high.
    pub halvings: u32,
    /// Fills the last 16 bytes, to which the matrix aligns.
    pub pad: u32,
}

impl FrameBlock {
    /// What of the scene is in view.
    pub fn frustum(&self) -> Frustum {
        Frustum::new(&self.clip_from_eye_relative, self.eye)
    }

    /// The block of `scene` seen in `view`.
    pub fn new(scene: &Scene, view: &View) -> Self {
        let mut lights = [LightBlock::zeroed(); MAX_LIGHTS as usize];
        for (block, light) in lights.iter_mut().zip(&scene.lights) {
            *block = LightBlock::new(light);
        }
        Self {
            clip_from_eye_relative: view.clip_from_eye_relative(),
            eye: view.eye,
            forward: view.forward,
            orthographic: u32::from(view.orthographic),
            ambient: scene.ambient,
            lights,
            width: view.width,
            height: view.height,
            halvings: 0,
            pad: 0,
        }
    }

    /// The block with its image moved by a part of a pixel: for samples other than pixel centres.
    pub fn jittered(mut self, x: f32, y: f32) -> Self {
        let shift = Vec3::new(2.0 * x / self.width as f32, 2.0 * y / self.height as f32, 0.0);
        self.clip_from_eye_relative = Mat4::from_translation(shift) * self.clip_from_eye_relative;
        self
    }
}

impl LightBlock {
    fn new(light: &Light) -> Self {
        let mut block = Self { intensity: light.intensity, range: f32::INFINITY, ..Self::zeroed() };
        match light.kind {
            LightKind::Point { position, range } => {
                block.kind = LIGHT_POINT;
                block.position = position;
                block.range = range;
            }
            LightKind::Directional { direction } => {
                block.kind = LIGHT_DIRECTIONAL;
                block.direction = direction;
            }
            LightKind::Spot { position, direction, range, inner_cos, outer_cos } => {
                block.kind = LIGHT_SPOT;
                block.position = position;
                block.direction = direction;
                block.range = range;
                block.outer_cos = outer_cos;
                block.cone_scale = 1.0 / (inner_cos - outer_cos).max(1e-3);
            }
        }
        block
    }
}
