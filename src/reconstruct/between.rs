//! Faces between the centres of pixels: neither they nor their neighbours own a pixel, and so nothing was sampled on them,
//! but several samples a pixel show them.
//!
//! Anti-aliasing adds no ray. They get the colours that the plain picture, of one sample at each pixel's centre, has at the
//! nearest pixel of their object; where it has none near, they are not drawn. So do faces that are traced beside the mesh, and
//! those that are blended, along their edges. What was traced of that picture is known; only the rest of it has to be drawn.

use std::mem;
use std::ops::Range;

use bytemuck::Zeroable;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::blocks::{self, Sources, UNTOUCHED};
use super::leaves::GpuLeaf;
use super::picture::Quad;
use super::table::Texel;
use super::vertex::{Attributes, VertexLayout};
use crate::constants::LEAF_TRACED;
use crate::pixels::HalfRadiance;
use crate::pixels::direct::Direct;
use crate::pixels::leaves::TracedPixel;
use crate::pixels::picture::Picture;
use crate::pixels::veils::Veils;
use crate::refine::footprint::{Footprint, TOUCHED};
use crate::refine::mesh::Mesh;
use crate::scene::frustum::{Frustum, Overlap};
use crate::scene::mesh::meet_plane;
use crate::scene::{AlphaMode, Object, Scene, View};
use crate::visibility::{Class, Found};

/// Height in pixels from which a triangle covers the centre of some pixel: a circle of half a pixel's diagonal fits in, at
/// least a third of the height.
const COVERS_A_CENTRE: f32 = 3.0 * std::f32::consts::FRAC_1_SQRT_2;

/// Share of its distance by which a face must lie behind what its middle's pixel shows to be hidden all over.
const BEHIND: f32 = 0.02;

/// Longest side in pixels of a face that its middle speaks for.
const SHORT: f32 = 2.0;

/// Frames of pixels that all blocks together hold at most.
const MOST_FRAMES: usize = 4;

/// What finding such faces takes.
pub struct Search<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The view.
    pub view: &'a View,
    /// Class of each object.
    pub classes: &'a [Class],
    /// What is visible.
    pub found: &'a Found<'a>,
    /// The refined mesh.
    pub mesh: &'a Mesh,
    /// Faces left out of it.
    pub direct: &'a Direct,
    /// What is blended, if it is traced.
    pub veils: &'a Veils,
    /// The pixels of both.
    pub picture: &'a Picture,
    /// Those of leaves.
    pub traced: &'a [TracedPixel],
}

/// Such faces, and where their colours come from.
#[derive(Debug, Default)]
pub struct Between {
    /// Their corners, and the first texel of the block that each reads.
    faces: Vec<([Vec3; 3], u32)>,
    /// These blocks, in which colours that were traced are.
    texels: Vec<Texel>,
    /// Cells, two a texel, that get colours of the plain picture.
    plain_cells: Vec<u32>,
    /// Which pixel's each gets.
    plain_pixels: Vec<u32>,
    /// By pixel: what was traced there, or nothing.
    known: Vec<HalfRadiance>,
    /// Whether they take the place of the picture beside the mesh: its edges are smooth, then.
    pub replaces_picture: bool,
    /// How many of `faces`, the first ones, the frustum does not clip.
    inside: usize,
}

/// What the device draws of them.
#[derive(Debug)]
pub struct BetweenLeaves {
    /// Words of their vertices.
    pub vertices: Vec<u32>,
    /// Leaf records.
    pub leaves: Vec<GpuLeaf>,
    /// Their blocks.
    pub texels: Vec<Texel>,
    /// How many of the leaves, the first ones, the frustum does not clip.
    pub inside: u32,
}

impl Between {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// Pixels of the plain picture whose colours are drawn.
    pub fn plain_pixels(&self) -> &[u32] {
        &self.plain_pixels
    }

    /// Those of a view.
    pub fn find(search: &Search) -> Self {
        let Search { view, picture, .. } = *search;
        let replaces_picture = !picture.pixels.is_empty();
        let mut between = Self { replaces_picture, known: search.known(), ..Self::default() };
        let in_picture = search.in_picture();
        let mut room = MOST_FRAMES * view.pixels();
        let mut shared = None;
        for (object, faces) in
            (0..).zip(search.of_objects(&in_picture)).filter(|(_, faces)| !faces.is_empty())
        {
            let footprints: Vec<Footprint> =
                faces.par_iter().map(|&corners| Footprint::of(view, corners)).collect();
            let around = around(&footprints);
            let size = around[0].len() * around[1].len();
            let block = if size <= room {
                room -= size;
                let shows = |x, y| search.shows(object, x, y);
                between.append(&search.sources(&footprints, around, shows))
            } else {
                // So many large objects share one in which all pixels keep their own colour.
                *shared.get_or_insert_with(|| between.append(&own(view, |_| true)))
            };
            between.faces.extend(faces.into_iter().map(|corners| (corners, block)));
        }
        let veils = search.of_veils();
        if !veils.is_empty() {
            let footprints: Vec<Footprint> =
                veils.par_iter().map(|&corners| Footprint::of(view, corners)).collect();
            let is_veiled = |x: u32, y: u32| search.veils.covers(y * view.width + x);
            let block = between.append(&search.sources(&footprints, around(&footprints), is_veiled));
            between.faces.extend(veils.into_iter().map(|corners| (corners, block)));
        }
        if let Some(quad) = Quad::new(view, picture).filter(|_| !in_picture.is_empty()) {
            let block = between.append(&own(view, |pixel| in_picture[pixel as usize]));
            between.faces.extend(quad.triangles().map(|corners| (corners, block)));
        }
        between
    }

    /// Adds the `rest` of traced leaves: there is nothing else, then.
    pub fn complete(&mut self, view: &View, rest: Vec<([Vec3; 3], Sources)>) {
        for (corners, sources) in rest {
            let block = self.append(&sources);
            self.faces.push((corners, block));
        }
        self.known = Vec::new();
        let frustum = Frustum::new(&view.clip_from_eye_relative(), view.eye);
        let (inside, cut): (Vec<_>, Vec<_>) = mem::take(&mut self.faces)
            .into_par_iter()
            .partition(|(corners, _)| frustum.of_points(*corners) == Overlap::Inside);
        self.inside = inside.len();
        self.faces = inside;
        self.faces.extend(cut);
    }

    /// Appends a block; its first texel.
    fn append(&mut self, Sources { columns, rows, pixels }: &Sources) -> u32 {
        let head = self.texels.len();
        self.texels.push([columns.start, rows.start, columns.len() as u32, rows.len() as u32]);
        let first = self.texels.len();
        self.texels.resize(first + pixels.len().div_ceil(2), Texel::default());
        for (cell, &source) in pixels.iter().enumerate().filter(|(_, source)| **source != UNTOUCHED) {
            match self.known[source as usize] {
                HalfRadiance::NONE => {
                    self.plain_cells.push((2 * first + cell) as u32);
                    self.plain_pixels.push(source);
                }
                radiance => blocks::put(&mut self.texels[first..], cell, radiance),
            }
        }
        head as u32
    }

    /// What is drawn of them, with the colours of the [pixels](Self::plain_pixels) of the plain picture.
    pub fn leaves(mut self, layout: VertexLayout, plain: &[Vec3]) -> BetweenLeaves {
        for (&cell, &radiance) in self.plain_cells.iter().zip(plain) {
            blocks::put(&mut self.texels, cell as usize, HalfRadiance::from(radiance));
        }
        let vertices = layout.pack(3 * self.faces.len(), |index| Attributes {
            position: self.faces[index / 3].0[index % 3],
            ..Attributes::default()
        });
        let leaf = |(index, &(_, block)): (u32, &([Vec3; 3], u32))| GpuLeaf {
            vertices: [3 * index, 3 * index + 1, 3 * index + 2],
            nodes: block,
            flags: LEAF_TRACED,
            ..GpuLeaf::zeroed()
        };
        let leaves = (0..).zip(&self.faces).map(leaf).collect();
        BetweenLeaves { vertices, leaves, texels: self.texels, inside: self.inside as u32 }
    }
}

impl Search<'_> {
    /// By pixel: what was traced there, or nothing.
    fn known(&self) -> Vec<HalfRadiance> {
        let mut known = vec![HalfRadiance::NONE; self.view.pixels()];
        for pixel in self.traced {
            known[pixel.index as usize] = pixel.radiance;
        }
        // It lies before them.
        for pixel in &self.picture.pixels {
            known[pixel.index as usize] = pixel.radiance;
        }
        known
    }

    /// By pixel: whether faces left out of the mesh show all over it, as far as the centres around it tell; empty without any.
    fn in_picture(&self) -> Vec<bool> {
        let Search { scene, view, found, picture, .. } = *self;
        let mut inside = vec![false; if self.direct.is_empty() { 0 } else { view.pixels() }];
        let object = |x: u32, y: u32| {
            let face = found.ids.and_then(|ids| ids.face(x, y));
            face.map(|face| scene.geometry.face_objects[face as usize])
        };
        let direct = picture.pixels.iter().filter(|pixel| !self.veils.covers(pixel.index));
        for pixel in direct {
            let (x, y) = (pixel.index % view.width, pixel.index / view.width);
            let own = object(x, y);
            let rows = y.saturating_sub(1)..(y + 2).min(view.height);
            let columns = x.saturating_sub(1)..(x + 2).min(view.width);
            inside[pixel.index as usize] =
                rows.into_iter().all(|y| columns.clone().all(|x| object(x, y) == own));
        }
        inside
    }

    /// Corners of the scene's faces of each object, but for those that the picture hides.
    fn of_objects(&self, in_picture: &[bool]) -> Vec<Vec<[Vec3; 3]>> {
        let Search { scene, classes, found, mesh, .. } = *self;
        let geometry = &scene.geometry;
        let mut in_mesh = vec![false; geometry.faces.len()];
        mesh.faces.iter().for_each(|face| in_mesh[face.base as usize] = true);
        // Backs are hidden by fronts, but on objects that show some.
        let mut shows_backs = vec![false; scene.objects.len()];
        for &face in found.visible {
            shows_backs[geometry.face_objects[face as usize] as usize] |= self.is_back(face);
        }
        let of_object = |(index, object): (usize, &Object)| {
            let material = &scene.materials[object.material as usize];
            // Holes are cut by shading, which these have none of.
            let masked = matches!(material.alpha_mode, AlphaMode::Mask(_));
            if classes[index] == Class::Occluder || scene.is_veil(object) || masked {
                return Vec::new();
            }
            let backs = shows_backs[index] && material.double_sided;
            let faces = object.faces.clone().into_par_iter();
            let faces = faces.filter(|&face| !in_mesh[face as usize] && (backs || !self.is_back(face)));
            faces
                .map(|face| (face, geometry.corners(face)))
                .filter(|&(face, corners)| {
                    let footprint = Footprint::of(self.view, corners);
                    (self.direct.is(face) || self.may_show(corners)) && self.is_beside(&footprint, in_picture)
                })
                .map(|(_, corners)| corners)
                .collect()
        };
        scene.objects.iter().enumerate().map(of_object).collect()
    }

    fn is_back(&self, face: u32) -> bool {
        let geometry = &self.scene.geometry;
        geometry.area_normal(face).dot(self.view.direction_to(geometry.corners(face)[0])) > 0.0
    }

    /// Whether a face that owns no pixel may show in a part of one.
    fn may_show(&self, corners: [Vec3; 3]) -> bool {
        let view = self.view;
        let [Some(a), Some(b), Some(c)] = corners.map(|corner| view.project(corner).map(|(at, _)| at)) else {
            return false;
        };
        let longest = [b - a, c - b, a - c].map(Vec2::length).into_iter().fold(0.0, f32::max);
        let double_area = (b - a).perp_dot(c - a).abs();
        if double_area == 0.0 || double_area > COVERS_A_CENTRE * longest {
            return false;
        }
        !(longest <= SHORT && self.is_hidden(corners, (a + b + c) / 3.0))
    }

    /// Whether a face touches some pixel that is not in the picture.
    fn is_beside(&self, footprint: &Footprint, in_picture: &[bool]) -> bool {
        footprint.rows.clone().any(|y| {
            let mut touched = footprint.span(y, TOUCHED);
            touched.any(|x| in_picture.get((y * self.view.width + x) as usize) != Some(&true))
        })
    }

    /// Whether a face lies behind the one that is seen at its `middle`, in pixels.
    fn is_hidden(&self, corners: [Vec3; 3], middle: Vec2) -> bool {
        let View { width, height, .. } = *self.view;
        let within =
            middle.x >= 0.0 && middle.y >= 0.0 && middle.x < width as f32 && middle.y < height as f32;
        let ids = self.found.ids.filter(|_| within);
        let Some(seen) = ids.and_then(|ids| ids.face(middle.x as u32, middle.y as u32)) else { return false };
        let ray = self.view.ray(middle);
        let own = meet_plane(corners, ray);
        let before = meet_plane(self.scene.geometry.corners(seen), ray);
        matches!((own, before), (Some((own, _)), Some((before, _))) if own > before * (1.0 + BEHIND))
    }

    /// Corners of faces that are blended.
    fn of_veils(&self) -> Vec<[Vec3; 3]> {
        let Search { scene, view, .. } = *self;
        if self.veils.is_empty() {
            return Vec::new();
        }
        let objects = scene.objects.iter().filter(|object| scene.is_veil(object));
        let faces = objects.flat_map(|object| {
            let material = &scene.materials[object.material as usize];
            object.faces.clone().map(move |face| (material, face))
        });
        faces
            .map(|(material, face)| {
                (material, scene.geometry.area_normal(face), scene.geometry.corners(face))
            })
            .filter(|(material, normal, corners)| !material.culls(*normal, view.direction_to(corners[0])))
            .map(|(_, _, corners)| corners)
            .filter(|&corners| !Footprint::of(view, corners).is_empty())
            .collect()
    }

    /// Whether the centre of a pixel of the frame shows `object`.
    fn shows(&self, object: u32, x: u32, y: u32) -> bool {
        let face = self.found.ids.and_then(|ids| ids.face(x, y));
        face.is_some_and(|face| self.scene.geometry.face_objects[face as usize] == object)
    }

    /// Sources of the pixels of the rectangle `around` that faces with these `footprints` touch: the nearest pixel whose centre
    /// `shows` them.
    fn sources(
        &self,
        footprints: &[Footprint],
        [columns, rows]: [Range<u32>; 2],
        shows: impl Fn(u32, u32) -> bool + Sync,
    ) -> Sources {
        let view = self.view;
        let (left, top) = (columns.start, rows.start);
        let mut touched = vec![false; columns.len() * rows.len()];
        for footprint in footprints {
            for y in footprint.rows.clone() {
                let row = (y - top) as usize * columns.len();
                let span = footprint.span(y, TOUCHED);
                if !span.is_empty() {
                    touched[row + (span.start - left) as usize..row + (span.end - left) as usize].fill(true);
                }
            }
        }
        let across = columns.len();
        let pixels = touched
            .into_par_iter()
            .enumerate()
            .map(|(cell, touched)| {
                if !touched {
                    return UNTOUCHED;
                }
                let (x, y) = (left + (cell % across) as u32, top + (cell / across) as u32);
                match blocks::nearest(view, (x, y), &shows) {
                    Some((x, y)) => y * view.width + x,
                    None if self.found.ids.is_some() => UNTOUCHED,
                    None => y * view.width + x,
                }
            })
            .collect();
        Sources { columns, rows, pixels }
    }
}

/// The rectangle around `footprints`: columns, then rows.
fn around(footprints: &[Footprint]) -> [Range<u32>; 2] {
    let hull = |one: Range<u32>, other: &Range<u32>| one.start.min(other.start)..one.end.max(other.end);
    let none = || Range { start: u32::MAX, end: 0 };
    footprints.iter().fold([none(), none()], |[columns, rows], footprint| {
        [hull(columns, &footprint.columns), hull(rows, &footprint.rows)]
    })
}

/// All of a frame, each pixel that `is_drawn` its own source.
fn own(view: &View, is_drawn: impl Fn(u32) -> bool + Sync) -> Sources {
    let pixels = (0..view.pixels() as u32).into_par_iter();
    let pixels = pixels.map(|pixel| if is_drawn(pixel) { pixel } else { UNTOUCHED }).collect();
    Sources { columns: 0..view.width, rows: 0..view.height, pixels }
}
