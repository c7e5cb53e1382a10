//! The figures: which scene each shows, how it is made, and what it took.

use glam::Vec3;
use vertex_tracing::error::Result;
use vertex_tracing::frame::Frame;
use vertex_tracing::options::{Options, Reconstruction, Show};
use vertex_tracing::report::FloatImage;
use vertex_tracing::scene::demo::{Demo, SceneBuilder, chrome, matte, shape, texture};
use vertex_tracing::scene::{Camera, Scene};

use crate::lab::{Conventional, Effort, FULL_QUALITY, Lab, options, seen_from, showing};

const FULL: (u32, u32) = (1280, 1024);
const HALF: (u32, u32) = (640, 512);

/// A figure of the paper.
pub struct Plate {
    pub title: &'static str,
    /// The paper's caption in short.
    pub caption: &'static str,
    pub pictures: Vec<Picture>,
    pub rows: Vec<Row>,
}

/// A picture and the file's stem.
pub struct Picture {
    pub name: String,
    pub caption: String,
    pub image: FloatImage,
}

/// What one picture took.
pub struct Row {
    pub what: String,
    pub samples: Option<u64>,
    pub rays: u64,
    pub ms: f64,
    /// Against the conventional picture, over specular pixels.
    pub psnr: Option<f64>,
    pub faces: Option<(u64, u64)>,
}

/// Collects the pictures of one figure.
struct Easel<'a> {
    lab: &'a Lab,
    scene: Scene,
    plate: Plate,
    conventional: Conventional,
}

impl<'a> Easel<'a> {
    fn new(
        lab: &'a Lab,
        scene: Scene,
        options: &Options,
        title: &'static str,
        caption: &'static str,
    ) -> Result<Self> {
        let conventional = lab.conventional(&scene, options)?;
        let plate = Plate { title, caption, pictures: Vec::new(), rows: Vec::new() };
        Ok(Self { lab, scene, plate, conventional })
    }

    /// Draws and measures a frame.
    fn frame(&mut self, name: &str, what: &str, options: &Options) -> Result<Frame> {
        let frame = self.lab.measure(&self.scene, options)?;
        let stats = &frame.stats;
        let psnr = self.conventional.psnr(&frame.image)?;
        self.plate.rows.push(Row {
            what: what.into(),
            samples: Some(stats.vertices),
            rays: stats.rays.total,
            ms: stats.time_ms.frame,
            psnr: Some(psnr),
            faces: Some((stats.faces.defined, stats.faces.undefined)),
        });
        let caption = format!("{what}: {} samples", stats.vertices);
        self.picture(name, caption, frame.image.clone());
        Ok(frame)
    }

    /// Draws the data of a frame.
    fn data(&mut self, name: &str, caption: &str, options: &Options, show: Show) -> Result<()> {
        let frame = self.lab.frame(&self.scene, &showing(options, show))?;
        self.picture(name, caption.into(), frame.image);
        Ok(())
    }

    fn picture(&mut self, name: &str, caption: String, image: FloatImage) {
        self.plate.pictures.push(Picture { name: name.into(), caption, image });
    }

    /// Adds the conventional picture and hands the figure over.
    fn finish(mut self, name: &str) -> Plate {
        self.plate.rows.push(Row {
            what: "conventional, one ray tree a pixel".into(),
            samples: None,
            rays: self.conventional.rays,
            ms: self.conventional.ms,
            psnr: None,
            faces: None,
        });
        let image = std::mem::replace(
            &mut self.conventional.image,
            FloatImage { width: 0, height: 0, pixels: Vec::new() },
        );
        self.picture(name, "conventional".into(), image);
        self.plate
    }
}

/// Every figure of the paper that shows a result.
pub fn all(lab: &Lab) -> Result<Vec<Plate>> {
    Ok(vec![
        fig1(lab)?,
        fig5(lab)?,
        fig6(lab)?,
        fig7a(lab)?,
        fig7b(lab)?,
        fig8a(lab)?,
        fig8b(lab)?,
        fig9(lab)?,
    ])
}

fn paper(size: (u32, u32), effort: Effort) -> Options {
    options(size, Reconstruction::Paper, effort)
}

fn fig1(lab: &Lab) -> Result<Plate> {
    let caption = "Adaptive progressive refinement in object space.";
    let mut easel =
        Easel::new(lab, Demo::Sphere.scene(), &paper(HALF, Effort::Preview), "Figure 1", caption)?;
    for (step, what, effort) in [
        (0, "primary vertices", Effort::Preview),
        (1, "after some steps", Effort::Samples(1_500)),
        (2, "refined", Effort::Samples(12_000)),
    ] {
        let options = paper(HALF, effort);
        easel.frame(&format!("fig1_{step}"), what, &options)?;
        let mesh = format!("{what}: the mesh (green: defined faces, orange: undefined, blue: diffuse)");
        easel.data(&format!("fig1_{step}_mesh"), &mesh, &options, Show::Faces)?;
    }
    Ok(easel.finish("fig1_conventional"))
}

/// A mirror of two faces, `height` units high, that leans forward over a chessboard before a brick wall.
fn leaning_mirror(height: f32) -> Result<Scene> {
    let mut scene = SceneBuilder::new("leaning mirror");
    let (board, bricks) = (scene.texture(texture::chessboard(512)), scene.texture(texture::brick(512)));
    let floor = scene.material(matte("floor").textured(board));
    let wall = scene.material(matte("wall").textured(bricks));
    let silver = scene.material(chrome("silver", Vec3::splat(0.9)));
    let up = Vec3::new(0.0, height, 0.1 * height);
    scene
        .mesh("mirror", shape::plane(Vec3::new(-1.0, 0.2, -1.0), Vec3::X * 2.0, up, 1.0), silver)
        .mesh(
            "floor",
            shape::plane(Vec3::new(-9.0, 0.0, 6.0), Vec3::X * 18.0, Vec3::NEG_Z * 12.0, 4.0),
            floor,
        )
        .mesh("wall", shape::plane(Vec3::new(9.0, 0.0, 6.0), Vec3::NEG_X * 18.0, Vec3::Y * 9.0, 2.0), wall);
    scene.point_light(Vec3::new(1.0, 4.0, 3.0), Vec3::splat(90.0));
    scene.camera(Camera::look_at(Vec3::new(0.6, 1.9, 2.4), Vec3::new(0.0, 0.75, -1.0), 0.8));
    scene.build()
}

fn fig5(lab: &Lab) -> Result<Plate> {
    let preview = paper(HALF, Effort::Preview);
    let caption = "Defined faces: all vertices point to the same face with one texture.";
    let mut easel = Easel::new(lab, leaning_mirror(0.8)?, &preview, "Figure 5", caption)?;
    easel.frame("fig5", "preview", &preview)?;
    easel.data("fig5_faces", "its faces: green are defined", &preview, Show::Faces)?;
    Ok(easel.finish("fig5_conventional"))
}

fn fig6(lab: &Lab) -> Result<Plate> {
    let preview = paper(HALF, Effort::Preview);
    let caption = "Undefined faces: different textures are reflected from one face, texels are interpolated.";
    let mut easel = Easel::new(lab, leaning_mirror(2.2)?, &preview, "Figure 6", caption)?;
    easel.frame("fig6", "preview", &preview)?;
    easel.data("fig6_faces", "its faces: orange are undefined", &preview, Show::Faces)?;
    let refined = paper(HALF, Effort::Samples(3_000));
    easel.frame("fig6_refined", "refined", &refined)?;
    easel.data(
        "fig6_refined_faces",
        "its faces: the border is what stays undefined",
        &refined,
        Show::Faces,
    )?;
    Ok(easel.finish("fig6_conventional"))
}

fn fig7a(lab: &Lab) -> Result<Plate> {
    let preview = paper(FULL, Effort::Preview);
    let caption = "The cup at 1280×1024: preview, full quality, and conventional ray tracing.";
    let mut easel = Easel::new(lab, Demo::Cup.scene(), &preview, "Figure 7a", caption)?;
    easel.frame("fig7a_preview", "preview", &preview)?;
    easel.frame("fig7a", "full quality", &paper(FULL, Effort::Samples(FULL_QUALITY)))?;
    let exact = |effort| options(FULL, Reconstruction::Exact, effort);
    easel.frame("fig7a_exact_preview", "preview, exact reconstruction", &exact(Effort::Preview))?;
    let full = exact(Effort::Samples(FULL_QUALITY));
    easel.frame("fig7a_exact", "full quality, exact reconstruction", &full)?;
    Ok(easel.finish("fig7a_conventional"))
}

fn fig7b(lab: &Lab) -> Result<Plate> {
    let caption = "No sampling is performed for the radiance variance of textures.";
    let options = paper(HALF, Effort::Samples(6_000));
    let close = seen_from(&options, [0.1, 1.25, 2.3], [0.1, 0.45, 0.0], 32.0);
    let mut easel = Easel::new(lab, Demo::Cup.scene(), &close, "Figure 7b", caption)?;
    easel.frame("fig7b", "the cup from nearby", &close)?;
    let samples = "its samples: primary vertices yellow, refined ones white, those of diffuse faces blue";
    easel.data("fig7b_samples", samples, &close, Show::Samples)?;
    easel.data("fig7b_faces", "its faces: green are defined", &close, Show::Faces)?;
    Ok(easel.finish("fig7b_conventional"))
}

fn fig8a(lab: &Lab) -> Result<Plate> {
    let full = paper(HALF, Effort::Samples(FULL_QUALITY / 2));
    let caption = "Combination of transmitted and reflected textures.";
    let mut easel = Easel::new(lab, Demo::CupAndGlass.scene(), &full, "Figure 8a", caption)?;
    easel.frame("fig8a", "full quality", &full)?;
    let exact = options(HALF, Reconstruction::Exact, Effort::Samples(FULL_QUALITY / 2));
    easel.frame("fig8a_exact", "full quality, exact reconstruction", &exact)?;
    easel.data("fig8a_depth", "bounces: one is blue, two green, three yellow", &full, Show::Depth)?;
    Ok(easel.finish("fig8a_conventional"))
}

fn fig8b(lab: &Lab) -> Result<Plate> {
    let preview = paper(HALF, Effort::Preview);
    let caption = "Only the primary vertices were sampled, and the wall's reflection is almost complete.";
    let mut easel = Easel::new(lab, Demo::PolishedTable.scene(), &preview, "Figure 8b", caption)?;
    easel.frame("fig8b", "preview; the table has four vertices", &preview)?;
    easel.frame("fig8b_more", "the table refined too", &paper(HALF, Effort::Samples(4_000)))?;
    let exact = options(HALF, Reconstruction::Exact, Effort::Preview);
    easel.frame("fig8b_exact", "preview, exact reconstruction", &exact)?;
    Ok(easel.finish("fig8b_conventional"))
}

fn fig9(lab: &Lab) -> Result<Plate> {
    let near = |reconstruction, effort| {
        seen_from(&options(HALF, reconstruction, effort), [0.1, 1.1, 1.9], [0.1, 0.2, 0.0], 24.0)
    };
    let preview = near(Reconstruction::Paper, Effort::Preview);
    let caption = "a) Incorrect perspective of reflected textures; b) correct, by ray tracing.";
    let mut easel = Easel::new(lab, Demo::Cup.scene(), &preview, "Figure 9", caption)?;
    easel.frame("fig9a", "a) preview", &preview)?;
    easel.frame("fig9a_dense", "a) denser", &near(Reconstruction::Paper, Effort::Samples(6_000)))?;
    let exact = near(Reconstruction::Exact, Effort::Preview);
    easel.frame("fig9a_exact", "preview, exact reconstruction", &exact)?;
    Ok(easel.finish("fig9b"))
}
