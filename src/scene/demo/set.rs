//! What demo scenes are furnished with: a closed room, its lamps, a picture frame.

use glam::{Vec2, Vec3};

use super::shape::{cuboid, plane};
use super::{MaterialId, Mesh, SceneBuilder, matte};
use crate::scene::Material;

/// A closed box to stage a scene in; all faces look inward, so that no ray leaves the scene.
#[derive(Debug, Clone, Copy)]
pub struct Room {
    /// Lower corner: left, floor, back wall.
    pub low: Vec3,
    /// Upper corner: right, ceiling, front wall (behind the camera).
    pub high: Vec3,
}

impl Room {
    /// The floor; the texture's corner lies in the room's left front corner.
    pub fn floor(self, tile: f32) -> Mesh {
        let size = self.high - self.low;
        plane(Vec3::new(self.low.x, self.low.y, self.high.z), Vec3::X * size.x, Vec3::NEG_Z * size.z, tile)
            .snapped(self.low, self.high)
    }

    /// The wall that the camera sees.
    pub fn back(self, tile: f32) -> Mesh {
        let size = self.high - self.low;
        plane(self.low, Vec3::X * size.x, Vec3::Y * size.y, tile).snapped(self.low, self.high)
    }

    /// The left, right and front walls.
    pub fn sides(self, tile: f32) -> Mesh {
        let Self { low, high } = self;
        let size = high - low;
        let up = Vec3::Y * size.y;
        plane(Vec3::new(low.x, low.y, high.z), Vec3::NEG_Z * size.z, up, tile)
            .merged(&plane(Vec3::new(high.x, low.y, low.z), Vec3::Z * size.z, up, tile))
            .merged(&plane(Vec3::new(high.x, low.y, high.z), Vec3::NEG_X * size.x, up, tile))
            .snapped(low, high)
    }

    /// The ceiling.
    pub fn ceiling(self) -> Mesh {
        let size = self.high - self.low;
        plane(Vec3::new(self.low.x, self.high.y, self.low.z), Vec3::X * size.x, Vec3::Z * size.z, 1.0)
            .snapped(self.low, self.high)
    }

    /// Puts floor, walls and ceiling into `scene`; a texture covers `floor.1`, `back.1` or `sides.1` units.
    pub fn furnish(
        self,
        scene: &mut SceneBuilder,
        floor: (MaterialId, f32),
        back: (MaterialId, f32),
        sides: (MaterialId, f32),
    ) {
        let ceiling = scene.material(matte("ceiling").colored(Vec3::splat(0.75)));
        scene
            .mesh("floor", self.floor(floor.1), floor.0)
            .mesh("back wall", self.back(back.1), back.0)
            .mesh("side walls", self.sides(sides.1), sides.0)
            .mesh("ceiling", self.ceiling(), ceiling);
    }
}

/// A glowing panel with a point light under it.
///
/// Perfectly smooth surfaces show no highlight of a point light; they show the panel instead.
/// `centre` is the panel's, `size` its width (x) and depth (z), `intensity` the point light's in candela.
pub fn lamp(scene: &mut SceneBuilder, name: &str, centre: Vec3, size: (f32, f32), intensity: Vec3) {
    let glow = intensity / intensity.max_element() * 6.0;
    let panel =
        scene.material(Material { emissive: glow, ..matte(format!("{name} panel")).colored(Vec3::ZERO) });
    let corner = centre - Vec3::new(size.0, 0.0, size.1) * 0.5;
    scene.mesh(format!("{name} panel"), plane(corner, Vec3::X * size.0, Vec3::Z * size.1, 1.0), panel);
    scene.point_light(centre - Vec3::Y * 0.05, intensity);
}

/// A picture frame of four bars about the rectangle (`width`, `height`) in the plane z = 0, its lower
/// left corner at the origin; the bars reach from `-thickness` to `thickness` in z.
pub fn frame(width: f32, height: f32, bar: f32, thickness: f32) -> Mesh {
    let beam = |low: Vec2, high: Vec2| cuboid(low.extend(-thickness), high.extend(thickness), 1.0);
    // The upright bars stand between the others: bars touch, they do not overlap.
    beam(Vec2::new(-bar, -bar), Vec2::new(width + bar, 0.0))
        .merged(&beam(Vec2::new(-bar, height), Vec2::new(width + bar, height + bar)))
        .merged(&beam(Vec2::new(-bar, 0.0), Vec2::new(0.0, height)))
        .merged(&beam(Vec2::new(width, 0.0), Vec2::new(width + bar, height)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rooms_and_frames_are_closed() {
        let room = Room { low: Vec3::new(-0.7, 0.1, -1.3), high: Vec3::new(1.1, 2.3, 0.9) };
        let shell = room.floor(1.0).merged(&room.back(1.0)).merged(&room.sides(1.0)).merged(&room.ceiling());
        assert!(shell.is_closed());
        assert!((shell.volume() + 1.8 * 2.2 * 2.2).abs() < 1e-5, "it looks inward: {}", shell.volume());
        let bars = frame(2.0, 1.0, 0.1, 0.05);
        assert!(bars.is_closed());
        assert!((bars.volume() - (2.2 * 1.2 - 2.0) * 0.1).abs() < 1e-5, "{}", bars.volume());
    }
}
