//! Image size and camera as asked for, and the [`View`] that they mean for a scene.

use glam::DVec3;
use serde::Serialize;

use crate::{
    error::{Error, Result},
    scene::{Camera, Projection, Scene, View, camera::relative},
};

/// Vertical field of view of a camera given by `--eye`, in degrees, unless `--fov` says otherwise.
pub const DEFAULT_FOV: f32 = 40.0;

/// Image size and camera.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewOptions {
    /// Image width in pixels, at least 1.
    pub width: u32,
    /// Image height in pixels, at least 1.
    pub height: u32,
    /// Where the picture is taken from.
    pub camera: CameraChoice,
    /// Vertical field of view in degrees, in (0, 180); `None` keeps the camera's.
    pub fov: Option<f32>,
}

/// Which camera takes the picture.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CameraChoice {
    /// The first camera of the file, or one that frames the scene where the file has none.
    #[default]
    First,
    /// A camera of the file by its name, else by its index from 0.
    Named(String),
    /// A perspective camera in world coordinates.
    Eye {
        /// Eye point.
        eye: DVec3,
        /// Point at the centre of the image; the centre of the scene's bounding box if `None`.
        target: Option<DVec3>,
    },
}

impl Default for ViewOptions {
    fn default() -> Self {
        Self { width: 1280, height: 1024, camera: CameraChoice::First, fov: None }
    }
}

const NOTHING_TO_LOOK_AT: &str = "--eye and --target are the same point: nothing to look at";

impl ViewOptions {
    /// Checks what needs no scene to be known.
    ///
    /// # Errors
    /// What is wrong, in terms of the command line.
    pub fn check(&self) -> Result<(), String> {
        if self.width == 0 || self.height == 0 {
            return Err(format!("--size {}x{}: a picture has pixels", self.width, self.height));
        }
        if let Some(fov) = self.fov.filter(|fov| !(*fov > 0.0 && *fov < 180.0)) {
            return Err(format!("--fov {fov}: not between 0 and 180 degrees"));
        }
        match self.camera {
            CameraChoice::Eye { eye, target }
                if !eye.is_finite() || target.is_some_and(|it| !it.is_finite()) =>
            {
                Err("--eye and --target are points of finite numbers".into())
            }
            CameraChoice::Eye { eye, target: Some(target) } if eye == target => {
                Err(NOTHING_TO_LOOK_AT.into())
            }
            _ => Ok(()),
        }
    }

    /// The view of `scene` that these options mean.
    ///
    /// # Errors
    /// [`Error::Option`] for what [`check`](Self::check) finds, if the scene has no such camera, if the eye lies on its
    /// target, or if a field of view is asked of a parallel projection.
    pub fn resolve(&self, scene: &Scene) -> Result<View> {
        self.check().map_err(Error::Option)?;
        let bounds = scene.bounds();
        let mut camera = match &self.camera {
            CameraChoice::First => scene.cameras.first().cloned().unwrap_or_else(|| {
                Camera::framing(bounds.0, bounds.1, self.width as f32 / self.height as f32)
            }),
            CameraChoice::Named(name) => find(&scene.cameras, name)?.clone(),
            &CameraChoice::Eye { eye, target } => {
                let eye = relative(eye, scene.origin);
                let target =
                    target.map_or((bounds.0 + bounds.1) * 0.5, |point| relative(point, scene.origin));
                if eye == target {
                    // Points that differ may be one when rounded, far from the scene.
                    return Err(Error::Option(NOTHING_TO_LOOK_AT.into()));
                }
                Camera::look_at(eye, target, DEFAULT_FOV.to_radians())
            }
        };
        if let Some(fov) = self.fov {
            let Projection::Perspective { yfov } = &mut camera.projection else {
                return Err(Error::Option(format!(
                    "--fov: camera {:?} is orthographic and has no field of view",
                    camera.name
                )));
            };
            *yfov = fov.to_radians();
        }
        Ok(View::new(&camera, self.width, self.height, bounds))
    }
}

fn find<'a>(cameras: &'a [Camera], name: &str) -> Result<&'a Camera> {
    let by_index = || name.parse().ok().and_then(|index: usize| cameras.get(index));
    cameras.iter().find(|camera| camera.name == name).or_else(by_index).ok_or_else(|| {
        let known: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
        Error::Option(match known.as_slice() {
            [] => format!(
                "--camera {name}: the file has no camera; leave the option out or give --eye and --target"
            ),
            known => format!("--camera {name}: no such camera; the file has {}", known.join(", ")),
        })
    })
}
