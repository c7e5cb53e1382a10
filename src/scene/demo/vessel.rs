//! The vessels of the demos: cup, wine glass and bowl, as closed surfaces with real wall thickness.
//!
//! Sizes are in units of about ten centimetres. Each stands on y = 0 with a foot that is a hair above
//! it: a rounded foot touches a plane in a circle, never in a face.

use glam::Vec2;

use super::Mesh;
use super::sweep::{Curve, Uv, revolve, tube};

/// A cup of height 1.2 and radius 0.64 with its handle on +x, about 2,400 faces.
pub fn cup() -> Mesh {
    cup_body().merged(&cup_handle())
}

fn cup_body() -> Mesh {
    let profile = Curve::from((0.0, 0.045))
        .line((0.27, 0.045))
        .bend((0.30, 0.045), (0.30, 0.006), (0.335, 0.006), 2)
        .bend((0.39, 0.006), (0.39, 0.05), (0.37, 0.085), 2)
        .bend((0.36, 0.115), (0.39, 0.125), (0.44, 0.17), 2)
        .bend((0.58, 0.31), (0.56, 0.74), (0.634, 1.165), 6)
        .bend((0.640, 1.195), (0.638, 1.206), (0.616, 1.206), 3)
        .bend((0.596, 1.206), (0.592, 1.19), (0.587, 1.165), 3)
        .bend((0.51, 0.76), (0.52, 0.36), (0.40, 0.22), 5)
        .bend((0.32, 0.13), (0.20, 0.12), (0.0, 0.12), 2);
    revolve(&profile, 40, Uv::None)
}

/// A tube whose ends lie half way through the body's wall, square to it, so that neither shows.
fn cup_handle() -> Mesh {
    let start = Curve::from((0.580, 0.96));
    let path = start.bend((0.84, 0.95), (1.07, 1.02), (1.07, 0.75), 10);
    let path = path.bend((1.07, 0.52), (0.80, 0.30), (0.505, 0.385), 10);
    tube(&path, 10, |at| {
        let flare = 1.0 + 0.25 * (2.0 * at - 1.0).powi(6);
        Vec2::new(0.048, 0.072) * flare
    })
}

/// A wine glass of height 1.5 with a stem, about 3,000 faces.
pub fn wine_glass() -> Mesh {
    let profile = Curve::from((0.0, 0.012))
        .line((0.18, 0.008))
        .line((0.31, 0.006))
        .bend((0.345, 0.006), (0.345, 0.03), (0.31, 0.034), 3)
        .bend((0.14, 0.05), (0.05, 0.09), (0.045, 0.22), 5)
        .bend((0.04, 0.36), (0.035, 0.45), (0.055, 0.56), 3)
        .bend((0.09, 0.68), (0.44, 0.66), (0.44, 0.98), 7)
        .bend((0.44, 1.18), (0.37, 1.34), (0.34, 1.48), 4)
        .bend((0.335, 1.50), (0.319, 1.50), (0.313, 1.48), 3)
        .bend((0.34, 1.34), (0.405, 1.18), (0.405, 0.98), 4)
        .bend((0.405, 0.76), (0.17, 0.69), (0.0, 0.67), 6);
    revolve(&profile, 40, Uv::None)
}

/// A wide bowl of height 0.5 and radius 0.8, about 2,000 faces.
pub fn bowl() -> Mesh {
    let profile = Curve::from((0.0, 0.03))
        .line((0.22, 0.03))
        .bend((0.25, 0.03), (0.25, 0.006), (0.28, 0.006), 2)
        .bend((0.32, 0.006), (0.31, 0.04), (0.34, 0.055), 2)
        .bend((0.60, 0.14), (0.76, 0.28), (0.80, 0.48), 6)
        .bend((0.805, 0.515), (0.75, 0.515), (0.742, 0.48), 3)
        .bend((0.70, 0.31), (0.52, 0.20), (0.30, 0.12), 6)
        .bend((0.20, 0.09), (0.10, 0.085), (0.0, 0.085), 3);
    revolve(&profile, 44, Uv::None)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// Times that a ray from `point` meets the surface: odd inside a closed one.
    fn crossings(mesh: &Mesh, point: Vec3) -> usize {
        let direction = Vec3::new(0.31, 0.87, 0.38);
        let meets = |face: &&[u32; 3]| {
            let [a, b, c] = face.map(|v| mesh.positions[v as usize] - point);
            let [u, v, w] = [(a, b), (b, c), (c, a)].map(|(from, to)| direction.dot(from.cross(to)) > 0.0);
            let normal = (b - a).cross(c - a);
            u == v && v == w && a.dot(normal) / direction.dot(normal) > 0.0
        };
        mesh.faces.iter().filter(meets).count()
    }

    #[test]
    fn vessels_are_closed_bodies_above_the_ground() {
        for (name, mesh) in [
            ("cup body", cup_body()),
            ("cup handle", cup_handle()),
            ("glass", wine_glass()),
            ("bowl", bowl()),
        ] {
            assert!(mesh.is_closed(), "{name}");
            assert!(mesh.volume() > 0.005, "{name} is inside out: {}", mesh.volume());
            assert!(mesh.positions.iter().all(|p| p.y > 0.0), "{name} reaches into the ground");
        }
    }

    #[test]
    fn the_handle_ends_inside_the_wall() {
        let (body, handle) = (cup_body(), cup_handle());
        // An end is a centre and a rim of ten.
        let ends = &handle.positions[handle.positions.len() - 22..];
        for &end in ends {
            assert_eq!(crossings(&body, end) % 2, 1, "{end} is outside the wall");
        }
        assert_eq!(crossings(&body, Vec3::new(0.0, 0.8, 0.0)) % 2, 0, "the cup is hollow");
    }
}
