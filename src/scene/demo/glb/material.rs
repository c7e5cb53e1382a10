//! Materials and their extensions in glTF's words.

use glam::{Affine2, Vec3};
use serde_json::{Map, Value, json};

use super::writer::Writer;
use super::{number, numbers};
use crate::scene::{AlphaMode, Material, TextureSlot};

impl Writer {
    pub(super) fn material(&mut self, material: &Material) -> Value {
        let mut pbr = json!({
            "baseColorFactor": numbers(material.base_color.to_array()),
            "metallicFactor": number(material.metallic),
            "roughnessFactor": number(material.roughness),
        });
        self.slot(&mut pbr, "baseColorTexture", material.base_color_texture);
        self.slot(&mut pbr, "metallicRoughnessTexture", material.metallic_roughness_texture);
        let mut out = json!({ "name": material.name, "pbrMetallicRoughness": pbr });
        self.slot(&mut out, "normalTexture", material.normal_texture);
        if material.normal_texture.is_some() {
            out["normalTexture"]["scale"] = number(material.normal_scale);
        }
        // Factors above 1 belong into the extension.
        let strength = material.emissive.max_element().max(1.0);
        if material.emissive != Vec3::ZERO {
            out["emissiveFactor"] = numbers((material.emissive / strength).to_array());
        }
        self.slot(&mut out, "emissiveTexture", material.emissive_texture);
        match material.alpha_mode {
            AlphaMode::Opaque => {}
            AlphaMode::Mask(cutoff) => {
                out["alphaMode"] = json!("MASK");
                out["alphaCutoff"] = number(cutoff);
            }
            AlphaMode::Blend => out["alphaMode"] = json!("BLEND"),
        }
        if material.double_sided {
            out["doubleSided"] = json!(true);
        }
        if let Some(vt) = material.vt_extra {
            out["extras"] = json!({ "vt": vt });
        }
        let extensions = self.material_extensions(material, strength);
        if !extensions.is_empty() {
            out["extensions"] = Value::Object(extensions);
        }
        out
    }

    fn material_extensions(&mut self, material: &Material, emissive_strength: f32) -> Map<String, Value> {
        let plain = Material::default();
        let mut all = Vec::new();
        if emissive_strength > 1.0 {
            all.push((
                "KHR_materials_emissive_strength",
                json!({ "emissiveStrength": number(emissive_strength) }),
            ));
        }
        if material.unlit {
            all.push(("KHR_materials_unlit", json!({})));
        }
        if material.ior != plain.ior {
            all.push(("KHR_materials_ior", json!({ "ior": number(material.ior) })));
        }
        let mut specular = json!({ "specularFactor": number(material.specular),
            "specularColorFactor": numbers(material.specular_color.to_array()) });
        let neutral = specular.clone();
        self.slot(&mut specular, "specularTexture", material.specular_texture);
        self.slot(&mut specular, "specularColorTexture", material.specular_color_texture);
        let textured = specular != neutral;
        if textured || material.specular != plain.specular || material.specular_color != plain.specular_color
        {
            all.push(("KHR_materials_specular", specular));
        }
        if material.transmission > 0.0 {
            let mut transmission = json!({ "transmissionFactor": number(material.transmission) });
            self.slot(&mut transmission, "transmissionTexture", material.transmission_texture);
            all.push(("KHR_materials_transmission", transmission));
        }
        if let Some(body) = material.volume {
            // Any thickness above 0 says "solid"; its value is for renderers that do not trace.
            let mut volume = json!({ "thicknessFactor": 1.0, "attenuationColor": numbers(body.attenuation_color.to_array()) });
            if body.attenuation_distance.is_finite() {
                volume["attenuationDistance"] = number(body.attenuation_distance);
            }
            all.push(("KHR_materials_volume", volume));
        }
        all.iter().for_each(|(name, _)| self.extension(name));
        all.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }

    fn slot(&mut self, owner: &mut Value, key: &str, slot: Option<TextureSlot>) {
        let Some(slot) = slot else { return };
        let mut info = json!({ "index": slot.texture, "texCoord": slot.uv_set });
        if slot.transform != Affine2::IDENTITY {
            self.extension("KHR_texture_transform");
            let (scale, angle, offset) = slot.transform.to_scale_angle_translation();
            info["extensions"] = json!({ "KHR_texture_transform": {
                // glTF turns the image counter-clockwise with v down: the coordinates turn the other way.
                "offset": numbers(offset.to_array()), "rotation": number(-angle), "scale": numbers(scale.to_array()),
            }});
        }
        owner[key] = info;
    }
}
