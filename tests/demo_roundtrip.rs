//! What the GLB writer writes, the loader reads back as the same scene.

use std::path::Path;

use glam::{Affine2, DVec3, Vec2, Vec3, Vec4};
use vertex_tracing::error::Error;
use vertex_tracing::options::Options;
use vertex_tracing::scene::classify::{VtRules, classify};
use vertex_tracing::scene::demo::{Demo, SceneBuilder, glb, matte, shape, stress, texture};
use vertex_tracing::scene::gltf::{Limits, load_slice};
use vertex_tracing::scene::{
    AlphaMode, Background, Camera, Filter, Light, LightKind, Material, Projection, Sampler, Scene,
    TextureSlot, Volume, Wrap,
};

fn round_trip(scene: &Scene) -> Scene {
    let bytes = glb::encode(scene).unwrap();
    let name = format!("{}.glb", scene.name);
    let mut read = load_slice(&bytes, None, Path::new(&name), &Limits::default()).unwrap();
    // The loader leaves the classes to the caller, who may have rules of his own.
    classify(&mut read, &VtRules::default()).unwrap();
    read
}

#[test]
fn options_load_what_a_renderer_asks_for() {
    let mut dark = Demo::Cup.scene();
    dark.lights.clear();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("cup.glb");
    std::fs::write(&file, glb::encode(&dark).unwrap()).unwrap();
    let mut options = Options::default();
    let (scene, view) = options.load(&file).unwrap();
    assert_eq!(scene.vt_faces(), dark.vt_faces());
    assert_eq!(scene.lights.len(), 1, "lit from the eye");
    assert_eq!(scene.lights[0].incident(view.eye.into()).distance, 0.0);

    options.scene.vt.forbid = vec!["cup".into()];
    options.scene.background = Some(Vec3::X);
    let (scene, _) = options.load(&file).unwrap();
    assert_eq!(scene.vt_faces(), 0);
    assert!(matches!(scene.background, Background::Color(Vec3::X)));
    options.scene.max_triangles = Some(5);
    assert!(options.load(&file).unwrap_err().to_string().contains("--max-triangles"));
    options.scene.vt.force = vec!["cup".into()];
    assert!(matches!(options.load(&file), Err(Error::Option(problem)) if problem.contains("contradict")));
}

/// Asserts that two scenes draw the same image; indices of materials and textures may differ.
fn assert_same(ours: &Scene, theirs: &Scene) {
    let name = &ours.name;
    assert_eq!(name, &theirs.name);
    assert_eq!(ours.geometry.faces, theirs.geometry.faces, "{name}");
    let shift = (theirs.origin - ours.origin).as_vec3();
    let near = |a: Vec3, b: Vec3| a.distance(b) < 2e-6 * (1.0 + a.length());
    let all_near = |ours: &[Vec3], theirs: &[Vec3], shift: Vec3| {
        ours.len() == theirs.len() && ours.iter().zip(theirs).all(|(a, b)| near(*a, *b + shift))
    };
    assert!(all_near(&ours.geometry.positions, &theirs.geometry.positions, shift), "{name}");
    assert!(all_near(&ours.geometry.normals, &theirs.geometry.normals, Vec3::ZERO), "{name}");
    for vertex in 0..ours.geometry.positions.len() as u32 {
        assert_eq!(ours.geometry.uv(0, vertex), theirs.geometry.uv(0, vertex), "{name}: vertex {vertex}");
    }
    for (a, b) in ours.objects.iter().zip(&theirs.objects) {
        assert_eq!(
            (&a.name, &a.mesh_name, &a.faces, &a.vertices),
            (&b.name, &b.mesh_name, &b.faces, &b.vertices)
        );
        assert_eq!(a.vt, b.vt, "{name}: {}", a.name);
        assert_same_material(
            ours,
            &ours.materials[a.material as usize],
            theirs,
            &theirs.materials[b.material as usize],
        );
    }
    assert_eq!(ours.objects.len(), theirs.objects.len());
    for (a, b) in ours.lights.iter().zip(&theirs.lights) {
        assert!(near(a.intensity, b.intensity), "{name}: {} {}", a.intensity, b.intensity);
        for point in [Vec3::new(0.3, -0.4, 0.2), Vec3::new(-2.0, 1.0, 0.5)] {
            let (a, b) = (a.incident(point.into()), b.incident((point - shift).into()));
            let irradiances = [a.irradiance, b.irradiance].map(Vec3::from);
            assert!(
                near(a.to_light.into(), b.to_light.into())
                    && irradiances[0].distance(irradiances[1]) <= 1e-4 * irradiances[0].length()
            );
        }
    }
    assert_eq!(ours.lights.len(), theirs.lights.len());
    for (a, b) in ours.cameras.iter().zip(&theirs.cameras) {
        assert_eq!((&a.name, a.projection), (&b.name, b.projection));
        assert!(near(a.position, b.position + shift) && near(a.forward, b.forward) && near(a.up, b.up));
    }
    assert_eq!((ours.cameras.len(), ours.ambient), (theirs.cameras.len(), theirs.ambient));
}

fn assert_same_material(ours: &Scene, a: &Material, theirs: &Scene, b: &Material) {
    let without_textures = |material: &Material| {
        let bare = Material {
            base_color_texture: None,
            metallic_roughness_texture: None,
            normal_texture: None,
            emissive_texture: None,
            specular_texture: None,
            specular_color_texture: None,
            transmission_texture: None,
            ..material.clone()
        };
        format!("{bare:?}")
    };
    assert_eq!(without_textures(a), without_textures(b));
    let slots = |m: &Material| {
        [
            m.base_color_texture,
            m.metallic_roughness_texture,
            m.normal_texture,
            m.emissive_texture,
            m.specular_texture,
            m.specular_color_texture,
            m.transmission_texture,
        ]
    };
    for (a, b) in slots(a).into_iter().zip(slots(b)) {
        let ((Some(a), Some(b)), false) = ((a, b), a.is_none() && b.is_none()) else {
            assert_eq!(a.is_none(), b.is_none());
            continue;
        };
        assert_eq!(a.uv_set, b.uv_set);
        let at = Vec2::new(0.3, 0.8);
        assert!(a.transform(at).distance(b.transform(at)) < 1e-5);
        let (ta, tb) = (ours.textures[a.texture as usize], theirs.textures[b.texture as usize]);
        assert_eq!((ta.sampler, ta.srgb), (tb.sampler, tb.srgb));
        let (ia, ib) = (&ours.images[ta.image as usize], &theirs.images[tb.image as usize]);
        assert_eq!((&ia.name, ia.width, ia.height), (&ib.name, ib.width, ib.height));
        assert!(ia.rgba == ib.rgba, "{} differs", ia.name);
    }
}

#[test]
fn demos_survive_their_files() {
    for demo in Demo::ALL {
        let scene = demo.scene();
        let read = round_trip(&scene);
        assert_same(&scene, &read);
        assert_eq!(read.notes, Vec::<String>::new(), "{}", demo.name());
    }
    for scene in [stress::quad(), stress::wavy_mirror(200), stress::mirror_ball_room(3)] {
        let scene = scene.unwrap();
        assert_same(&scene, &round_trip(&scene));
    }
}

#[test]
fn every_word_of_the_writer_is_read() {
    let mut builder = SceneBuilder::new("all words");
    let color = builder.texture(texture::brick(16));
    let nearest = Sampler {
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Mirror,
        mag: Filter::Nearest,
        min: Filter::Linear,
        mip: Some(Filter::Nearest),
    };
    let data = builder.sampled_texture(texture::wood(8), nearest, false);
    let turned = TextureSlot {
        transform: Affine2::from_scale_angle_translation(Vec2::new(2.0, 0.5), 0.6, Vec2::new(0.1, -0.3)),
        ..color
    };
    let materials = [
        Material {
            emissive: Vec3::new(3.0, 0.5, 0.0),
            emissive_texture: Some(color),
            metallic_roughness_texture: Some(data),
            double_sided: true,
            alpha_mode: AlphaMode::Mask(0.25),
            vt_extra: Some(false),
            ..matte("turned").textured(turned)
        },
        Material {
            transmission: 0.75,
            transmission_texture: Some(data),
            ior: 1.33,
            specular: 0.5,
            specular_color: Vec3::new(1.0, 0.5, 0.25),
            specular_texture: Some(data),
            specular_color_texture: Some(color),
            roughness: 0.0,
            volume: Some(Volume {
                attenuation_color: Vec3::new(0.5, 0.25, 1.0),
                attenuation_distance: f32::INFINITY,
            }),
            ..matte("body")
        },
        Material {
            unlit: true,
            alpha_mode: AlphaMode::Blend,
            base_color: Vec4::new(0.2, 0.4, 0.6, 0.5),
            ..matte("unlit")
        },
    ];
    for (i, material) in materials.into_iter().enumerate() {
        let id = builder.material(material);
        builder.mesh(format!("square {i}"), shape::plane(Vec3::Z * i as f32, Vec3::X, Vec3::Y, 0.5), id);
    }
    let direction = Vec3::new(0.6, -0.8, 0.0);
    let position = Vec3::new(-1.0, 3.0, 0.25);
    for (name, kind) in [
        ("point", LightKind::Point { position, range: 7.5 }),
        ("sun", LightKind::Directional { direction }),
        (
            "spot",
            LightKind::Spot { position, direction, range: f32::INFINITY, inner_cos: 0.75, outer_cos: 0.5 },
        ),
    ] {
        builder.light(Light { name: name.into(), kind, intensity: Vec3::new(4.0, 2.0, 1.0) });
    }
    let flat = Projection::Orthographic { xmag: 2.0, ymag: 1.5 };
    builder.camera(Camera { projection: flat, ..Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO, 1.0) });
    let mut scene = builder.build().unwrap();
    assert_same(&scene, &round_trip(&scene));

    scene.origin = DVec3::new(1024.0, -512.0, 256.0);
    assert_same(&scene, &round_trip(&scene));
}
