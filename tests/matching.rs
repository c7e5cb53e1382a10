//! Which paths the corners of a leaf share does not depend on their order; equal corners share all of them.

mod common;

use glam::Vec3;
use proptest::{
    prelude::*,
    test_runner::{Config, TestRunner},
};
use vertex_tracing::{
    gpu::Uploads,
    options::{FilterMode, Options},
    plan::Plan,
    reconstruct::{
        bank::{self, Bank},
        nodes::{Corner, LeafNodes, Matcher},
        table::SceneTable,
    },
    refine::{mesh::Mesh, samples::Samples},
    scene::{View, demo::Demo},
    trace::{Settings, Tracer, sample::Context},
};

use common::TestGpu;

/// What a leaf is made of, whatever the order of its corners; colours rounded, since sums are in another order.
fn essence(leaf: &LeafNodes, order: [usize; 3]) -> (u32, bool, u32, bool, Vec<i64>) {
    let colors = order.into_iter().flat_map(|corner| leaf.comb[corner]);
    let rounded = |color: Vec3| color.to_array().map(|value| (f64::from(value) * 1e4).round() as i64);
    (leaf.count, leaf.defined, leaf.overflow, leaf.first.is_some(), colors.flat_map(rounded).collect())
}

#[test]
fn corners_match_in_any_order() {
    let gpu = TestGpu::open();
    for demo in [Demo::CupAndGlass, Demo::GlassBowl, Demo::MirrorAndWall] {
        let scene = demo.scene();
        let plan = Plan::new(&scene, &Options::default());
        let filter = FilterMode::default();
        let texels = plan.textures.bytes(&scene, filter) + bank::panorama_bytes(&scene);
        let mut uploads = Uploads::new(&gpu, "texture uploads", bank::staging_bytes(texels)).unwrap();
        let bank = Bank::new(&mut uploads, &scene, &plan.textures, filter).unwrap();
        let table = SceneTable::new(&scene, &plan.targets, &bank, false);
        let textures: Vec<u32> =
            scene.materials.iter().map(|material| bank.reference(material.base_color_texture)).collect();
        let settings = Settings::default();
        let matcher = Matcher {
            scene: &scene,
            targets: &plan.targets,
            table: &table,
            base_textures: &textures,
            room: 8,
            shadows: settings.shadows,
        };

        let tracer = Tracer::new(&scene);
        let view = View::new(&scene.cameras[0], 160, 128, scene.bounds());
        let context = Context {
            tracer: &tracer,
            targets: &plan.targets,
            settings: &settings,
            view: &view,
            pyramids: None,
        };
        let specular: Vec<u32> =
            (0..scene.geometry.faces.len() as u32).filter(|&face| scene.is_vt(face)).collect();
        let mesh = Mesh::new(&scene, &plan.topology, &view, &specular);
        let mut samples = Samples::default();
        samples.extend(&context, &mesh, None, |_| true);
        let corner = |vertex: usize| {
            let vertex = (vertex % samples.len()) as u32;
            let distance = view.distance_to(mesh.position(vertex));
            Corner { sample: samples.get(vertex), distance: Some(distance) }
        };

        let mut runner = TestRunner::new(Config::with_cases(256));
        let any = (any::<usize>(), any::<usize>(), any::<usize>(), 0..9_usize);
        let outcome = runner.run(&any, |(a, b, c, room)| {
            let corners = [corner(a), corner(b), corner(c)];
            let leaf = matcher.leaf(corners, room);
            for order in [[1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]] {
                // Corner i of the turned leaf is corner order[i]: to look it up by the first's, turn back.
                let turned = matcher.leaf(order.map(|i| corners[i]), room);
                let back = [0, 1, 2].map(|i| order.iter().position(|&from| from == i).unwrap());
                prop_assert_eq!(essence(&turned, back), essence(&leaf, [0, 1, 2]));
            }

            let equal = matcher.leaf([corners[0]; 3], usize::MAX);
            prop_assert!(equal.defined && equal.overflow == 0, "a corner shares every path with itself");
            let paths = corners[0].sample.nodes.len() as u32;
            prop_assert!(equal.count + u32::from(equal.first.is_some()) <= paths);
            let few = matcher.leaf([corners[0]; 3], room);
            prop_assert_eq!(few.overflow as usize, corners[0].sample.nodes.len().saturating_sub(room));
            Ok(())
        });
        outcome.unwrap_or_else(|error| panic!("{}: {error}", demo.name()));
        drop((bank, uploads));
    }
    gpu.finish();
}
