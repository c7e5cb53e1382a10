//! Demo scenes made in code, after the paper's figures, and the parts to build others from.
//!
//! [`Demo`] names the scenes; each is built by a [`SceneBuilder`] from the meshes of [`shape`], [`sweep`]
//! and [`vessel`], the images of [`texture`] and the furniture of [`set`]. [`stress`] has scenes whose size is an argument. A
//! [`Scene`] of any origin becomes a binary glTF file with [`glb::encode`]: a demo's file and the demo
//! itself are therefore the same scene, and a test loads each file back to prove it.
//!
//! `assets/cup.glb` is [`Demo::Cup`]; this writes it, and the others beside it on request:
//!
//! ```text
//! cargo run --release --example demo_assets -- assets cup
//! ```

mod builder;
mod figures;
pub mod glb;
mod mesh;
pub mod set;
pub mod shape;
pub mod stress;
pub mod sweep;
pub mod texture;
pub mod vessel;

pub use builder::{MaterialId, SceneBuilder, chrome, glass, matte};
pub use mesh::Mesh;

use super::Scene;

/// A demo scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Demo {
    /// Fig. 7: a metal cup with a handle on a chessboard before a brick wall.
    Cup,
    /// Fig. 8a: the cup and a wine glass on a wooden table before a brick wall.
    CupAndGlass,
    /// Fig. 8b: the cup on a polished table that reflects the wall.
    PolishedTable,
    /// A planar mirror, seen at a grazing angle, that shows nothing but the chessboard.
    Mirror,
    /// A higher mirror, upright, that shows the border between the chessboard and the wall.
    MirrorAndWall,
    /// Fig. 1: a mirror sphere over a chessboard.
    Sphere,
    /// A solid glass sphere and a glass bowl on a chessboard.
    GlassBowl,
}

impl Demo {
    /// Every demo scene.
    pub const ALL: [Self; 7] = [
        Self::Cup,
        Self::CupAndGlass,
        Self::PolishedTable,
        Self::Mirror,
        Self::MirrorAndWall,
        Self::Sphere,
        Self::GlassBowl,
    ];

    /// The scene's name and its file's stem: lower case, words joined by hyphens.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cup => "cup",
            Self::CupAndGlass => "cup-and-glass",
            Self::PolishedTable => "polished-table",
            Self::Mirror => "mirror",
            Self::MirrorAndWall => "mirror-and-wall",
            Self::Sphere => "sphere",
            Self::GlassBowl => "glass-bowl",
        }
    }

    /// The demo of this name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|demo| demo.name() == name)
    }

    /// The scene, with its lights and one camera, framed for an image of 5 : 4.
    pub fn scene(self) -> Scene {
        let scene = SceneBuilder::new(self.name());
        let scene = match self {
            Self::Cup => figures::cup(scene),
            Self::CupAndGlass => figures::cup_and_glass(scene),
            Self::PolishedTable => figures::polished_table(scene),
            Self::Mirror => figures::mirror(scene),
            Self::MirrorAndWall => figures::mirror_and_wall(scene),
            Self::Sphere => figures::sphere(scene),
            Self::GlassBowl => figures::glass_bowl(scene),
        };
        scene.build().expect("the demos' own meshes and materials are valid")
    }

    /// The scene as a binary glTF file with its textures inside.
    pub fn glb(self) -> Vec<u8> {
        glb::encode(&self.scene()).expect("a demo is far below the 4 GiB of a GLB")
    }
}
