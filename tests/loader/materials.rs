//! Materials, textures and images of valid files, with numbers.

use std::f32::consts::FRAC_PI_2;

use glam::{Vec2, Vec3, Vec4};
use serde_json::{Value, json};
use vertex_tracing::scene::{AlphaMode, Filter, Material, Scene, Volume, Wrap};

use crate::model::{Model, noted, png, push};

fn material(json: Value) -> Material {
    loaded(json).materials[0].clone()
}

fn loaded(json: Value) -> Scene {
    Model::triangle().set("/materials/0", json).load()
}

/// A triangle whose images are one PNG for each colour, each with a texture of the same index.
fn textured(colors: &[[u8; 4]]) -> Model {
    let mut model = Model::triangle();
    for (index, color) in colors.iter().enumerate() {
        let view = model.view(&png(1, 1, *color));
        push(&mut model.json["images"], json!({"bufferView": view, "mimeType": "image/jpeg"}));
        push(&mut model.json["textures"], json!({"source": index}));
    }
    model
}

#[test]
fn defaults_are_those_of_the_specification() {
    let of_file = material(json!({}));
    assert_eq!((of_file.metallic, of_file.roughness, of_file.ior), (1.0, 1.0, 1.5));
    assert_eq!((of_file.base_color, of_file.emissive), (Vec4::ONE, Vec3::ZERO));
    assert_eq!(of_file.alpha_mode, AlphaMode::Opaque);
    assert_eq!(of_file.name, "material 0");
    let mut model = Model::triangle();
    model.primitive().as_object_mut().unwrap().remove("material");
    let scene = model.load();
    assert_eq!((scene.materials.len(), scene.materials[0].metallic), (1, 1.0));
    assert_eq!(scene.materials[0].name, "default");
}

#[test]
fn factors() {
    let material = material(json!({
        "name": "glass", "doubleSided": true, "emissiveFactor": [0.5, 0.25, 0],
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.25},
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 8},
            "KHR_materials_unlit": {},
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_specular": {"specularFactor": 0.7, "specularColorFactor": [0.1, 1.5, 0.3]},
            "KHR_materials_transmission": {"transmissionFactor": 0.9},
            "KHR_materials_volume": {"thicknessFactor": 2, "attenuationDistance": 3, "attenuationColor": [0.2, 0.4, 0.6]}
        }
    }));
    assert_eq!(material.name, "glass");
    assert!(material.double_sided && material.unlit);
    assert_eq!(material.base_color, Vec4::new(0.1, 0.2, 0.3, 0.4));
    assert_eq!((material.metallic, material.roughness), (0.5, 0.25));
    assert_eq!(material.emissive, Vec3::new(4.0, 2.0, 0.0));
    assert_eq!((material.ior, material.specular, material.transmission), (1.33, 0.7, 0.9));
    assert_eq!(material.specular_color, Vec3::new(0.1, 1.5, 0.3));
    let volume = Volume { attenuation_color: Vec3::new(0.2, 0.4, 0.6), attenuation_distance: 3.0 };
    assert_eq!(material.volume, Some(volume));
}

#[test]
fn volume_needs_thickness_and_ior_0_is_infinite() {
    let with = |extensions: Value| material(json!({"extensions": extensions}));
    assert_eq!(with(json!({"KHR_materials_volume": {"attenuationDistance": 3}})).volume, None);
    let clear = with(json!({"KHR_materials_volume": {"thicknessFactor": 1}})).volume.unwrap();
    assert_eq!(clear.transmittance(1e6), Vec3::ONE);
    assert_eq!(with(json!({"KHR_materials_ior": {"ior": 0}})).ior, 1e6);
    for ior in [0.5, -0.5] {
        let scene = loaded(json!({"extensions": {"KHR_materials_ior": {"ior": ior}}}));
        assert_eq!(scene.materials[0].ior, 1.0);
        assert!(noted(&scene, "ior"));
    }
}

#[test]
fn alpha_modes() {
    assert_eq!(material(json!({"alphaMode": "MASK"})).alpha_mode, AlphaMode::Mask(0.5));
    assert_eq!(material(json!({"alphaMode": "MASK", "alphaCutoff": 0.75})).alpha_mode, AlphaMode::Mask(0.75));
    let half = json!({"baseColorFactor": [1, 1, 1, 0.5]});
    let blended = material(json!({"alphaMode": "BLEND", "pbrMetallicRoughness": half}));
    assert_eq!(blended.alpha_mode, AlphaMode::Blend);
}

/// Exporters mark whole models BLEND; only what can be seen through is.
#[test]
fn blend_without_alpha_is_opaque() {
    let of_texture = |alpha: u8| {
        let mut model = textured(&[[10, 20, 30, alpha]]);
        let texture = json!({"baseColorTexture": {"index": 0}});
        model.json["materials"][0] = json!({"alphaMode": "BLEND", "pbrMetallicRoughness": texture});
        model
    };
    let scene = of_texture(255).load();
    assert_eq!(scene.materials[0].alpha_mode, AlphaMode::Opaque);
    assert!(
        noted(&scene, "material 0: BLEND, but its alpha is 1 everywhere: it is opaque"),
        "{:?}",
        scene.notes
    );
    assert_eq!(of_texture(254).load().materials[0].alpha_mode, AlphaMode::Blend);

    let mut model = of_texture(255);
    let colors = model.floats("VEC4", &[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.9, 1.0, 1.0, 1.0, 1.0]);
    model.attribute("COLOR_0", colors);
    assert_eq!(model.load().materials[0].alpha_mode, AlphaMode::Blend);
}

#[test]
fn values_out_of_range_are_clamped_and_noted() {
    let scene = loaded(json!({
        "pbrMetallicRoughness": {"metallicFactor": 1.5, "roughnessFactor": -1},
        "extensions": {"KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0, "attenuationColor": [2, 0, 1]}}
    }));
    let material = &scene.materials[0];
    assert_eq!((material.metallic, material.roughness), (1.0, 0.0));
    let volume = material.volume.unwrap();
    assert_eq!(volume.attenuation_color, Vec3::new(1.0, 0.0, 1.0));
    assert!(volume.attenuation_distance.is_infinite());
    assert_eq!(scene.notes.len(), 4, "{:?}", scene.notes);
    for note in [
        "material 0: metallicFactor 1.5 is out of range: 1 is used",
        "material 0: attenuationColor [2, 0, 1] is out of range: [1, 0, 1] is used",
    ] {
        assert!(scene.notes.iter().any(|other| other == note), "{note}: {:?}", scene.notes);
    }
}

#[test]
fn every_slot_with_its_transform_and_colour_space() {
    let slot = |index: usize| {
        json!({"index": index, "texCoord": 0, "extensions": {"KHR_texture_transform": {
            "offset": [index, 0.5], "rotation": FRAC_PI_2, "scale": [2, 4], "texCoord": 1}}})
    };
    let mut model = textured(&[[0; 4]; 8]);
    model.json["materials"][0] = json!({
        "pbrMetallicRoughness": {"baseColorTexture": slot(0), "metallicRoughnessTexture": slot(1)},
        "normalTexture": slot(2), "emissiveTexture": slot(3),
        "extensions": {
            "KHR_materials_specular": {"specularTexture": slot(4), "specularColorTexture": slot(5)},
            "KHR_materials_transmission": {"transmissionTexture": slot(6)}
        }
    });
    model.json["materials"][0]["normalTexture"]["scale"] = json!(-0.5);
    let scene = model.load();
    let material = &scene.materials[0];
    assert_eq!(material.normal_scale, -0.5);
    assert_eq!(scene.images.len(), 7, "the eighth is not in use");
    for (source, slot, srgb) in [
        (0, material.base_color_texture, true),
        (1, material.metallic_roughness_texture, false),
        (2, material.normal_texture, false),
        (3, material.emissive_texture, true),
        (4, material.specular_texture, false),
        (5, material.specular_color_texture, true),
        (6, material.transmission_texture, false),
    ] {
        let slot = slot.unwrap();
        let texture = scene.textures[slot.texture as usize];
        assert_eq!(scene.images[texture.image as usize].name, format!("image {source}"));
        assert_eq!((texture.srgb, slot.uv_set), (srgb, 1), "slot {source}");
        // Scaled to (2, 4), turned a quarter counter-clockwise with v down, then moved.
        let uv = slot.transform(Vec2::ONE);
        assert!((uv - Vec2::new(4.0 + source as f32, -1.5)).length() < 1e-5, "slot {source}: {uv}");
    }
}

#[test]
fn textures_are_shared_by_image_sampler_and_colour_space() {
    let mut model = textured(&[[10, 20, 30, 40]]);
    model.json["samplers"] =
        json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9984}, {}]);
    model.json["textures"] = json!([{"source": 0}, {"source": 0, "sampler": 1}, {"source": 0, "sampler": 0}]);
    model.json["materials"][0] = json!({
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}},
        "emissiveTexture": {"index": 1}, "normalTexture": {"index": 2}
    });
    let scene = model.load();
    assert_eq!((scene.images.len(), scene.textures.len()), (1, 3));
    let material = &scene.materials[0];
    assert_eq!(material.base_color_texture, material.emissive_texture);
    let sampler = scene.textures[material.normal_texture.unwrap().texture as usize].sampler;
    assert_eq!((sampler.wrap_u, sampler.wrap_v), (Wrap::Clamp, Wrap::Mirror));
    assert_eq!(
        (sampler.mag, sampler.min, sampler.mip),
        (Filter::Nearest, Filter::Nearest, Some(Filter::Nearest))
    );
    assert_eq!(&*scene.images[0].rgba, [10, 20, 30, 40]);
}

#[test]
fn unused_materials_and_images_are_not_decoded() {
    let mut model = textured(&[[1; 4], [2; 4]]);
    // The second image has a good header and no data.
    let cut = png(64, 64, [9; 4]);
    let view = model.view(&cut[..50]);
    model.json["images"][1]["bufferView"] = json!(view);
    model.json["materials"] = json!([
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}}
    ]);
    // A mesh of one triangle that no node shows.
    let hidden = model.json["meshes"][0].clone();
    push(&mut model.json["meshes"], hidden);
    let scene = model.load();
    assert_eq!((scene.materials.len(), scene.images.len()), (1, 1));
    let unread: Vec<_> =
        scene.unread.iter().map(|rest| (rest.what, rest.count, rest.of, rest.bytes)).collect();
    let (mesh, texels) = (3 * 24 + 16, 4 * 64 * 64);
    let expected = [("meshes", mesh), ("materials", 0), ("textures", 0), ("images", texels)];
    assert_eq!(unread, expected.map(|(what, bytes)| (what, 1, 2, bytes)));
    model.primitive()["material"] = json!(1);
    assert!(model.refused().contains("images[1]"));
}

#[test]
fn uv_sets_beyond_the_second_are_taken_as_the_first() {
    let mut model = textured(&[[1; 4]]);
    model.json["materials"][0] = json!({"emissiveTexture": {"index": 0, "texCoord": 2}});
    let scene = model.load();
    assert_eq!(scene.materials[0].emissive_texture.unwrap().uv_set, 0);
    assert!(noted(&scene, "texture coordinates 2"));
}

#[test]
fn webp_by_its_extension() {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(1, 1, image::Rgba([200, 100, 50, 255]))
        .write_to(&mut bytes, image::ImageFormat::WebP)
        .unwrap();
    let mut model = Model::triangle();
    let view = model.view(bytes.get_ref());
    model.json["images"] = json!([{"bufferView": view, "mimeType": "image/webp"}]);
    model.json["textures"] = json!([{"extensions": {"EXT_texture_webp": {"source": 0}}}]);
    model.json["extensionsRequired"] = json!(["EXT_texture_webp"]);
    model.json["materials"][0] = json!({"emissiveTexture": {"index": 0}});
    assert_eq!(&*model.load().images[0].rgba, [200, 100, 50, 255]);
}
