//! Cameras of the file, and the [`View`] of one frame: pixels to rays and points to pixels.

use glam::{DVec3, Mat3, Mat4, Vec2, Vec3, Vec4};

/// The near plane's share of the distance to the scene's farthest corner. Reversed depth in floating point is as
/// fine at any distance, so that nothing asks for more.
const NEAR: f32 = 1e-10;

/// A camera, in world space relative to [`Scene::origin`](super::Scene::origin).
#[derive(Debug, Clone)]
pub struct Camera {
    /// Its name, or `camera 3`.
    pub name: String,
    /// Eye point.
    pub position: Vec3,
    /// Unit vector to the right of the image.
    pub right: Vec3,
    /// Unit vector to the top of the image.
    pub up: Vec3,
    /// Unit vector into the image.
    pub forward: Vec3,
    /// Field of view or extent.
    pub projection: Projection,
}

/// How a camera maps directions to the image plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Central projection.
    Perspective {
        /// Vertical field of view in radians, in (0, π).
        yfov: f32,
    },
    /// Parallel projection.
    Orthographic {
        /// Half the width of the image in world units.
        xmag: f32,
        /// Half the height of the image in world units.
        ymag: f32,
    },
}

impl Camera {
    /// A perspective camera at `eye` that looks at `target` with +y up (or -z, where it looks along y).
    pub fn look_at(eye: Vec3, target: Vec3, yfov: f32) -> Self {
        let forward = (target - eye).normalize_or(Vec3::NEG_Z);
        let pole = if forward.y.abs() > 0.9999 { Vec3::NEG_Z } else { Vec3::Y };
        let right = forward.cross(pole).normalize();
        Self {
            name: "eye".into(),
            position: eye,
            right,
            up: right.cross(forward),
            forward,
            projection: Projection::Perspective { yfov },
        }
    }

    /// A camera from the front and slightly above, from which the box `low`–`high` fills the image.
    pub fn framing(low: Vec3, high: Vec3, aspect: f32) -> Self {
        const YFOV: f32 = 0.7;
        const MARGIN: f32 = 1.06;
        let centre = (low + high) * 0.5;
        let towards = Vec3::new(0.0, 0.18, 1.0).normalize();
        let camera = Self::look_at(centre + towards, centre, YFOV);
        let half = (YFOV * 0.5).tan() / MARGIN;
        // The nearest distance at which every corner of the box is inside the image.
        let distance = (0..8)
            .map(|corner| {
                let side = |axis: u32| if corner >> axis & 1 == 0 { -0.5 } else { 0.5 };
                let from_centre = (high - low) * Vec3::new(side(0), side(1), side(2));
                let across =
                    (from_centre.dot(camera.right) / aspect).abs().max(from_centre.dot(camera.up).abs());
                across / half - from_centre.dot(camera.forward)
            })
            .fold(f32::MIN_POSITIVE, f32::max);
        Self { name: "framing".into(), position: centre + towards * distance, ..camera }
    }
}

/// One frame's camera and image size, resolved.
///
/// Pixel coordinates run from (0, 0) at the top left corner of the image to (width, height); the centre
/// of the first pixel is (0.5, 0.5).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Eye point, relative to the scene's origin.
    pub eye: Vec3,
    /// Unit vector to the right of the image.
    pub right: Vec3,
    /// Unit vector to the top of the image.
    pub up: Vec3,
    /// Unit vector into the image.
    pub forward: Vec3,
    /// Half the image plane's size: at distance 1 for a perspective view, in world units for a parallel one.
    pub half: Vec2,
    /// Whether rays are parallel.
    pub orthographic: bool,
    /// Distance of the near plane that the rasteriser clips at.
    pub near: f32,
    /// Distance of the far plane: infinite for a perspective view.
    pub far: f32,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
}

impl View {
    /// The view of `camera` on a `width` × `height` image of a scene inside the box `bounds`.
    ///
    /// The vertical field of view is kept whatever the image's aspect is; a parallel projection keeps ymag.
    pub fn new(camera: &Camera, width: u32, height: u32, bounds: (Vec3, Vec3)) -> Self {
        let aspect = width as f32 / height as f32;
        let (half, orthographic) = match camera.projection {
            Projection::Perspective { yfov } => {
                let tan = (yfov * 0.5).tan();
                (Vec2::new(tan * aspect, tan), false)
            }
            Projection::Orthographic { ymag, .. } => (Vec2::new(ymag * aspect, ymag), true),
        };
        let reach = (bounds.0 - camera.position).abs().max((bounds.1 - camera.position).abs()).length();
        let reach = if reach > 0.0 { reach } else { 1.0 };
        Self {
            eye: camera.position,
            right: camera.right,
            up: camera.up,
            forward: camera.forward,
            half,
            orthographic,
            near: reach * NEAR,
            far: if orthographic { reach * 1.01 } else { f32::INFINITY },
            width,
            height,
        }
    }

    /// Origin and unit direction of the ray through the image point `pixel`.
    #[inline]
    pub fn ray(&self, pixel: Vec2) -> (Vec3, Vec3) {
        let x = (2.0 * pixel.x / self.width as f32 - 1.0) * self.half.x;
        let y = (1.0 - 2.0 * pixel.y / self.height as f32) * self.half.y;
        if self.orthographic {
            (self.eye + self.right * x + self.up * y, self.forward)
        } else {
            (self.eye, (self.forward + self.right * x + self.up * y).normalize())
        }
    }

    /// The point at `depth` before the eye, along the view's axis, that is seen at the image point `pixel`.
    pub fn at_depth(&self, pixel: Vec2, depth: f32) -> Vec3 {
        let (origin, direction) = self.ray(pixel);
        origin + direction * (depth / direction.dot(self.forward))
    }

    /// Unit direction of the view ray that arrives at `point`.
    pub fn direction_to(&self, point: Vec3) -> Vec3 {
        if self.orthographic { self.forward } else { (point - self.eye).normalize_or(self.forward) }
    }

    /// Distance along the view ray that arrives at `point`, from the eye (or the image plane's parallel).
    pub fn distance_to(&self, point: Vec3) -> f32 {
        if self.orthographic { (point - self.eye).dot(self.forward) } else { (point - self.eye).length() }
    }

    /// Image point and distance along `forward` of `point`; `None` behind the near plane.
    pub fn project(&self, point: Vec3) -> Option<(Vec2, f32)> {
        let to = point - self.eye;
        let depth = to.dot(self.forward);
        if depth < self.near {
            return None;
        }
        Some((self.pixel(Vec2::new(to.dot(self.right), to.dot(self.up)), depth), depth))
    }

    /// The pixel of a point that is `offset` right of and above the view's axis, and `depth` along it from the eye.
    fn pixel(&self, offset: Vec2, depth: f32) -> Vec2 {
        let ndc = offset / (self.half * if self.orthographic { 1.0 } else { depth });
        let size = Vec2::new(self.width as f32, self.height as f32);
        Vec2::new(ndc.x + 1.0, 1.0 - ndc.y) * 0.5 * size
    }

    /// The image point of `point` times its depth along `forward`, and that depth, which may be any number: homogeneous
    /// coordinates, of which an orthographic view has depth 1.
    pub fn homogeneous(&self, point: Vec3) -> Vec3 {
        let to = point - self.eye;
        let depth = if self.orthographic { 1.0 } else { to.dot(self.forward) };
        let ndc = Vec2::new(to.dot(self.right), to.dot(self.up)) / self.half;
        let size = Vec2::new(self.width as f32, self.height as f32);
        (Vec2::new(depth + ndc.x, depth - ndc.y) * 0.5 * size).extend(depth)
    }

    /// Where the line from `from` to `to` goes through the near plane, in pixels; `None` if both are on one side of it.
    pub fn cut(&self, from: Vec3, to: Vec3) -> Option<Vec2> {
        let before = |point: Vec3| (point - self.eye).dot(self.forward) - self.near;
        let (start, end) = (before(from), before(to));
        if (start < 0.0) == (end < 0.0) {
            return None;
        }
        let to = from + (to - from) * (start / (start - end)) - self.eye;
        Some(self.pixel(Vec2::new(to.dot(self.right), to.dot(self.up)), self.near))
    }

    /// Clip coordinates of a point given *relative to the eye*: Vulkan's y down, reversed depth (1 near, 0 far).
    pub fn clip_from_eye_relative(&self) -> Mat4 {
        let view = Mat4::from_mat3(Mat3::from_cols(self.right, -self.up, self.forward).transpose());
        let (x, y) = (self.half.x.recip(), self.half.y.recip());
        let projection = if self.orthographic {
            let range = self.far - self.near;
            Mat4::from_cols(
                Vec4::new(x, 0.0, 0.0, 0.0),
                Vec4::new(0.0, y, 0.0, 0.0),
                Vec4::new(0.0, 0.0, -1.0 / range, 0.0),
                Vec4::new(0.0, 0.0, self.far / range, 1.0),
            )
        } else {
            // Infinite reversed depth: z_clip = near, w = distance along forward.
            Mat4::from_cols(
                Vec4::new(x, 0.0, 0.0, 0.0),
                Vec4::new(0.0, y, 0.0, 0.0),
                Vec4::new(0.0, 0.0, 0.0, 1.0),
                Vec4::new(0.0, 0.0, self.near, 0.0),
            )
        };
        projection * view
    }

    /// What the depth image holds of a point at `depth` before the eye, along the view's axis.
    pub fn depth_value(&self, depth: f32) -> f32 {
        match self.orthographic {
            true => (self.far - depth) / (self.far - self.near),
            false => self.near / depth,
        }
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// World position minus scene origin, rounded once.
pub fn relative(world: DVec3, origin: DVec3) -> Vec3 {
    (world - origin).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view() -> View {
        let camera = Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, 0.5, -1.0), 0.6);
        View::new(&camera, 640, 480, (Vec3::splat(-5.0), Vec3::splat(5.0)))
    }

    #[test]
    fn project_inverts_ray() {
        let view = view();
        for pixel in
            [Vec2::new(0.5, 0.5), Vec2::new(639.5, 0.5), Vec2::new(320.0, 240.0), Vec2::new(10.0, 470.0)]
        {
            let (origin, direction) = view.ray(pixel);
            let (back, _) = view.project(origin + direction * 3.7).unwrap();
            assert!((back - pixel).length() < 2e-3, "{pixel} came back as {back}");
        }
    }

    #[test]
    fn hand_computed_projection() {
        // 90° vertical field of view, looking down -z from the origin, 200 × 100 pixels: the point
        // (1, 0.5, -2) lies at ndc (0.25, 0.25).
        let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, std::f32::consts::FRAC_PI_2);
        let view = View::new(&camera, 200, 100, (Vec3::splat(-5.0), Vec3::splat(5.0)));
        let (pixel, depth) = view.project(Vec3::new(1.0, 0.5, -2.0)).unwrap();
        assert!((pixel - Vec2::new(125.0, 37.5)).length() < 1e-4, "{pixel}");
        assert!((depth - 2.0).abs() < 1e-6);
        let clip = view.clip_from_eye_relative() * Vec4::new(1.0, 0.5, -2.0, 1.0);
        assert!((clip.x / clip.w - 0.25).abs() < 1e-6 && (clip.y / clip.w + 0.25).abs() < 1e-6, "{clip}");
        assert!((clip.z / clip.w - view.near / 2.0).abs() < 1e-9);
        assert!((clip.z / clip.w - view.depth_value(2.0)).abs() < 1e-9);
    }

    #[test]
    fn parallel_rays() {
        let camera = Camera {
            projection: Projection::Orthographic { xmag: 2.0, ymag: 1.0 },
            ..Camera::look_at(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, 1.0)
        };
        let view = View::new(&camera, 200, 100, (Vec3::splat(-1.0), Vec3::splat(1.0)));
        let (origin, direction) = view.ray(Vec2::new(0.0, 0.0));
        assert!((origin - Vec3::new(-2.0, 1.0, 4.0)).length() < 1e-6 && direction == Vec3::NEG_Z);
        let clip = view.clip_from_eye_relative() * Vec4::new(0.0, 0.0, -4.0, 1.0);
        assert!(clip.z > 0.0 && clip.z < 1.0 && clip.w == 1.0);
        assert!((clip.z - view.depth_value(4.0)).abs() < 1e-6, "{clip}");
    }
}
