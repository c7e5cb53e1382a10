//! The scenes: each needs more than the one before.

use glam::{Vec3, Vec4, vec3};
use vertex_tracing::{
    error::Result,
    options::{Options, Shadows},
    scene::{
        AlphaMode, Background, Camera, Environment, Material, Sampler, Scene,
        demo::{SceneBuilder, chrome, glass, matte, shape, texture},
    },
};

/// A scene of the ladder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rung {
    /// Shapes of one colour each, unlit.
    Flat,
    /// The same, one of them with a texture.
    Texture,
    /// The same, lit, without shadows.
    Lights,
    /// With shadows.
    Shadow,
    /// An upright mirror among untextured things.
    Mirror,
    /// The mirror shows textures.
    MirrorAndTextures,
    /// A glass ball in place of the mirror.
    Glass,
    /// Mirror, glass, chrome, a cut-out, a veil, a lamp and a panorama.
    All,
}

impl Rung {
    /// From the simplest on.
    pub const ALL: [Self; 8] = [
        Self::Flat,
        Self::Texture,
        Self::Lights,
        Self::Shadow,
        Self::Mirror,
        Self::MirrorAndTextures,
        Self::Glass,
        Self::All,
    ];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Flat => "flat colour",
            Self::Texture => "one texture",
            Self::Lights => "lights",
            Self::Shadow => "shadow",
            Self::Mirror => "one mirror",
            Self::MirrorAndTextures => "mirror and textures",
            Self::Glass => "glass",
            Self::All => "all",
        }
    }

    /// Whether nothing is traced for it.
    pub fn is_plain(self) -> bool {
        self < Self::Shadow
    }

    /// The options of its frames.
    pub fn options(self, (width, height): (u32, u32)) -> Options {
        let mut options = Options::default();
        (options.view.width, options.view.height) = (width, height);
        options.scene.shadows = if self.is_plain() { Shadows::None } else { Shadows::All };
        options
    }

    /// The scene.
    ///
    /// # Errors
    /// None: the meshes and materials are valid.
    pub fn scene(self) -> Result<Scene> {
        let mut scene = SceneBuilder::new(self.name());
        let unlit = self < Self::Lights;
        let plain = |name: &str, color: Vec3| Material { unlit, ..matte(name).colored(color) };
        let mut floor = plain("floor", vec3(0.6, 0.55, 0.5));
        if matches!(self, Self::Texture | Self::MirrorAndTextures | Self::Glass | Self::All) {
            let board = scene.texture(texture::chessboard(256));
            floor = Material { unlit, ..matte("floor") }.textured(board);
        }
        let floor = scene.material(floor);
        let box_color = scene.material(plain("box", vec3(0.7, 0.3, 0.2)));
        scene.mesh("floor", ground(), floor);
        let body = shape::cuboid(vec3(-1.4, 0.0, -0.2), vec3(-0.7, 0.7, 0.5), 1.0);
        scene.mesh("box", body, box_color);
        if !unlit {
            scene.point_light(vec3(1.5, 3.5, 3.0), Vec3::splat(40.0));
        }
        if matches!(self, Self::Mirror | Self::MirrorAndTextures | Self::All) {
            let metal = scene.material(chrome("mirror", Vec3::splat(0.8)));
            let upright = shape::plane(vec3(-1.8, 0.05, -1.5), Vec3::X * 3.6, Vec3::Y * 2.0, 1.0);
            scene.mesh("mirror", upright, metal);
        }
        if matches!(self, Self::MirrorAndTextures | Self::All) {
            let brick = scene.texture(texture::brick(256));
            let brick = scene.material(matte("brick").textured(brick));
            let wall = shape::plane(vec3(3.0, 0.0, 3.5), Vec3::NEG_X * 6.0, Vec3::Y * 3.0, 1.0);
            scene.mesh("wall", wall, brick);
        }
        if matches!(self, Self::Glass | Self::All) {
            let clear = scene.material(glass("glass", 1.5));
            scene.mesh("glass", shape::sphere(vec3(0.5, 0.5, 0.3), 0.5, 3), clear);
        }
        if self == Self::All {
            rest(&mut scene);
        }
        scene.camera(Camera::look_at(vec3(0.6, 1.4, 3.2), vec3(-0.1, 0.5, 0.0), 0.8));
        scene.build()
    }
}

fn ground() -> vertex_tracing::scene::demo::Mesh {
    shape::plane(vec3(-2.5, 0.0, 2.5), Vec3::X * 5.0, Vec3::NEG_Z * 5.0, 1.0)
}

/// What nothing below the last rung has.
fn rest(scene: &mut SceneBuilder) {
    let metal = scene.material(chrome("chrome", vec3(0.9, 0.8, 0.6)));
    scene.mesh("ball", shape::sphere(vec3(1.4, 0.35, 0.9), 0.35, 2), metal);
    let mipped = scene.sampled_texture(texture::panels(128), Sampler::default(), true);
    let lamp = Material { emissive: vec3(2.0, 1.6, 1.0), emissive_texture: Some(mipped), ..matte("lamp") };
    let lamp = scene.material(lamp);
    scene.mesh("lamp", shape::cuboid(vec3(-0.3, 0.0, 1.0), vec3(0.0, 0.3, 1.3), 1.0), lamp);
    let gloss = Material { roughness: 0.4, specular: 1.0, ..matte("gloss").colored(vec3(0.1, 0.2, 0.5)) };
    let gloss = scene.material(gloss);
    scene.mesh("gloss", shape::sphere(vec3(-0.6, 0.25, 1.6), 0.25, 2), gloss);
    let leaf = Material { alpha_mode: AlphaMode::Mask(0.5), double_sided: true, ..matte("leaf") };
    let leaf = scene.material(leaf.colored(vec3(0.2, 0.6, 0.2)));
    scene.mesh("leaf", shape::plane(vec3(1.2, 0.0, 0.0), Vec3::X * 0.5, Vec3::Y * 0.8, 1.0), leaf);
    let veil = Material {
        alpha_mode: AlphaMode::Blend,
        base_color: Vec4::new(0.9, 0.9, 1.0, 0.3),
        unlit: true,
        ..matte("veil")
    };
    let veil = scene.material(veil);
    scene.mesh("veil", shape::plane(vec3(-0.9, 0.0, 2.0), Vec3::X * 0.7, Vec3::Y * 0.9, 1.0), veil);
    let rows = [vec3(0.3, 0.5, 0.9), vec3(0.6, 0.7, 0.9), vec3(0.2, 0.2, 0.2), vec3(0.1, 0.1, 0.1)];
    let radiance: Vec<Vec3> = rows.into_iter().flat_map(|row| [row; 8]).collect();
    let sky = Environment { name: "sky".into(), width: 8, height: 4, radiance: radiance.into() };
    scene.background(Background::Environment(sky));
}
