//! The demo scenes themselves: what stands where, how it is lit, and from where it is seen.

use glam::{Affine3A, Vec3};

use super::set::{Room, frame, lamp};
use super::shape::{plane, sphere as ball};
use super::{SceneBuilder, chrome, glass, matte, texture, vessel};
use crate::scene::{Camera, Material, Volume};

const ROOM: Room = Room { low: Vec3::new(-4.0, 0.0, -3.0), high: Vec3::new(4.0, 5.0, 5.0) };
/// World units that one chessboard texture (eight squares) covers.
const BOARD: f32 = 3.2;
/// World units that one brick texture (eight rows) covers.
const BRICKS: f32 = 1.8;

/// Paper Fig. 7a. k_r is about 0.6 on a diffuse base, which is base colour × metallic.
pub fn cup(mut scene: SceneBuilder) -> SceneBuilder {
    chess_room(&mut scene, ROOM);
    let metal = scene.material(polished_steel());
    scene.mesh("cup", vessel::cup().turned(0.45), metal);
    light(&mut scene);
    scene.camera(Camera::look_at(Vec3::new(0.1, 1.7, 2.85), Vec3::new(0.12, 0.59, 0.0), 36_f32.to_radians()));
    scene
}

/// Paper Fig. 8a.
pub fn cup_and_glass(mut scene: SceneBuilder) -> SceneBuilder {
    wood_room(&mut scene, matte("table"));
    let metal = scene.material(polished_steel());
    let clear = scene.material(solid_glass(Vec3::new(0.93, 0.97, 0.95)));
    scene.mesh("cup", vessel::cup().turned(2.6).translated(Vec3::new(-0.62, 0.0, -0.35)), metal).mesh(
        "wine glass",
        vessel::wine_glass().translated(Vec3::new(0.55, 0.0, 0.35)),
        clear,
    );
    light(&mut scene);
    scene.camera(Camera::look_at(Vec3::new(0.0, 1.75, 3.6), Vec3::new(0.0, 0.66, 0.0), 36_f32.to_radians()));
    scene
}

/// Paper Fig. 8b. The table reflects little, so that its material alone would not make it specular.
pub fn polished_table(mut scene: SceneBuilder) -> SceneBuilder {
    let table = Material { metallic: 0.3, roughness: 0.0, vt_extra: Some(true), ..matte("polished table") };
    wood_room(&mut scene, table);
    let metal = scene.material(polished_steel());
    scene.mesh("cup", vessel::cup().turned(0.45), metal);
    light(&mut scene);
    scene.camera(Camera::look_at(Vec3::new(0.1, 1.35, 3.4), Vec3::new(0.12, 0.62, 0.0), 36_f32.to_radians()));
    scene
}

/// A mirror that leans forward, seen from high above its lower edge: all that it shows is the floor.
pub fn mirror(mut scene: SceneBuilder) -> SceneBuilder {
    mirror_hall(&mut scene, 1.2, 0.12);
    scene.camera(Camera::look_at(Vec3::new(0.2, 2.6, 3.9), Vec3::new(-1.0, 0.82, 0.8), 38_f32.to_radians()));
    scene
}

/// A mirror high and upright enough to show the wall above the floor.
pub fn mirror_and_wall(mut scene: SceneBuilder) -> SceneBuilder {
    mirror_hall(&mut scene, 2.0, 0.0);
    scene.camera(Camera::look_at(Vec3::new(0.4, 2.3, 4.3), Vec3::new(-1.0, 1.05, 0.7), 40_f32.to_radians()));
    scene
}

/// A long mirror of two faces, `height` units high and leaning forward by `lean` radians, along the left
/// side of a hall, so that the camera sees it at a grazing angle.
fn mirror_hall(scene: &mut SceneBuilder, height: f32, lean: f32) {
    chess_room(scene, Room { low: Vec3::new(-4.0, 0.0, -7.5), high: Vec3::new(4.0, 5.0, 5.0) });
    let silver = scene.material(chrome("silver", Vec3::splat(0.9)));
    let oak = scene.material(matte("frame").colored(Vec3::new(0.09, 0.05, 0.03)));
    let width = 4.0;
    // Built in the plane z = 0, then turned to face +x and leant forward about its lower edge.
    let place = Affine3A::from_translation(Vec3::new(-1.3, 0.14, 2.0))
        * Affine3A::from_rotation_z(-lean)
        * Affine3A::from_rotation_y(std::f32::consts::FRAC_PI_2);
    scene
        .mesh("mirror", plane(Vec3::ZERO, Vec3::X * width, Vec3::Y * height, 1.0).transformed(place), silver)
        .mesh("frame", frame(width, height, 0.07, 0.04).transformed(place), oak);
    light(scene);
}

/// Paper Fig. 1: coarse enough to watch it being refined.
pub fn sphere(mut scene: SceneBuilder) -> SceneBuilder {
    chess_room(&mut scene, ROOM);
    let silver = scene.material(chrome("silver", Vec3::new(0.82, 0.82, 0.84)));
    scene.mesh("sphere", ball(Vec3::Y * 0.72, 0.7, 3), silver);
    light(&mut scene);
    scene.camera(Camera::look_at(Vec3::new(0.0, 1.75, 3.3), Vec3::new(0.0, 0.62, 0.0), 36_f32.to_radians()));
    scene
}

/// Refraction through a ball and through thin curved walls.
pub fn glass_bowl(mut scene: SceneBuilder) -> SceneBuilder {
    chess_room(&mut scene, ROOM);
    let clear = scene.material(solid_glass(Vec3::new(0.95, 0.98, 0.97)));
    let green =
        scene.material(Material { name: "green glass".into(), ..solid_glass(Vec3::new(0.72, 0.93, 0.84)) });
    scene.mesh("glass sphere", ball(Vec3::new(-0.80, 0.525, -0.1), 0.52, 3), clear).mesh(
        "glass bowl",
        vessel::bowl().translated(Vec3::new(0.70, 0.0, 0.0)),
        green,
    );
    light(&mut scene);
    scene.camera(Camera::look_at(Vec3::new(0.06, 1.9, 3.5), Vec3::new(0.06, 0.34, 0.0), 36_f32.to_radians()));
    scene
}

fn chess_room(scene: &mut SceneBuilder, room: Room) {
    let (board, bricks, panels) = (
        scene.texture(texture::chessboard(512)),
        scene.texture(texture::brick(512)),
        scene.texture(texture::panels(256)),
    );
    let floor = scene.material(matte("chessboard").textured(board));
    let wall = scene.material(matte("brick").textured(bricks));
    let sides = scene.material(matte("panels").textured(panels));
    room.furnish(scene, (floor, BOARD), (wall, BRICKS), (sides, 3.0));
}

fn wood_room(scene: &mut SceneBuilder, table: Material) {
    let (wood, bricks, panels) = (
        scene.texture(texture::wood(512)),
        scene.texture(texture::brick(512)),
        scene.texture(texture::panels(256)),
    );
    let table = scene.material(table.textured(wood));
    let wall = scene.material(matte("brick").textured(bricks));
    let sides = scene.material(matte("panels").textured(panels));
    ROOM.furnish(scene, (table, 2.0), (wall, BRICKS), (sides, 3.0));
}

/// A warm key light from the right, a cool one from the left, and a weak one by the camera, since
/// there is no ambient light to fill the shadows.
fn light(scene: &mut SceneBuilder) {
    lamp(scene, "key", Vec3::new(2.2, 4.6, 2.6), (1.2, 1.2), Vec3::new(78.0, 73.0, 64.0));
    lamp(scene, "left", Vec3::new(-2.6, 4.6, 0.8), (0.9, 1.6), Vec3::new(25.0, 28.0, 33.0));
    scene.point_light(Vec3::new(-0.4, 2.2, 4.2), Vec3::splat(9.0));
}

/// k_r = base colour × metallic, about 0.6; the quarter that is not metallic shades diffusely.
fn polished_steel() -> Material {
    Material { metallic: 0.75, ..chrome("polished steel", Vec3::new(0.80, 0.78, 0.75)) }
}

fn solid_glass(tint: Vec3) -> Material {
    Material {
        volume: Some(Volume { attenuation_color: tint, attenuation_distance: 0.25 }),
        ..glass("clear glass", 1.5)
    }
}
