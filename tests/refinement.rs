//! Refinement without a device: invariants of the mesh, independence of the number of threads.

use glam::Vec2;
use proptest::prelude::*;
use vertex_tracing::{
    options::{EffortOptions, Reconstruction},
    refine::{Refiner, STOP_SIZE, mesh::Mesh, predict::Predictor, shown::Shown, structure::Structure},
    scene::{Camera, Scene, View, demo::Demo, patch::Targets, topology::Topology},
    trace::{Settings, Tracer, sample::Context},
    visibility::IdImage,
};

fn view(scene: &Scene) -> View {
    View::new(&scene.cameras[0], 160, 128, scene.bounds())
}

/// The ID buffer by ray casting.
fn ids(tracer: &Tracer, view: &View) -> Vec<u32> {
    let pixel = |i: usize| {
        let centre = Vec2::new((i as u32 % view.width) as f32, (i as u32 / view.width) as f32) + 0.5;
        let (origin, direction) = view.ray(centre);
        tracer.closest(origin, direction).map_or(0, |hit| hit.face + 1)
    };
    (0..view.pixels()).map(pixel).collect()
}

fn seeds(ids: &[u32]) -> Vec<u32> {
    let mut faces: Vec<u32> = ids.iter().filter_map(|id| id.checked_sub(1)).collect();
    faces.sort_unstable();
    faces.dedup();
    faces
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever is bisected in whatever order, the mesh stays conforming and halves fill their faces.
    #[test]
    fn bisection_conforms(demo in 0..Demo::ALL.len(), picks in prop::collection::vec(any::<u32>(), 1..200)) {
        let scene = Demo::ALL[demo].scene();
        let tracer = Tracer::new(&scene);
        let view = view(&scene);
        let topology = Topology::new(&scene.geometry);
        let mut mesh = Mesh::new(&scene, &topology, &view, &seeds(&ids(&tracer, &view)));
        for pick in picks {
            let face = pick % mesh.faces.len() as u32;
            let was_leaf = mesh.faces[face as usize].is_leaf();
            let mut splits = Vec::new();
            mesh.bisect(face, &mut splits);
            prop_assert_eq!(was_leaf, !splits.is_empty());
        }
        mesh.validate();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever is united, the mesh stays conforming, and what was not chosen stays as it was.
    #[test]
    fn uniting_conforms(
        demo in 0..Demo::ALL.len(),
        picks in prop::collection::vec(any::<u32>(), 1..200),
        spared in prop::collection::vec(any::<u32>(), 0..8),
    ) {
        let scene = Demo::ALL[demo].scene();
        let tracer = Tracer::new(&scene);
        let view = view(&scene);
        let topology = Topology::new(&scene.geometry);
        let mut mesh = Mesh::new(&scene, &topology, &view, &seeds(&ids(&tracer, &view)));
        let unrefined = mesh.faces.len();
        for pick in picks {
            mesh.bisect(pick % mesh.faces.len() as u32, &mut Vec::new());
        }
        let leaves: Vec<u32> = mesh.leaves().collect();
        let spared: Vec<u32> = spared.iter().map(|pick| leaves[*pick as usize % leaves.len()]).collect();
        let mut chosen = vec![false; mesh.faces.len()];
        leaves.iter().for_each(|&face| chosen[face as usize] = !spared.contains(&face));
        mesh.unite(&mut chosen, |_, _, _, [left, right]| (left && right).then_some(true));
        mesh.validate();
        prop_assert!(mesh.leaves().all(|face| chosen[face as usize] != spared.contains(&face)));
        prop_assert!(spared.iter().all(|&face| mesh.faces[face as usize].is_leaf()));
        if spared.is_empty() {
            prop_assert_eq!(mesh.leaves().count(), unrefined);
        }
        for face in mesh.leaves().collect::<Vec<_>>() {
            mesh.bisect(face, &mut Vec::new());
        }
        mesh.validate();
    }
}

#[test]
fn every_point_of_a_face_has_its_leaf() {
    let scene = Demo::Cup.scene();
    let tracer = Tracer::new(&scene);
    let view = view(&scene);
    let topology = Topology::new(&scene.geometry);
    let ids = ids(&tracer, &view);
    let mut mesh = Mesh::new(&scene, &topology, &view, &seeds(&ids));
    for face in 0..2000 {
        mesh.bisect(face % mesh.faces.len() as u32, &mut Vec::new());
    }
    let mut strays = 0;
    for (index, id) in ids.iter().enumerate() {
        let Some(base) = id.checked_sub(1) else { continue };
        let centre = Vec2::new((index as u32 % view.width) as f32, (index as u32 / view.width) as f32) + 0.5;
        let (_, direction) = view.ray(centre);
        let leaf = mesh.leaf_at(base, direction).expect("a seeded face has leaves");
        assert!(mesh.faces[leaf as usize].is_leaf());
        let corners = mesh.faces[leaf as usize].corners.map(|v| view.project(mesh.position(v)).unwrap().0);
        let side = |a: Vec2, b: Vec2| (b - a).perp_dot(centre - a);
        let [a, b, c] = corners;
        let signs = [side(a, b), side(b, c), side(c, a)];
        let slack = 1e-2 * (b - a).length().max((c - a).length());
        strays += u32::from(!(signs.iter().all(|&s| s >= -slack) || signs.iter().all(|&s| s <= slack)));
    }
    assert_eq!(strays, 0, "pixels outside of the leaf that was found for them");
}

/// What refining on `threads` threads leaves behind.
#[derive(Debug, PartialEq)]
struct Refined {
    faces_before: usize,
    positions: Vec<glam::Vec3>,
    leaves: Vec<[u32; 3]>,
    /// Leaves before they were united.
    refined: usize,
    rays: u64,
}

/// Refines what `view` shows of `scene` to the default error, and hands it on with the number of faces before.
fn refine<T>(scene: &Scene, view: &View, look: impl FnOnce(&mut Refiner, usize) -> T) -> T {
    let tracer = Tracer::new(scene);
    let topology = Topology::new(&scene.geometry);
    let targets = Targets::new(scene, &topology);
    let structures = Structure::all(scene);
    let ids = ids(&tracer, view);
    let settings = Settings::default();
    let context = Context { tracer: &tracer, targets: &targets, settings: &settings, view, pyramids: None };
    let predictor = Predictor {
        targets: &targets,
        structures: &structures,
        scene,
        view,
        reconstruction: Reconstruction::Exact,
        shaft_guard: true,
    };
    let mesh = Mesh::new(scene, &topology, view, &seeds(&ids));
    let image = IdImage { width: view.width, height: view.height, pixels: &ids };
    let mut counts = vec![0; scene.geometry.faces.len()];
    let faces = (0..view.height).flat_map(|y| (0..view.width).map(move |x| (x, y)));
    faces.filter_map(|(x, y)| image.face(x, y)).for_each(|face| counts[face as usize] += 1);
    let faces_before = mesh.faces.len();
    let mut refiner =
        Refiner::new(&context, &predictor, mesh, Shown { counts: &counts, ids: Some(image) }, None);
    let effort = EffortOptions::default();
    refiner.run(&effort, std::time::Instant::now(), |_| Ok::<_, ()>(())).unwrap();
    refiner.mesh.validate();
    look(&mut refiner, faces_before)
}

fn refined(threads: usize) -> Refined {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let scene = Demo::CupAndGlass.scene();
    let look = |refiner: &mut Refiner, faces_before| {
        let refined = refiner.mesh.leaves().count();
        refiner.unite();
        let mesh = &refiner.mesh;
        mesh.validate();
        let united = mesh.leaves().count();
        assert!(united < refined * 9 / 10, "{refined} leaves, {united} once united");
        assert!(refiner.pixel_faces.iter().all(|&face| mesh.faces[face as usize].is_leaf()));
        let leaves = mesh.leaves().map(|face| mesh.faces[face as usize].corners).collect();
        Refined {
            faces_before,
            refined,
            positions: mesh.points.clone(),
            leaves,
            rays: refiner.samples.rays.total(),
        }
    };
    pool.install(|| refine(&scene, &view(&scene), look))
}

/// A mirror ball of a few hundred faces, as many pixels in radius, above a chessboard.
fn ball(radius: f32) -> (Scene, View) {
    use glam::{Vec3, vec3};
    use vertex_tracing::scene::demo::{SceneBuilder, chrome, matte, shape, texture};
    let mut builder = SceneBuilder::new("ball");
    let boards = builder.texture(texture::chessboard(64));
    let floor = builder.material(matte("floor").textured(boards));
    builder.mesh("floor", shape::plane(vec3(-9.0, -2.0, 9.0), Vec3::X * 18.0, Vec3::Z * -18.0, 1.0), floor);
    let mirror = builder.material(chrome("mirror", Vec3::ONE));
    builder.mesh("ball", shape::sphere(Vec3::ZERO, 1.0, 2), mirror);
    let angle = 2.0 * (512.0 * 0.1 / radius).atan();
    builder.camera(Camera::look_at(Vec3::Z * 10.0, Vec3::ZERO, angle));
    let scene = builder.build().unwrap();
    let view = View::new(&scene.cameras[0], 1280, 1024, scene.bounds());
    (scene, view)
}

/// Faces that would be bisected once more only for their halves to be traced are traced as they are.
#[test]
fn hopeless_faces_are_not_bisected_first() {
    let leaves = |refiner: &Refiner, scene: &Scene| {
        let mesh = &refiner.mesh;
        mesh.leaves().filter(|&face| scene.is_vt(mesh.faces[face as usize].base)).collect::<Vec<u32>>()
    };
    let (scene, view) = ball(84.0);
    refine(&scene, &view, |refiner, _| {
        let (leaves, mesh) = (leaves(refiner, &scene), &refiner.mesh);
        assert!(leaves.iter().all(|&face| mesh.faces[face as usize].level == 0), "nothing is bisected");
        let large: Vec<u32> = leaves.into_iter().filter(|&face| mesh.size(face) > STOP_SIZE).collect();
        assert!(large.len() > 50, "{} are too large to be traced for their size", large.len());
        assert!(large.iter().all(|face| refiner.pixel_faces.contains(face)), "all of them are traced");
    });
    // Of larger faces the halves are looked at.
    let (scene, view) = ball(240.0);
    refine(&scene, &view, |refiner, _| {
        let bisected =
            leaves(refiner, &scene).into_iter().filter(|&face| refiner.mesh.faces[face as usize].level > 0);
        assert!(bisected.count() > 200);
    });
}

#[test]
fn refinement_does_not_depend_on_threads() {
    let one = refined(1);
    assert!(one.refined > 2 * one.faces_before, "{} faces became {} leaves", one.faces_before, one.refined);
    assert_eq!(one, refined(2));
    assert_eq!(one, refined(7));
}

#[test]
fn one_midpoint_for_both_sides_of_a_seam() {
    // The cylinder-like cup body has faces that share positions; a quad of two faces with different normals
    // shares an edge by position alone.
    use vertex_tracing::scene::demo::{SceneBuilder, matte, shape};
    let mut builder = SceneBuilder::new("seam");
    let material = builder.material(matte("white"));
    let left = shape::plane(glam::vec3(-1.0, 0.0, 0.0), glam::Vec3::X, glam::Vec3::Y, 1.0);
    let mut right = shape::plane(glam::vec3(0.0, 0.0, 0.0), glam::Vec3::X, glam::Vec3::Y, 1.0);
    right.normals.iter_mut().for_each(|n| *n = glam::vec3(0.6, 0.0, 0.8));
    builder.mesh("both", left.merged(&right), material);
    builder.camera(Camera::look_at(glam::vec3(0.0, 0.5, 3.0), glam::vec3(0.0, 0.5, 0.0), 0.7));
    let scene = builder.build().unwrap();
    let topology = Topology::new(&scene.geometry);
    let view = view(&scene);
    let mut mesh = Mesh::new(&scene, &topology, &view, &[0, 1, 2, 3]);
    let points = mesh.points.len();
    assert_eq!((points, mesh.vertices.len()), (6, 8), "the seam's two points have two vertices each");
    for round in 0..6 {
        for face in 0..mesh.faces.len() as u32 {
            mesh.bisect(face, &mut Vec::new());
        }
        mesh.validate();
        assert!(mesh.points.len() > points, "round {round} made new points");
    }
    let on_seam: Vec<u32> =
        (0..mesh.points.len() as u32).filter(|&p| mesh.points[p as usize].x == 0.0).collect();
    for point in on_seam {
        let sides = mesh.vertices.iter().filter(|vertex| vertex.point == point).count();
        assert_eq!(sides, 2, "a point of the seam has a vertex for each side");
    }
}

#[test]
fn faces_without_number_around_one_edge_are_not_bisected_together() {
    use vertex_tracing::scene::demo::{SceneBuilder, matte, shape};
    let mut builder = SceneBuilder::new("pile");
    let material = builder.material(matte("white"));
    let sheet = shape::plane(glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y, 1.0);
    for _ in 0..100 {
        builder.mesh("sheet", sheet.clone(), material);
    }
    builder.camera(Camera::look_at(glam::vec3(0.5, 0.5, 3.0), glam::vec3(0.5, 0.5, 0.0), 0.7));
    let scene = builder.build().unwrap();
    let (topology, view) = (Topology::new(&scene.geometry), view(&scene));
    let seeds: Vec<u32> = (0..200).collect();
    let mut mesh = Mesh::new(&scene, &topology, &view, &seeds);
    let mut splits = Vec::new();
    mesh.bisect(0, &mut splits);
    assert!(splits.len() < 40, "{} of 200 faces around one edge", splits.len());
    for _ in 0..3 {
        (0..mesh.faces.len() as u32).for_each(|face| mesh.bisect(face, &mut splits));
        mesh.validate();
    }
}

#[test]
fn bisection_ends_where_coordinates_do() {
    // Far from zero, where two neighbouring numbers are two units apart, and seen from close by. The face on the
    // other side keeps the scene's centre between them.
    use vertex_tracing::scene::demo::{SceneBuilder, matte, shape};
    let far = 24_934_666.0;
    let mut builder = SceneBuilder::new("coarse");
    let material = builder.material(matte("white"));
    let mut near = shape::plane(glam::vec3(far, 0.0, 1.0), glam::Vec3::Y, glam::Vec3::NEG_Z, 1.0);
    near.positions[2] = glam::vec3(far + 2.0, 0.034, 0.969);
    let other = shape::plane(glam::vec3(-far, 0.0, 0.0), glam::Vec3::Y, glam::Vec3::Z, 1.0);
    builder.mesh("both", near.merged(&other), material);
    let camera = Camera::look_at(glam::vec3(far + 6.0, 1.1, 0.0), glam::vec3(far, 0.4, 0.5), 0.7);
    builder.camera(camera);
    let scene = builder.build().unwrap();
    let topology = Topology::new(&scene.geometry);
    let view = view(&scene);
    let mut mesh = Mesh::new(&scene, &topology, &view, &[0, 1]);
    for _ in 0..200 {
        let large: Vec<u32> = mesh.leaves().filter(|&face| mesh.size(face) > 3.5).collect();
        large.iter().for_each(|&face| mesh.bisect(face, &mut Vec::new()));
        assert!(mesh.faces.len() < 1000, "bisected without end");
        if large.is_empty() {
            return;
        }
    }
    panic!("bisected without end");
}
