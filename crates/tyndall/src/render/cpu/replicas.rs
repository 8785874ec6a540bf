//! Periodic images in the hierarchy's kernels: the same walks, image after image, with rays and points that are moved back.
//!
//! What was found in one image is kept while the next is walked, so that what it hides is skipped. The walks themselves know nothing
//! of images, but for the number that a node begins with.

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::beams::Spans;
use super::hits::PACKETS;
use super::lighting::{Lit, Surfaces, place, shadow};
use super::pass::Pass;
use super::shadows::Light;
use super::shapes;
use super::surfaces::Layer;
use super::tiles::{self, BLOCKS, Beam, Entry, RAYS, Tile};
use crate::math::{Bounds, HIT_ROUNDING};
use crate::render::certified::Counts;
use crate::scene::Scene;
use crate::scene::camera::View;
use crate::simd::Lanes3;
use crate::structure::Store;
use crate::structure::bvh::Bvh;
use crate::structure::replicas::{Replica, ReplicaTree, Visitor};
use crate::structure::shapes::Shapes;

/// By block and axis: see [`Tile::varying`].
pub(super) type Rays = [[[f32; RAYS]; 3]; BLOCKS];

/// What a scene has images of, as far as these kernels walk it: other structures than the hierarchy are asked ray by ray.
#[derive(Clone, Copy)]
pub(super) struct Replicated<'a> {
    replicas: &'a ReplicaTree,
    bounds: Bounds,
    bvh: Option<&'a Bvh>,
    /// With the node of the first shape of the first image.
    shapes: Option<(&'a Shapes, u32)>,
}

impl<'a> Replicated<'a> {
    /// Of a scene, if it has images.
    pub(super) fn of(scene: &'a Scene) -> Option<Self> {
        let structure = scene.structure();
        let replicas = structure.replicas()?;
        let shapes = scene.shapes().map(|shapes| (shapes, structure.nodes()));
        let around_shapes = shapes.map_or(Bounds::EMPTY, |(shapes, _)| shapes.bounds());
        let (bvh, around) = match &structure.store {
            Store::Bvh(bvh) => (Some(bvh), bvh.bounds()),
            _ => (None, Bounds::EMPTY),
        };
        Some(Self { replicas, bounds: around.union(around_shapes), bvh, shapes })
    }

    /// The shapes of an image, with the node of its first one.
    #[inline(always)]
    fn shapes_of(&self, replica: &Replica) -> Option<(&'a Shapes, u32)> {
        self.shapes.map(|(shapes, first_node)| (shapes, first_node + replica.number * shapes.nodes()))
    }
}

/// Finds what every ray of the tile meets in any image. `rays` and `stack` are scratch.
#[simd]
pub(super) fn walk<S: Simd>(
    simd: S,
    replicated: Replicated,
    (view, beam): (&View, &Beam),
    tile: &mut Tile,
    rays: &mut Rays,
    stack: &mut Vec<Entry>,
) {
    *rays = tile.varying;
    tile.image_nodes = replicated.replicas.nodes;
    let mut images = Images { simd, replicated, view, beam, tile, rays, stack };
    replicated.replicas.visit(&replicated.bounds, &mut images);
    tile.varying = *rays;
}

/// What is drawn into a tile, image by image.
struct Images<'a, S: Simd> {
    simd: S,
    replicated: Replicated<'a>,
    view: &'a View,
    beam: &'a Beam,
    tile: &'a mut Tile,
    rays: &'a Rays,
    stack: &'a mut Vec<Entry>,
}

impl<S: Simd> Visitor for Images<'_, S> {
    #[inline(always)]
    fn near(&self, bounds: &Bounds) -> Option<f32> {
        tiles::open_from(self.simd, self.beam, self.tile, bounds)
    }

    #[inline(always)]
    fn look(&mut self, replica: Replica) {
        let Replica { shift, first_node, .. } = replica;
        let view = View { eye: self.view.eye - shift, ..*self.view };
        let beam = self.beam.moved_back(shift);
        if !self.beam.perspective {
            let shift = Lanes3::splat(self.simd, shift);
            for (moved, rays) in self.tile.varying.iter_mut().zip(self.rays) {
                Lanes3::load(self.simd, rays).minus(shift).store(moved);
            }
        }
        self.tile.first_node = first_node;
        if let Some(bvh) = self.replicated.bvh {
            tiles::walk(self.simd, bvh, &view, &beam, self.tile, self.stack, None);
        }
        if let Some(shapes) = self.replicated.shapes_of(&replica) {
            shapes::walk(self.simd, shapes, &view, &beam, self.tile, self.stack);
        }
    }
}

/// Surfaces as an image sees them.
pub(super) struct Moved {
    position: [[[f32; RAYS]; 3]; PACKETS],
    on: [[u32; RAYS]; PACKETS],
}

impl Moved {
    pub(super) fn new() -> Box<Self> {
        Box::new(Self { position: [[[0.0; RAYS]; 3]; PACKETS], on: [[0; RAYS]; PACKETS] })
    }
}

/// Clears the lanes of `lit` of all surfaces of the layer that do not see past every particle of every image in direction `toward`.
#[simd]
pub(super) fn shadow_of_images<S: Simd>(
    simd: S,
    replicated: Replicated,
    pass: &Pass,
    toward: Vec3,
    layer: &Layer,
    lit: &mut Lit,
    counts: &mut Counts,
) {
    let Some(light) = place(simd, &layer.position, toward, lit) else { return };
    let spans = Spans::of(simd, &lit.at, &lit.lanes);
    let mut images = Shadows { simd, replicated, pass, light, spans, layer, lit, counts };
    replicated.replicas.visit(&replicated.bounds, &mut images);
}

/// What shadows the surfaces of a film tile, image by image.
struct Shadows<'a, S: Simd> {
    simd: S,
    replicated: Replicated<'a>,
    pass: &'a Pass<'a>,
    /// Where the surfaces lie in the light, before any of them was found to be shadowed.
    light: Light,
    spans: Spans,
    layer: &'a Layer,
    lit: &'a mut Lit,
    counts: &'a mut Counts,
}

impl<S: Simd> Visitor for Shadows<'_, S> {
    #[inline(always)]
    fn near(&self, bounds: &Bounds) -> Option<f32> {
        if self.lit.lanes.iter().all(|&lanes| lanes == 0) {
            return None;
        }
        let Light { across, toward, origin, spread } = self.light;
        let center = bounds.center() - origin;
        let half = 0.5 * bounds.extent();
        let farthest = (center.abs() + half + bounds.center().abs() + origin.abs()).max_element();
        let half = half + 4.0 * HIT_ROUNDING * (farthest + spread);
        let meets = |axis: usize| {
            let (middle, reach) = (center.dot(across[axis]), half.dot(across[axis].abs()));
            middle - reach <= self.spans.high[axis] && middle + reach >= self.spans.low[axis]
        };
        let (middle, reach) = (center.dot(toward), half.dot(toward.abs()));
        (meets(0) && meets(1) && middle + reach >= self.spans.nearest()).then_some(middle - reach)
    }

    #[inline(always)]
    fn look(&mut self, replica: Replica) {
        let Replica { shift, first_node, .. } = replica;
        let (simd, toward) = (self.simd, self.light.toward);
        // Taken out meanwhile: the rest of the scratch is needed too.
        let mut moved = self.lit.moved.take().unwrap_or_else(Moved::new);
        for packet in (0..PACKETS).filter(|&packet| self.lit.lanes[packet] != 0) {
            let position = Lanes3::<f32x16<S>>::load(simd, &self.layer.position[packet]);
            position.minus(Lanes3::splat(simd, shift)).store(&mut moved.position[packet]);
            moved.on[packet] = self.layer.node[packet].map(|node| node.wrapping_sub(first_node));
        }
        let surfaces = Surfaces { position: &moved.position, on: &moved.on };
        if let Some(bvh) = self.replicated.bvh {
            shadow(simd, bvh, self.pass, toward, surfaces, self.lit, self.counts);
        }
        if let Some((shapes, first_shape)) = self.replicated.shapes_of(&replica) {
            // Counted as the nodes on which the surfaces lie.
            let shapes = (shapes, first_shape.wrapping_sub(first_node));
            let Lit { lanes, shadow_stack, .. } = &mut *self.lit;
            shapes::shadow(simd, shapes, toward, surfaces, lanes, shadow_stack);
        }
        self.lit.moved = Some(moved);
    }
}
