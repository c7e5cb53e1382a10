//! The demo scenes keep every promise of `Scene`, show what their names say, and survive their files.

use bytemuck::cast_slice;
use glam::{Vec2, Vec3};
use gltf::Semantic::{Normals, Positions, TexCoords};
use vertex_tracing::scene::demo::{Demo, Mesh, SceneBuilder, chrome, glb, matte, shape, stress};
use vertex_tracing::scene::{Camera, Material, Scene, TextureSlot, View};

const SIZE: (u32, u32) = (1280, 1024);

fn scenes() -> Vec<Scene> {
    let mut scenes: Vec<Scene> = Demo::ALL.map(Demo::scene).into();
    scenes
        .extend([stress::quad(), stress::wavy_mirror(500), stress::mirror_ball_room(5)].map(Result::unwrap));
    scenes
}

fn view(scene: &Scene, width: u32, height: u32) -> View {
    View::new(&scene.cameras[0], width, height, scene.bounds())
}

/// Distance and face of the nearest two hits, by trying every face.
fn hits(scene: &Scene, origin: Vec3, direction: Vec3) -> Vec<(f32, u32)> {
    let mut hits: Vec<(f32, u32)> = (0..scene.geometry.faces.len() as u32)
        .filter_map(|face| {
            let [a, b, c] = scene.geometry.corners(face);
            let (ab, ac) = (b - a, c - a);
            let p = direction.cross(ac);
            let scale = ab.dot(p).recip();
            let u = (origin - a).dot(p) * scale;
            let q = (origin - a).cross(ab);
            let (v, t) = (direction.dot(q) * scale, ac.dot(q) * scale);
            (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-4).then_some((t, face))
        })
        .collect();
    hits.sort_by(|a, b| a.0.total_cmp(&b.0));
    hits.truncate(2);
    hits
}

/// The bytes of a tightly packed accessor.
fn bytes_of<'a>(accessor: &gltf::Accessor<'_>, buffer: &'a [u8]) -> &'a [u8] {
    let start = accessor.view().unwrap().offset() + accessor.offset();
    &buffer[start..start + accessor.count() * accessor.size()]
}

fn object(scene: &Scene, face: u32) -> &str {
    &scene.objects[scene.geometry.face_objects[face as usize] as usize].name
}

/// Rays through the centres of a coarse grid of pixels.
fn camera_rays(scene: &Scene, columns: u32, rows: u32) -> Vec<(Vec3, Vec3)> {
    let view = view(scene, columns, rows);
    (0..columns * rows)
        .map(|i| view.ray(Vec2::new((i % columns) as f32 + 0.5, (i / columns) as f32 + 0.5)))
        .collect()
}

#[test]
fn scenes_are_valid() {
    for scene in scenes() {
        let (geometry, name) = (&scene.geometry, &scene.name);
        assert!(!scene.cameras.is_empty() && !scene.lights.is_empty(), "{name}");
        assert_eq!(geometry.normals.len(), geometry.positions.len(), "{name}");
        assert!(geometry.uvs[0].is_empty() || geometry.uvs[0].len() == geometry.positions.len(), "{name}");
        let (mut face_end, mut vertex_end) = (0, 0);
        for (index, object) in scene.objects.iter().enumerate() {
            assert_eq!(
                (object.faces.start, object.vertices.start),
                (face_end, vertex_end),
                "{name}: {}",
                object.name
            );
            (face_end, vertex_end) = (object.faces.end, object.vertices.end);
            assert!((object.material as usize) < scene.materials.len());
            for face in object.faces.clone() {
                assert_eq!(geometry.face_objects[face as usize], index as u32);
                assert!(geometry.faces[face as usize].iter().all(|v| object.vertices.contains(v)));
                let normal = geometry.area_normal(face);
                assert!(normal.length() > 1e-7, "{name}: {} has a degenerate face {face}", object.name);
                for vertex in geometry.faces[face as usize] {
                    let shading = geometry.normals[vertex as usize];
                    assert!((shading.length() - 1.0).abs() < 1e-5);
                    let cosine = shading.dot(normal.normalize());
                    assert!(cosine > 0.2, "{name}: {} face {face}: normals disagree, {cosine}", object.name);
                }
            }
        }
        assert_eq!(
            (face_end as usize, vertex_end as usize),
            (geometry.faces.len(), geometry.positions.len())
        );
    }
}

#[test]
fn specular_objects_are_classified() {
    for demo in Demo::ALL {
        let scene = demo.scene();
        let specular: Vec<&str> = scene.objects.iter().filter(|o| o.vt).map(|o| o.name.as_str()).collect();
        let expected: &[&str] = match demo {
            Demo::Cup => &["cup"],
            Demo::CupAndGlass => &["cup", "wine glass"],
            Demo::PolishedTable => &["floor", "cup"],
            Demo::Mirror | Demo::MirrorAndWall => &["mirror"],
            Demo::Sphere => &["sphere"],
            Demo::GlassBowl => &["glass sphere", "glass bowl"],
        };
        assert_eq!(specular, expected, "{}", demo.name());
    }
    let cup = Demo::Cup.scene().vt_faces();
    assert!((2_200..=2_600).contains(&cup), "the paper's cup has about 2,400 faces, this one {cup}");
    assert_eq!(Demo::Mirror.scene().vt_faces(), 2);
    assert!(stress::wavy_mirror(5_000).unwrap().vt_faces() >= 5_000);
}

#[test]
fn no_ray_sees_the_void_or_two_faces_at_once() {
    for scene in Demo::ALL.map(Demo::scene) {
        for (origin, direction) in camera_rays(&scene, 30, 24) {
            let hits = hits(&scene, origin, direction);
            assert!(!hits.is_empty(), "{}: nothing in direction {direction}", scene.name);
            if let [(near, a), (far, b)] = hits[..]
                && object(&scene, a) != object(&scene, b)
            {
                assert!(
                    far - near > 1e-4,
                    "{}: {} and {} coincide",
                    scene.name,
                    object(&scene, a),
                    object(&scene, b)
                );
            }
        }
    }
}

#[test]
fn the_cup_fills_a_third_of_the_image() {
    let scene = Demo::Cup.scene();
    let rays = camera_rays(&scene, 60, 48);
    let seen = rays
        .iter()
        .filter(|(o, d)| hits(&scene, *o, *d).first().is_some_and(|hit| scene.is_vt(hit.1)))
        .count();
    let share = seen as f32 / rays.len() as f32;
    assert!((0.28..0.38).contains(&share), "{share}");
    let view = view(&scene, SIZE.0, SIZE.1);
    let cup = scene.objects.iter().find(|object| object.name == "cup").unwrap();
    for vertex in cup.vertices.clone() {
        let (pixel, _) = view.project(scene.geometry.positions[vertex as usize]).unwrap();
        assert!(pixel.cmpge(Vec2::ZERO).all() && pixel.x < 1280.0 && pixel.y < 1024.0, "cut off at {pixel}");
    }
}

#[test]
fn mirrors_show_what_their_names_say() {
    for (demo, expected) in
        [(Demo::Mirror, &["floor"][..]), (Demo::MirrorAndWall, &["back wall", "floor", "side walls"])]
    {
        let scene = demo.scene();
        let mut seen: Vec<&str> = Vec::new();
        for (origin, direction) in camera_rays(&scene, 160, 128) {
            let [(t, face), ..] = hits(&scene, origin, direction)[..] else { panic!("void") };
            if object(&scene, face) == "mirror" {
                let reflected = direction.reflect(scene.geometry.area_normal(face).normalize());
                let target = hits(&scene, origin + direction * t, reflected)[0].1;
                // The frame's inner edge shows at the border of the mirror.
                if object(&scene, target) != "frame" {
                    seen.push(object(&scene, target));
                }
            }
        }
        assert!(seen.len() > 2_000, "{}: only {} rays meet the mirror", demo.name(), seen.len());
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen, expected, "{}", demo.name());
    }
}

#[test]
fn builder_refuses_what_is_not_valid() {
    let triangle = || Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        normals: vec![Vec3::Z; 3],
        uvs: Vec::new(),
        faces: vec![[0, 1, 2]],
    };
    let build = |mesh: Mesh| {
        let mut scene = SceneBuilder::new("test");
        let material = scene.material(Material::default());
        scene.mesh("thing", mesh, material);
        scene.build()
    };
    assert!(build(triangle()).is_ok());
    for (spoil, message) in [
        (
            (|m| m.faces.push([0, 1, 3])) as fn(&mut Mesh),
            "test: mesh thing: face 1 names a vertex that is not there",
        ),
        (|m| m.faces.push([0, 1, 1]), "test: mesh thing: face 1 is degenerate"),
        (|m| m.positions[2].y = f32::NAN, "test: mesh thing: position 2 is not finite"),
        (|m| m.normals[1] = Vec3::ZERO, "test: mesh thing: normal 1 is zero or not finite"),
        (
            |m| m.uvs = vec![Vec2::ZERO],
            "test: mesh thing: positions, normals and texture coordinates differ in number",
        ),
    ] {
        let mut mesh = triangle();
        spoil(&mut mesh);
        assert_eq!(build(mesh).unwrap_err().to_string(), message);
    }

    let mut scene = SceneBuilder::new("test");
    let slot = TextureSlot { texture: 0, uv_set: 0, transform: glam::Affine2::IDENTITY };
    let material = scene.material(matte("red").textured(slot));
    assert_eq!(
        scene.build().unwrap_err().to_string(),
        "test: material red: its texture is not of this builder"
    );
    let mut other = SceneBuilder::new("test");
    other.mesh("thing", triangle(), material);
    assert!(other.build().unwrap_err().to_string().contains("its material is not of this builder"));
}

#[test]
fn files_hold_the_scene() {
    for scene in scenes() {
        let bytes = glb::encode(&scene).unwrap();
        let (file, buffers, images) =
            gltf::import_slice(&bytes).unwrap_or_else(|e| panic!("{}: {e}", scene.name));
        let geometry = &scene.geometry;
        let nodes: Vec<_> = file.default_scene().unwrap().nodes().collect();
        for (object, node) in scene.objects.iter().zip(&nodes) {
            assert_eq!(node.name(), Some(object.name.as_str()));
            let primitive = node.mesh().unwrap().primitives().next().unwrap();
            assert_eq!(primitive.material().index(), Some(object.material as usize));
            let read = |semantic| primitive.get(&semantic).map(|accessor| bytes_of(&accessor, &buffers[0]));
            let vertices = object.vertices.start as usize..object.vertices.end as usize;
            assert_eq!(read(Positions), Some(cast_slice(&geometry.positions[vertices.clone()])));
            assert_eq!(read(Normals), Some(cast_slice(&geometry.normals[vertices.clone()])));
            match read(TexCoords(0)) {
                Some(uvs) => assert_eq!(uvs, cast_slice::<Vec2, u8>(&geometry.uvs[0][vertices])),
                None => assert!(vertices.clone().all(|v| geometry.uv(0, v as u32) == Vec2::ZERO)),
            }
            let indices = primitive.indices().unwrap();
            let short = indices.data_type() == gltf::accessor::DataType::U16;
            let index =
                |bytes: &[u8]| bytes.iter().rev().fold(0, |index, &byte| index << 8 | u32::from(byte));
            let indices = bytes_of(&indices, &buffers[0]).chunks(if short { 2 } else { 4 }).map(index);
            let faces = &geometry.faces[object.faces.start as usize..object.faces.end as usize];
            assert!(faces.iter().flatten().map(|v| v - object.vertices.start).eq(indices));
        }
        for (ours, theirs) in scene.materials.iter().zip(file.materials()) {
            let pbr = theirs.pbr_metallic_roughness();
            assert_eq!(pbr.base_color_factor(), ours.base_color.to_array());
            assert_eq!((pbr.metallic_factor(), pbr.roughness_factor()), (ours.metallic, ours.roughness));
            assert_eq!(theirs.transmission().map_or(0.0, |t| t.transmission_factor()), ours.transmission);
            assert_eq!(theirs.specular().map_or(1.0, |s| s.specular_factor()), ours.specular);
            let volume = theirs.volume().map(|v| (v.attenuation_color(), v.attenuation_distance()));
            assert_eq!(volume, ours.volume.map(|v| (v.attenuation_color.to_array(), v.attenuation_distance)));
            assert_eq!(
                pbr.base_color_texture().map(|t| t.texture().index()),
                ours.base_color_texture.map(|t| t.texture as usize)
            );
        }
        for (ours, theirs) in scene.images.iter().zip(&images) {
            assert_eq!((theirs.width, theirs.height), (ours.width, ours.height));
            assert!(
                theirs.pixels.chunks(3).zip(ours.rgba.chunks(4)).all(|(a, b)| a == &b[..3]),
                "{}",
                ours.name
            );
        }
        assert_eq!(file.lights().unwrap().count(), scene.lights.len());
        let matrix = nodes[scene.objects.len()].transform().matrix();
        assert_eq!(Vec3::from_slice(&matrix[3]), scene.cameras[0].position);
        assert_eq!(-Vec3::from_slice(&matrix[2]), scene.cameras[0].forward);
        assert_eq!(file.materials().len(), scene.materials.len());
    }
}

#[test]
fn the_asset_is_the_demo() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/cup.glb");
    let (file, buffers, images) =
        gltf::import(path).expect("cargo run --release --example demo_assets -- assets cup");
    let scene = Demo::Cup.scene();
    let mut read = Vec::new();
    for mesh in file.meshes() {
        let primitive = mesh.primitives().next().unwrap();
        let positions = bytes_of(&primitive.get(&Positions).unwrap(), &buffers[0]);
        read.extend(positions.chunks(12).map(bytemuck::pod_read_unaligned::<Vec3>));
    }
    assert_eq!(read.len(), scene.geometry.positions.len(), "write it anew");
    // Sines differ in the last bit between platforms.
    assert!(read.iter().zip(&scene.geometry.positions).all(|(a, b)| a.distance(*b) < 1e-5), "write it anew");
    for (image, ours) in images.iter().zip(&scene.images) {
        let off = image.pixels.chunks(3).zip(ours.rgba.chunks(4)).filter(|(a, b)| *a != &b[..3]).count();
        assert!(off < 100, "{} differs at {off} texels: write it anew", ours.name);
    }
}

#[test]
fn a_name_finds_its_demo() {
    for demo in Demo::ALL {
        assert_eq!(Demo::by_name(demo.name()), Some(demo));
        assert_eq!(demo.scene().name, demo.name());
    }
    assert_eq!(Demo::by_name("teapot"), None);
}

#[test]
fn a_file_without_optional_parts_is_valid() {
    let mut scene = SceneBuilder::new("bare");
    let steel = scene.material(chrome("steel", Vec3::splat(0.5)));
    scene.mesh("ball", shape::sphere(Vec3::ZERO, 1.0, 0), steel);
    scene.camera(Camera::look_at(Vec3::Z * 4.0, Vec3::ZERO, 0.5));
    let file = gltf::Gltf::from_slice(&glb::encode(&scene.build().unwrap()).unwrap()).unwrap();
    assert_eq!((file.meshes().len(), file.textures().len(), file.images().len()), (1, 0, 0));
}

#[test]
fn the_asset_is_what_the_generator_writes() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/cup.glb");
    let written = std::fs::read(path).unwrap();
    let stale = "assets/cup.glb is stale: cargo run --release --example demo_assets -- assets cup";
    assert!(written == Demo::Cup.glb(), "{stale}");
}
