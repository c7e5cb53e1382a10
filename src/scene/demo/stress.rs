//! Scenes whose size is an argument, for tests and measurements of how stages scale.

use glam::{Vec2, Vec3};

use super::set::Room;
use super::shape::{plane, sphere, waves};
use super::{SceneBuilder, chrome, matte, texture};
use crate::error::Result;
use crate::scene::{Camera, Scene};

/// One textured square of edge 2 in the plane z = 0, facing +z, lit from the eye at (0, 0, 3).
///
/// # Errors
/// As for [`SceneBuilder::build`].
pub fn quad() -> Result<Scene> {
    let mut scene = SceneBuilder::new("quad");
    let board = scene.texture(texture::chessboard(256));
    let board = scene.material(matte("chessboard").textured(board));
    scene.mesh("quad", plane(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0, 2.0), board);
    scene.point_light(Vec3::Z * 3.0, Vec3::splat(20.0));
    scene.camera(Camera::look_at(Vec3::Z * 3.0, Vec3::ZERO, 0.8));
    scene.build()
}

/// A wavy mirror of at least `faces` specular faces (two a cell) as the floor of a room of panels.
///
/// # Errors
/// As for [`SceneBuilder::build`].
pub fn wavy_mirror(faces: u32) -> Result<Scene> {
    let mut scene = SceneBuilder::new("wavy mirror");
    let room = Room { low: Vec3::new(-4.0, -0.5, -4.0), high: Vec3::new(4.0, 5.0, 5.0) };
    furnish(&mut scene, room);
    let silver = scene.material(chrome("silver", Vec3::splat(0.9)));
    let cells = (f64::from(faces) / 2.0).sqrt().ceil() as u32;
    scene.mesh("waves", waves(6.0, cells, 0.05, 4.0), silver);
    scene.camera(Camera::look_at(Vec3::new(0.0, 2.0, 4.5), Vec3::ZERO, 0.8));
    scene.build()
}

/// `balls` mirror spheres of 320 faces in a square array over a chessboard, in a closed room: all rays
/// bounce often.
///
/// # Errors
/// As for [`SceneBuilder::build`].
pub fn mirror_ball_room(balls: u32) -> Result<Scene> {
    let mut scene = SceneBuilder::new("mirror ball room");
    let side = f64::from(balls).sqrt().ceil().max(1.0) as u32;
    let half = side as f32 * 0.5;
    let room = Room {
        low: Vec3::new(-half - 1.0, 0.0, -half - 1.0),
        high: Vec3::new(half + 1.0, half + 3.0, half + 4.0),
    };
    furnish(&mut scene, room);
    let silver = scene.material(chrome("silver", Vec3::splat(0.85)));
    for ball in 0..balls {
        let at = Vec2::new((ball % side) as f32, (ball / side) as f32) + 0.5 - half;
        scene.mesh(format!("ball {ball}"), sphere(Vec3::new(at.x, 0.45, at.y), 0.4, 2), silver);
    }
    scene.camera(Camera::look_at(Vec3::new(0.0, 1.2 + half * 0.6, half + 3.0), Vec3::Y * 0.4, 0.9));
    scene.build()
}

/// A chessboard floor, panelled walls and one light under the ceiling.
fn furnish(scene: &mut SceneBuilder, room: Room) {
    let (board, panels) = (scene.texture(texture::chessboard(256)), scene.texture(texture::panels(256)));
    let floor = scene.material(matte("chessboard").textured(board));
    let walls = scene.material(matte("panels").textured(panels));
    room.furnish(scene, (floor, 3.2), (walls, 3.0), (walls, 3.0));
    let light = Vec3::new(0.3, room.high.y - 0.5, room.high.z * 0.5);
    scene.point_light(light, Vec3::splat(8.0 + 2.0 * light.length_squared()));
}
