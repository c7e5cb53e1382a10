//! A floor whose colours tell where they were seen.

use glam::{Vec2, Vec3, vec3};
use vertex_tracing::scene::{
    Image, Material, Sampler, Wrap,
    demo::{SceneBuilder, matte, shape},
};

/// A floor, 8 × 8 around the origin, that glows in the colour of its own coordinates.
pub fn glowing_floor(builder: &mut SceneBuilder) {
    const SIZE: u32 = 256;
    let texel = |i: u32| [(i % SIZE) as u8, (i / SIZE) as u8, 0, 255];
    let rgba: Vec<u8> = (0..SIZE * SIZE).flat_map(texel).collect();
    let image = Image { name: "coordinates".into(), width: SIZE, height: SIZE, rgba: rgba.into() };
    let clamped = Sampler { wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, mip: None, ..Sampler::default() };
    let slot = builder.sampled_texture(image, clamped, false);
    let floor =
        builder.material(Material { base_color_texture: Some(slot), unlit: true, ..matte("coordinates") });
    builder.mesh("floor", shape::plane(vec3(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0, 8.0), floor);
}

/// Coordinates that the floor shows at a point of it.
pub fn floor_uv(point: Vec3) -> Vec2 {
    Vec2::new((point.x + 4.0) / 8.0, (point.z + 4.0) / 8.0)
}

/// Coordinates back from a colour of the glowing floor. Texel i is i/255 at (i + 0.5)/256.
pub fn shown_uv(color: Vec3) -> Vec2 {
    Vec2::new(color.x * 255.0 + 0.5, color.y * 255.0 + 0.5) / 256.0
}
