//! Cameras of the scene's nodes, in world space.

use glam::{DMat3, DVec3};
use gltf::json::camera::Type;
use gltf::json::validation::Checked;

use super::document::Document;
use super::nodes::Nodes;
use super::notes::Notes;
use crate::scene::camera::relative;
use crate::scene::{Camera, Projection};

/// One camera for each node of the scene that has one, in node order.
///
/// A camera looks along −z of its node; the node's scale does not reach it (glTF 2.0 §3.10.2).
pub fn placed(document: &Document, nodes: &Nodes, origin: DVec3, notes: &Notes) -> Vec<Camera> {
    let mut cameras = Vec::new();
    for &node in &nodes.in_scene {
        let owner = &document.root.nodes[node];
        let Some(index) = owner.camera.map(|camera| camera.value()) else { continue };
        let camera = &document.root.cameras[index];
        let world = nodes.world[node];
        if !world.translation.is_finite() {
            notes.add("cameras", || format!("nodes[{node}]: its camera lies at no finite place: dropped"));
            continue;
        }
        let Some(projection) = projection(camera) else { continue };
        let [right, up, forward] = frame(world.matrix3).unwrap_or_else(|| {
            notes.add("cameras", || {
                format!("nodes[{node}]: its transform is singular: the camera looks along -z")
            });
            [DVec3::X, DVec3::Y, DVec3::NEG_Z]
        });
        cameras.push(Camera {
            name: owner
                .name
                .clone()
                .or_else(|| camera.name.clone())
                .unwrap_or_else(|| format!("camera {index}")),
            position: relative(world.translation, origin),
            right: right.as_vec3().normalize(),
            up: up.as_vec3().normalize(),
            forward: forward.as_vec3().normalize(),
            projection,
        });
    }
    cameras
}

fn projection(camera: &gltf::json::Camera) -> Option<Projection> {
    match camera.type_ {
        Checked::Valid(Type::Perspective) => {
            camera.perspective.as_ref().map(|lens| Projection::Perspective { yfov: lens.yfov })
        }
        Checked::Valid(Type::Orthographic) => camera
            .orthographic
            .as_ref()
            .map(|lens| Projection::Orthographic { xmag: lens.xmag.abs(), ymag: lens.ymag.abs() }),
        Checked::Invalid => None,
    }
}

/// Right, up and forward of a right-handed frame that looks along −z of `basis`.
fn frame(basis: DMat3) -> Option<[DVec3; 3]> {
    let forward = (-basis.z_axis).try_normalize()?;
    let right = forward.cross(basis.y_axis.try_normalize()?).try_normalize()?;
    Some([right, right.cross(forward), forward])
}
