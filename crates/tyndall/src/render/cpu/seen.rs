//! What the pixels of a film show: where their depths lie, and how the surfaces there face.

use glam::Vec3;
use rayon::prelude::*;

use super::{FILM_EDGE, Film, Stretch};
use crate::film::Surface;
use crate::render::sampling::PATTERN;
use crate::scene::Scene;
use crate::scene::camera::View;

impl Film {
    /// By pixel of the window, row by row; `offsets` say where in its pixel the sample lies that gave the depth, by place in the pattern.
    pub(in crate::render) fn surfaces(
        &self,
        scene: &Scene,
        view: &View,
        offsets: &[[f32; 2]; PATTERN * PATTERN],
    ) -> Vec<Surface> {
        let width = self.window.width as usize;
        let mut surfaces = vec![Surface::default(); width * self.window.height as usize];
        let tiles = self.tile_rows();
        surfaces.par_chunks_mut(width).enumerate().for_each(|(row, surfaces)| {
            for stretch in self.stretches(&tiles, row) {
                let tile = stretch.tile;
                let corner = [tile.x, tile.y].map(|pixels| pixels as f32);
                for (at, pixel) in stretch.pixels().filter(|(_, pixel)| tile.depth[*pixel] < f32::INFINITY) {
                    let (column, row) = (pixel % FILM_EDGE, pixel / FILM_EDGE);
                    let [x, y] = offsets[row % PATTERN * PATTERN + column % PATTERN];
                    let ray = view.ray(corner[0] + (column as f32 + x), corner[1] + (row as f32 + y));
                    let point = ray.origin + tile.depth[pixel] * ray.direction;
                    surfaces[at] = surface(scene, tile.node[pixel], point, ray.direction);
                }
            }
        });
        surfaces
    }

    /// Depth and node of what each pixel of the window shows, row by row; where it shows nothing, the depth is infinite.
    pub(in crate::render) fn met(&self) -> (Vec<f32>, Vec<u32>) {
        let width = self.window.width as usize;
        let pixels = self.pixels() as usize;
        let (mut depth, mut node) = (vec![f32::INFINITY; pixels], vec![0; pixels]);
        let tiles = self.tile_rows();
        let rows = (depth.par_chunks_mut(width), node.par_chunks_mut(width));
        rows.into_par_iter().enumerate().for_each(|(row, (depth, node))| {
            for Stretch { tile, at, first, length } in self.stretches(&tiles, row) {
                depth[at..at + length].copy_from_slice(&tile.depth[first..first + length]);
                node[at..at + length].copy_from_slice(&tile.node[first..first + length]);
            }
        });
        (depth, node)
    }
}

/// The surface of what is at `node`, near `point`, which lies on it up to rounding.
fn surface(scene: &Scene, node: u32, point: Vec3, direction: Vec3) -> Surface {
    let Touched { point, normal, .. } = touched(scene, node, point, direction);
    let position = scene.structure().origin() + point.as_dvec3();
    Surface { position: position.as_vec3().to_array(), normal: normal.to_array() }
}

/// A place on a surface.
pub(in crate::render) struct Touched {
    pub(in crate::render) point: Vec3,
    /// Of unit length.
    pub(in crate::render) normal: Vec3,
    /// Of the sphere, or of one that touches the shape from within, about; 0 of what is flat, caps among it.
    pub(in crate::render) radius: f32,
    /// The same of what a cap is of; infinite of what is flat otherwise.
    pub(in crate::render) size: f32,
    /// Whether it is on a cap.
    pub(in crate::render) is_cap: bool,
}

/// What is at `node` near `point`, which was met along `direction`.
pub(in crate::render) fn touched(scene: &Scene, node: u32, point: Vec3, direction: Vec3) -> Touched {
    if let Some((cut, node)) = scene.cap_of(node) {
        let size = touched(scene, node, point, direction).size;
        return Touched { point, normal: cut.normal(point, direction), radius: 0.0, size, is_cap: true };
    }
    match scene.locate_shape(node) {
        Some((shapes, node, shift)) => {
            let shape = shapes.shape(node / 2);
            let (point, normal) = shape.surface(point - shift, direction);
            let radius = shape.radius();
            let size = if radius > 0.0 { radius } else { f32::INFINITY };
            Touched { point: point + shift, normal, radius, size, is_cap: false }
        }
        None => {
            let (center, radius) = scene.structure().sphere(node);
            // A sphere so small that rounding leaves no direction faces the eye.
            let normal = (point - center).normalize_or(-direction);
            Touched { point: center + radius * normal, normal, radius, size: radius, is_cap: false }
        }
    }
}
