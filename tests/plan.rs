//! What a plan leaves out is not there: objects, bytes, rays and passes against the same frame with everything.

mod common;
#[path = "../examples/ladder/measure.rs"]
mod measure;
#[path = "../examples/ladder/rungs.rs"]
mod rungs;

use std::time::{Duration, Instant};

use common::TestGpu;
use glam::{Vec3, vec3, vec4};
use measure::{Counts, Taken, plain, take, take_scene};
use rungs::Rung;
use vertex_tracing::{
    constants::{COMPONENT_PRIMARY, COMPONENT_REFLECTED},
    gpu::census::Kind,
    options::{Mode, Msaa, Options, Ss},
    plan::{Plan, Summary},
    report::metrics::{Encoding, compare},
    scene::{
        AlphaMode, Camera, Material, Sampler, Scene, Unread,
        demo::{SceneBuilder, chrome, glass, matte, shape, texture},
    },
};

const SIZE: (u32, u32) = (96, 80);

fn measured(rung: Rung, everything: bool) -> Taken {
    let gpu = TestGpu::open();
    let taken = take(&gpu, rung, everything, SIZE, 1).unwrap();
    gpu.finish();
    taken
}

/// Names of all buffers, images and pipelines that were created.
fn names(taken: &Taken) -> Vec<&str> {
    [Kind::Buffer, Kind::Image, Kind::Pipeline]
        .into_iter()
        .flat_map(|kind| taken.census.names(kind))
        .collect()
}

fn left_out(plan: &Plan, what: &str) -> bool {
    plan.left_out.iter().any(|left_out| left_out.what.contains(what))
}

#[test]
fn the_ladder_costs_what_it_uses_and_looks_the_same() {
    let mut last = Counts::default();
    for rung in Rung::ALL {
        let (planned, everything) = (measured(rung, false), measured(rung, true));
        let name = rung.name();
        println!("{name}: {:?} of {:?}", planned.counts, everything.counts);
        let compared = compare(&everything.image, &planned.image, None, Encoding::Srgb).unwrap();
        // A face drawn as a leaf interpolates in another order than one drawn without samples.
        assert!(compared.max < 0.02 && compared.rmse < 1e-3, "{name}: {compared:?}");
        let (less, more) = (planned.counts, everything.counts);
        for (less, more) in [
            (less.pipelines, more.pipelines),
            (less.buffers, more.buffers),
            (less.images, more.images),
            (less.samplers, more.samplers),
            (less.bytes, more.bytes),
            (planned.rays, everything.rays),
            (planned.samples, everything.samples),
        ] {
            assert!(less <= more, "{name}: {less} planned, {more} with everything");
        }
        let plan = Plan::new(&rung.scene().unwrap(), &rung.options(SIZE));
        assert_eq!(plan.traces(), !rung.is_plain(), "{name}");
        assert_eq!(planned.rays > 0, plan.traces(), "{name}");
        if rung.is_plain() {
            assert!(less.buffers < more.buffers && less.images < more.images && less.bytes < more.bytes);
            assert!(planned.samples == 0 && everything.samples > 0 || rung < Rung::Lights, "{name}");
            assert!(!names(&planned).iter().any(|name| name.contains("ID buffer")), "{:?}", names(&planned));
            assert!(names(&everything).iter().any(|name| name.contains("ID buffer")));
        }
        // Apart from glass in the mirror's place, every rung needs what those below it need.
        assert!(
            less.bytes >= last.bytes || rung == Rung::Glass || rung == Rung::Lights,
            "{name}: {} bytes after {}",
            less.bytes,
            last.bytes
        );
        last = less;
    }
}

#[test]
fn without_specular_objects_a_frame_is_plain_rasterising() {
    for rung in Rung::ALL.into_iter().filter(|rung| rung.is_plain()) {
        let planned = measured(rung, false);
        let gpu = TestGpu::open();
        let plain = plain(&gpu, rung, SIZE, 1).unwrap();
        gpu.finish();
        assert_eq!(planned.counts.pipelines, plain.counts.pipelines, "{}", rung.name());
        assert_eq!(planned.counts.images, plain.counts.images);
        assert_eq!(planned.counts.samplers, plain.counts.samplers);
        assert!(planned.counts.buffers as f64 <= 1.1 * plain.counts.buffers as f64, "{:?}", names(&planned));
        assert!(planned.counts.bytes as f64 <= 1.1 * plain.counts.bytes as f64, "{:?}", planned.counts);
        assert_eq!(planned.image.pixels, plain.image.pixels);
    }
}

#[test]
fn the_cost_told_without_a_device_is_the_cost_on_it() {
    for rung in Rung::ALL {
        for everything in [false, true] {
            let scene = rung.scene().unwrap();
            let options = Options { everything, ..rung.options(SIZE) };
            assert_costs(&scene, &options, &format!("{}, {everything}", rung.name()));
        }
    }
    let scene = Rung::All.scene().unwrap();
    for (ss, msaa) in [(Ss::One, Msaa::Four), (Ss::Four, Msaa::One), (Ss::Sixteen, Msaa::Four)] {
        let mut options = Rung::All.options(SIZE);
        (options.method.ss, options.method.msaa) = (ss, msaa);
        assert_costs(&scene, &options, &format!("ss {ss}, msaa {msaa}"));
    }
}

fn assert_costs(scene: &Scene, options: &Options, what: &str) {
    let cost = Plan::new(scene, options).cost(scene, options);
    let gpu = TestGpu::open();
    let census = take_scene(&gpu, scene, options, 1).unwrap().census;
    gpu.finish();
    for resource in cost.resources.iter().filter(|resource| !resource.objects.is_empty()) {
        let bytes: u64 = resource
            .objects
            .iter()
            .map(|name| census.named(Kind::Buffer, name).bytes + census.named(Kind::Image, name).bytes)
            .sum();
        assert_eq!(bytes, resource.bytes, "{what}: {}", resource.what);
    }
}

/// A floor, a mirror, whatever `add` adds, and a camera.
fn scene_with(add: impl FnOnce(&mut SceneBuilder)) -> Scene {
    let mut scene = SceneBuilder::new("scene");
    let grey = scene.material(matte("grey").colored(Vec3::splat(0.5)));
    scene.mesh("floor", shape::plane(vec3(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::NEG_Z * 4.0, 1.0), grey);
    let metal = scene.material(chrome("metal", Vec3::splat(0.8)));
    scene.mesh("mirror", shape::plane(vec3(-1.0, 0.0, -1.0), Vec3::X * 2.0, Vec3::Y * 2.0, 1.0), metal);
    add(&mut scene);
    scene.point_light(vec3(1.0, 3.0, 2.0), Vec3::splat(20.0));
    scene.camera(Camera::look_at(vec3(0.5, 1.0, 3.0), vec3(0.0, 0.7, 0.0), 0.8));
    scene.build().unwrap()
}

fn options() -> Options {
    Rung::All.options(SIZE)
}

#[test]
fn a_mirror_alone_needs_one_bounce_and_two_face_each_other() {
    let single = scene_with(|_| {});
    let plan = Plan::new(&single, &options());
    assert_eq!(plan.depth, 1);
    assert!(left_out(&plan, "more than one bounce"));
    let facing = scene_with(|scene| {
        let metal = scene.material(chrome("other metal", Vec3::splat(0.8)));
        let other = shape::plane(vec3(1.0, 0.0, 2.5), Vec3::NEG_X * 2.0, Vec3::Y * 2.0, 1.0);
        scene.mesh("other mirror", other, metal);
    });
    assert_eq!(Plan::new(&facing, &options()).depth, options().paths.depth);
    let everything = Options { everything: true, ..options() };
    assert_eq!(Plan::new(&single, &everything).depth, everything.paths.depth);

    let gpu = TestGpu::open();
    let (planned, all) = (gpu.render(&single, &options()), gpu.render(&single, &everything));
    assert_eq!(planned.stats.rays, all.stats.rays);
    assert!(planned.image.pixels == all.image.pixels, "other pixels");
    gpu.finish();
}

/// A mirror with its lower left corner at `corner`, seen from the front alone.
fn mirror(scene: &mut SceneBuilder, corner: Vec3, right: Vec3, up: Vec3) {
    let metal = scene.material(chrome("other metal", Vec3::splat(0.8)));
    scene.mesh("other mirror", shape::plane(corner, right, up, 1.0), metal);
}

#[test]
fn mirrors_that_cannot_see_each_other_need_one_bounce() {
    // Beside the first, which faces +z from z = -1: what turns away from it, at an angle, back to back, and in its plane.
    let apart: [(&str, [Vec3; 3]); 3] = [
        ("turned away", [vec3(1.2, 0.0, -1.0), vec3(1.0, 0.0, -0.6), Vec3::Y]),
        ("back to back", [vec3(1.0, 0.0, -1.2), vec3(-2.0, 0.0, 0.0), Vec3::Y]),
        ("in one plane", [vec3(1.0, 0.0, -1.0), vec3(1.0, 0.0, 0.0), Vec3::Y]),
    ];
    for (name, [corner, right, up]) in apart {
        let scene = scene_with(|scene| mirror(scene, corner, right, up));
        assert_eq!(Plan::new(&scene, &options()).depth, 1, "{name}");
        let gpu = TestGpu::open();
        let everything = Options { everything: true, ..options() };
        let [planned, all] = [options(), everything].map(|options| gpu.render(&scene, &options));
        gpu.finish();
        assert_eq!(planned.stats.rays, all.stats.rays, "{name}");
        assert!(planned.image.pixels == all.image.pixels, "{name}: other pixels");
    }
    // In front of it; behind it, but seen from behind as well; with a common edge; and what is not flat.
    let glance = [vec3(1.2, 0.0, 0.0), vec3(0.5, 0.0, 0.5), Vec3::Y];
    let behind = apart[1].1;
    let edge = [vec3(1.0, 0.0, -1.0), vec3(1.0, 0.0, -0.6), Vec3::Y * 2.0];
    let depth = |scene: &Scene| Plan::new(scene, &options()).depth;
    for [corner, right, up] in [glance, edge] {
        let scene = scene_with(|scene| mirror(scene, corner, right, up));
        assert_eq!(depth(&scene), options().paths.depth, "{corner}");
    }
    let mut seen_from_behind = scene_with(|scene| mirror(scene, behind[0], behind[1], behind[2]));
    seen_from_behind.materials.iter_mut().for_each(|material| material.double_sided = true);
    assert_eq!(depth(&seen_from_behind), options().paths.depth);
    let round = scene_with(|scene| {
        let metal = scene.material(chrome("ball metal", Vec3::splat(0.8)));
        scene.mesh("ball", shape::sphere(vec3(0.0, 0.5, -2.0), 0.4, 1), metal);
    });
    assert_eq!(depth(&round), options().paths.depth);
}

/// The plan of `scene`, which must not cost the square of anything: that would take minutes.
fn soon(scene: &Scene) -> Plan {
    let start = Instant::now();
    let plan = Plan::new(scene, &options());
    assert!(start.elapsed() < Duration::from_secs(5), "{}: {:?}", scene.name, start.elapsed());
    plan
}

#[test]
fn a_flat_part_of_many_faces_too_small_for_a_patch_is_looked_at_once() {
    let small = shape::grid(Vec3::Y, Vec3::X * 0.01, Vec3::Z * 0.01, 1.0, 100, 100);
    let large = shape::plane(Vec3::ZERO, Vec3::X, Vec3::Y, 1.0);
    let many_faces = scene_with(|scene| {
        let plaster = scene.material(matte("plaster"));
        scene.mesh("wall with a flat part too small for a patch", large.merged(&small), plaster);
    });
    let targets = soon(&many_faces).targets;
    let of_small = targets.of(many_faces.geometry.faces.len() as u32 - 1);
    assert!(targets.targets[of_small as usize].patch.is_none(), "a part of a chart");
}

#[test]
fn a_mask_is_read_once_whatever_shows_it() {
    let many_masks = scene_with(|scene| {
        let leaf = scene.texture(texture::chessboard(1024));
        let leaf =
            scene.material(Material { alpha_mode: AlphaMode::Mask(0.5), ..matte("leaf").textured(leaf) });
        for index in 0..20_000 {
            scene.mesh("leaf", shape::plane(vec3(index as f32, 0.0, 9.0), Vec3::X, Vec3::Y, 1.0), leaf);
        }
    });
    soon(&many_masks);
}

#[test]
fn mirrors_are_not_held_against_each_other_in_pairs() {
    let many_mirrors = scene_with(|scene| {
        let metal = scene.material(chrome("metal of many", Vec3::splat(0.8)));
        for index in 0..20_000 {
            let corner = vec3(2.0 * index as f32, 0.0, -1.0);
            scene.mesh("tile", shape::plane(corner, Vec3::X, Vec3::Y, 1.0), metal);
        }
    });
    assert_eq!(soon(&many_mirrors).depth, 1, "all in one plane");
}

#[test]
fn without_lights_no_shadow_ray_is_in_the_plan() {
    let dark = |ambient: f32| {
        let mut scene = scene_with(|_| {});
        scene.lights.clear();
        scene.ambient = ambient;
        scene
    };
    let plan = Plan::new(&dark(0.0), &options());
    let why = |what: &str| plan.left_out.iter().find(|part| part.what == what).map(|part| part.why.as_str());
    assert_eq!(why("shadow rays"), Some("the scene has no light"));
    assert!(why("samples of diffuse objects").is_some() && !plan.receivers);
    let gpu = TestGpu::open();
    assert_eq!(gpu.render(&dark(0.0), &options()).stats.rays.shadow, 0);
    gpu.finish();
    // A file without lights is lit from the camera: that is a light.
    let mut lit = dark(0.3);
    let view = options().view.resolve(&lit).unwrap();
    lit.add_default_lights(&view);
    let plan = Plan::new(&lit, &options());
    assert!(plan.used.iter().any(|part| part.contains("light from the camera")), "{:?}", plan.used);
    assert!(plan.used.iter().any(|part| part == "shadow rays"));
}

#[test]
fn what_a_file_holds_besides_is_named_with_its_bytes() {
    let mut scene = scene_with(|_| {});
    let rest =
        Unread { what: "meshes", count: 2, of: 5, bytes: 1234, why: "no node of the scene shows them" };
    scene.unread.push(rest);
    for everything in [false, true] {
        let plan = Plan::new(&scene, &Options { everything, ..options() });
        assert!(left_out(&plan, "2 of 5 meshes of the file, 1234 bytes"));
    }
}

#[test]
fn passes_whose_colours_are_zero_are_left_out_of_the_frame() {
    let scene = scene_with(|_| {});
    let mut options = options();
    options.method.mode = Mode::MultiPass;
    let plan = Plan::new(&scene, &options);
    let (drawn, dropped) = plan.passes_for(COMPONENT_PRIMARY | COMPONENT_REFLECTED);
    assert_eq!(drawn.iter().map(|pass| pass.name).collect::<Vec<_>>(), ["primary", "reflected"]);
    assert_eq!(
        dropped.iter().map(|part| part.what.as_str()).collect::<Vec<_>>(),
        ["reflected combined pass"]
    );
    let everything = Plan::new(&scene, &Options { everything: true, ..options });
    assert!(everything.passes_for(0).1.is_empty());
}

#[test]
fn candidate_patches_need_something_flat_to_be_seen() {
    let flat = scene_with(|_| {});
    assert!(!left_out(&Plan::new(&flat, &options()), "candidate patches"));
    let mut round = SceneBuilder::new("round");
    let metal = round.material(chrome("metal", Vec3::splat(0.8)));
    let grey = round.material(matte("grey"));
    round.mesh("mirror", shape::sphere(Vec3::ZERO, 0.5, 2), metal);
    round.mesh("ball", shape::sphere(vec3(1.2, 0.0, 0.0), 0.4, 3), grey);
    round.camera(Camera::look_at(vec3(0.5, 1.0, 3.0), Vec3::ZERO, 0.8));
    let round = round.build().unwrap();
    assert!(left_out(&Plan::new(&round, &options()), "candidate patches"));
}

#[test]
fn textures_that_nothing_shows_are_not_uploaded() {
    let unused = scene_with(|scene| {
        scene.texture(texture::brick(128));
        // A texture on an emission of zero shows nothing either.
        let emissive = Some(scene.texture(texture::wood(64)));
        let dark =
            scene.material(vertex_tracing::scene::Material { emissive_texture: emissive, ..matte("dark") });
        scene.mesh("dark", shape::cuboid(vec3(1.0, 0.0, 0.0), vec3(1.2, 0.2, 0.2), 1.0), dark);
    });
    let plan = Plan::new(&unused, &options());
    assert_eq!(plan.textures.textures, [false, false]);
    assert!(left_out(&plan, "2 of 2 textures") && left_out(&plan, "emission texture"));
    let uploaded = |everything| {
        let gpu = TestGpu::open();
        let options = Options { everything, ..options() };
        let taken = take_scene(&gpu, &unused, &options, 1).unwrap();
        gpu.finish();
        taken.census.named(Kind::Image, "texture bank").bytes
    };
    assert_eq!(uploaded(false), 0);
    let level = |edge: u64| (0..=edge.ilog2()).map(|mip| 4 * (edge >> mip) * (edge >> mip)).sum::<u64>();
    assert_eq!(uploaded(true), level(128) + level(64), "all of them, with mip levels");
}

#[test]
fn mips_exist_where_a_sampler_asks_for_them() {
    for (mip, left) in [(Sampler::default().mip, false), (None, true)] {
        let scene = scene_with(|scene| {
            let sampler = Sampler { mip, ..Sampler::default() };
            let slot = scene.sampled_texture(texture::brick(64), sampler, true);
            let brick = scene.material(matte("brick").textured(slot));
            scene.mesh("box", shape::cuboid(vec3(1.0, 0.0, 0.0), vec3(1.2, 0.2, 0.2), 1.0), brick);
        });
        let plan = Plan::new(&scene, &options());
        assert_eq!(left_out(&plan, "mip levels"), left);
        assert_eq!(left_out(&plan, "filtering of pixels traced one by one"), left);
        let bytes = plan.textures.bytes(&scene, options().method.filter);
        assert_eq!(bytes > 4 * 64 * 64, !left, "{bytes}");
    }
}

/// Words of a vertex under the plan of `scene`, as `Kind::Buffer` counts its faces drawn without samples.
fn vertex_words(scene: &Scene, options: &Options) -> u32 {
    let layout = Plan::new(scene, options).vertex_layout();
    let gpu = TestGpu::open();
    let planned = take_scene(&gpu, scene, options, 1).unwrap();
    gpu.finish();
    let bytes = planned.census.named(Kind::Buffer, "base vertices").bytes;
    assert_eq!(bytes, scene.geometry.positions.len() as u64 * layout.bytes());
    layout.words
}

#[test]
fn vertices_have_the_attributes_that_are_needed() {
    let [position, normal, uv] = [3, 3, 2];
    let words = |rung: Rung| vertex_words(&rung.scene().unwrap(), &rung.options(SIZE));
    assert_eq!(words(Rung::Flat), position);
    assert_eq!(words(Rung::Texture), position + uv);
    assert_eq!(words(Rung::Lights), position + normal);
    let everything = Options { everything: true, ..options() };
    assert_eq!(Plan::new(&Rung::Flat.scene().unwrap(), &everything).vertex_layout().words, 14);

    // A picture of each choice against that with all attributes.
    let mut choices: Vec<Scene> = vec![Rung::Texture.scene().unwrap()];
    let changed = |change: &dyn Fn(&mut Scene)| {
        let mut scene = Rung::MirrorAndTextures.scene().unwrap();
        change(&mut scene);
        scene
    };
    choices.push(changed(&|scene| {
        scene.geometry.uvs.swap(0, 1);
        for material in &mut scene.materials {
            material.base_color_texture.iter_mut().for_each(|slot| slot.uv_set = 1);
        }
    }));
    choices.push(changed(&|scene| {
        let shade = |v: usize| vec4(1.0, (v % 3) as f32 / 2.0, 0.5, 1.0);
        scene.geometry.colors = (0..scene.geometry.positions.len()).map(shade).collect();
    }));
    choices.push(changed(&|scene| {
        scene.geometry.tangents = vec![vec4(1.0, 0.0, 0.0, 1.0); scene.geometry.positions.len()];
        let bumps = scene.materials.iter().find_map(|material| material.base_color_texture);
        scene.materials.iter_mut().for_each(|material| material.normal_texture = bumps);
    }));
    let mut layouts = Vec::new();
    for scene in &choices {
        let gpu = TestGpu::open();
        let [planned, all] =
            [false, true].map(|everything| gpu.render(scene, &Options { everything, ..options() }).image);
        gpu.finish();
        let compared = compare(&all, &planned, None, Encoding::Srgb).unwrap();
        assert!(compared.max < 0.02 && compared.rmse < 1e-3, "{compared:?}");
        layouts.push(Plan::new(scene, &options()).vertex_layout());
    }
    assert!(layouts[1].uv[0] == 0 && layouts[1].uv[1] != 0);
    assert!(layouts[2].color != 0 && layouts[2].tangent == 0 && layouts[3].tangent != 0);
}

#[test]
fn passes_of_branches_that_no_object_has_are_left_out() {
    for (rung, absent) in [(Rung::Mirror, &["transmitted", "transmitted combined"][..]), (Rung::Glass, &[])] {
        let scene = rung.scene().unwrap();
        let mut options = rung.options(SIZE);
        options.method.mode = Mode::MultiPass;
        let summary = Summary::new(&scene, &options);
        assert_eq!(summary.saved.passes, absent);
        assert_eq!(summary.planned.passes.len() + absent.len(), summary.everything.passes.len());
        let gpu = TestGpu::open();
        let drawn = gpu.render(&scene, &options).stats.passes;
        assert!(drawn.iter().all(|pass| summary.planned.passes.contains(&pass.name.as_str())));
        gpu.finish();
    }
}

#[test]
fn the_last_rung_leaves_nothing_of_the_scene_out() {
    let plan = Plan::new(&Rung::All.scene().unwrap(), &options());
    let expected = [
        "light from the camera, ambient light",
        "metalness and roughness texture",
        "normal map, tangents",
        "highlight strength texture",
        "highlight colour texture",
        "transmission texture",
        "second texture coordinates",
        "vertex colours",
        "directional lights",
        "spot lights",
        "ranges of lights",
        "multisampling",
        "supersampling",
        "edges traced again",
    ];
    assert_eq!(plan.left_out.iter().map(|left_out| left_out.what.as_str()).collect::<Vec<_>>(), expected);
    let everything = Plan::new(&Rung::Flat.scene().unwrap(), &Options { everything: true, ..options() });
    let left: Vec<&str> = everything.left_out.iter().map(|left_out| left_out.what.as_str()).collect();
    let off =
        ["light from the camera, ambient light", "multisampling", "supersampling", "edges traced again"];
    assert_eq!(left, off, "what scene and options switch off, whatever is asked for");
}

#[test]
fn a_metal_that_its_texture_makes_glass_in_places_transmits() {
    let with = |metal_map: bool| {
        scene_with(|scene| {
            let slot = scene.texture(texture::brick(16));
            let pane = scene.material(Material {
                metallic: 1.0,
                transmission: 1.0,
                metallic_roughness_texture: metal_map.then_some(slot),
                ..glass("pane", 1.5)
            });
            scene.mesh("pane", shape::plane(vec3(-0.5, 0.2, 1.0), Vec3::X, Vec3::Y, 1.0), pane);
        })
    };
    assert!(!left_out(&Plan::new(&with(true), &options()), "transmitted texture"));
    assert!(left_out(&Plan::new(&with(false), &options()), "transmitted texture"));
}
