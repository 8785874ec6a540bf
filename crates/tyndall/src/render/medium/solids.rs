//! Opaque particles within a medium. They end rays, shadow the medium and each other, and throw light back evenly in their colors.

use std::f32::consts::{PI, TAU};

use glam::Vec3;
use rayon::prelude::*;

use super::field::{Field, sample};
use crate::math::{Bounds, Ray};
use crate::medium::grid::Lattice;
use crate::pages;
use crate::render::surface::{self, Surface};
use crate::scene::Scene;

/// The particles and shapes of a scene as matte bodies, measured from the same origin as the medium. Lights, looks and background of the scene do not matter.
#[derive(Clone, Copy)]
pub struct Solids<'a> {
    scene: &'a Scene,
}

/// How much of the light along a direction is thrown on by a matte white surface, times the cosine; the density of [`cosine_direction`].
pub(super) fn thrown(surface: &Surface, toward: Vec3) -> f32 {
    surface.normal.dot(toward).max(0.0) / PI
}

/// A direction away from a surface, drawn in proportion to its cosine by two random numbers in [0, 1).
pub(super) fn cosine_direction(surface: &Surface, random: [f32; 2]) -> Vec3 {
    let (u, v) = surface.normal.any_orthonormal_pair();
    let (radius, (sin, cos)) = (random[0].sqrt(), (TAU * random[1]).sin_cos());
    let height = (1.0 - random[0]).max(0.0).sqrt();
    (radius * cos * u + radius * sin * v + height * surface.normal).normalize()
}

impl<'a> Solids<'a> {
    /// Those of a scene.
    pub fn new(scene: &'a Scene) -> Self {
        Self { scene }
    }

    /// The box of all.
    pub(super) fn bounds(&self) -> Bounds {
        self.scene.structure().bounds()
    }

    /// The distance at which a ray meets a surface, and the surface, but that of node `except`.
    pub(super) fn meet(&self, ray: &Ray, except: Option<u32>) -> Option<(f32, Surface)> {
        let met = surface::meet(self.scene, ray, except)?;
        Some((met.0, Surface::new(self.scene, ray, met)))
    }

    /// Whether a ray meets anything but node `except`.
    pub(super) fn block(&self, ray: &Ray, except: Option<u32>) -> bool {
        surface::is_blocked(self.scene, ray, except)
    }

    /// Mean color.
    fn color(&self) -> Vec3 {
        let nodes = self.scene.structure().nodes();
        let color = |node: u32| Vec3::from(self.scene.color(self.scene.structure().original(node)));
        // The same sum for any number of threads: chunks of a fixed size, in order.
        let chunks: Vec<Vec3> = (0..nodes.div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| (chunk * CHUNK..((chunk + 1) * CHUNK).min(nodes)).map(color).sum())
            .collect();
        chunks.into_iter().sum::<Vec3>() / nodes.max(1) as f32
    }

    /// Sets to 0 those of the `transmittances` of the samples of a lattice, `channels` each, at which a light is hidden; `toward` tells for a sample's place the
    /// direction and distance of the light. Within a body light ends at its middle: so samples on the bright side of its surface are not dark.
    pub(super) fn shade(
        &self,
        lattice: &Lattice,
        transmittances: &mut [f32],
        channels: usize,
        toward: impl Fn(Vec3) -> (Vec3, f32) + Sync,
    ) {
        let structure = self.scene.structure();
        let nodes = (0..structure.nodes()).into_par_iter();
        let reach = 2.0 * nodes.map(|node| structure.sphere(node).1).reduce(|| 0.0, f32::max);
        let is_hidden = |at: Vec3| {
            let (direction, distance) = toward(at);
            let ray = Ray { origin: at, direction, t_min: 0.0, t_max: distance };
            if self.block(&ray, None) {
                return true;
            }
            // Bodies that hold the sample are entered by a ray from the light.
            let back =
                Ray { origin: at + reach * direction, direction: -direction, t_min: 0.0, t_max: reach };
            let mut is_behind = false;
            structure.hits(&back, &mut |_, node| {
                let (center, radius) = structure.sphere(node);
                let from_center = at - center;
                is_behind |=
                    from_center.length_squared() < radius * radius && from_center.dot(direction) < 0.0;
            });
            is_behind
        };
        let samples = transmittances.par_chunks_exact_mut(channels).enumerate().with_min_len(1024);
        samples.for_each(|(place, of_sample)| {
            if of_sample.iter().any(|it| *it > 0.0) && is_hidden(lattice.position(sample(lattice, place))) {
                of_sample.fill(0.0);
            }
        });
    }

    /// What the bodies are for light that is smooth: how much of it they stop, per unit length, and the share of that which they throw back.
    pub(super) fn smooth(&self, lattice: Lattice) -> Smooth {
        let mut extinction = Field { lattice, values: pages::zeros(lattice.sample_count() as usize) };
        let structure = self.scene.structure();
        for node in 0..structure.nodes() {
            let (center, radius) = structure.sphere(node);
            spread(&mut extinction, center, radius);
        }
        Smooth { extinction: extinction.values, color: self.color() }
    }
}

/// Nodes whose colors are summed at a time.
const CHUNK: u32 = 1 << 16;

/// See [`Solids::smooth`].
#[derive(Clone, Debug)]
pub(super) struct Smooth {
    /// Per unit length, at the samples of a lattice.
    pub(super) extinction: Vec<f32>,
    /// RGB share.
    pub(super) color: Vec3,
}

/// Optical thickness of a sample's cell that is full of a body.
const FULL: f32 = 4.0;

/// Adds the extinction of a sphere to the samples that it covers. Spheres that are small beside a cell stop light like dust, by their cross sections: 3 / (4 radius)
/// of the volume that they fill. Of large ones each cell within is full.
fn spread(extinction: &mut Field, center: Vec3, radius: f32) {
    let Lattice { origin, spacing, size } = extinction.lattice;
    if radius <= 0.0 {
        return;
    }
    let place = (center - origin) / spacing;
    // Half a cell is the least that is resolved.
    let wide = (radius / spacing).max(0.5);
    let least = (place - wide - 1.0).ceil().max(Vec3::ZERO);
    let most = (place + wide + 1.0).floor();
    // The outermost samples stay free: light flows in there.
    let range = |axis: usize| {
        let last = size[axis].saturating_sub(1).max(1);
        (least[axis] as u32).clamp(1, last)..((most[axis] + 1.0).max(1.0) as u32).clamp(1, last)
    };
    // Shares of the cells, and of all of them: that of a sphere smaller than half a cell is its volume.
    let share = |i: u32, j: u32, k: u32| {
        let away = (Vec3::new(i as f32, j as f32, k as f32) - place).length();
        (wide + 0.5 - away).clamp(0.0, 1.0)
    };
    let volume = 4.0 / 3.0 * PI * (radius / spacing).powi(3);
    let mut sum = 0.0;
    for k in range(2) {
        for j in range(1) {
            for i in range(0) {
                sum += share(i, j, k);
            }
        }
    }
    if sum <= 0.0 {
        return;
    }
    let filled = (volume / sum).min(1.0);
    let full = (0.75 / radius).max(FULL / spacing * (radius / spacing).min(1.0));
    for k in range(2) {
        for j in range(1) {
            for i in range(0) {
                let value = &mut extinction.values[((k * size[1] + j) * size[0] + i) as usize];
                *value = (*value + full * filled * share(i, j, k)).min(MOST / spacing);
            }
        }
    }
}

/// The most that overlapping bodies stop in a cell.
const MOST: f32 = 8.0;
