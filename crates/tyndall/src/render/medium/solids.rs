//! Opaque particles and bonds within a medium. They end rays, shadow the medium and each other, and throw light back evenly in their colors.

use std::f32::consts::{PI, TAU};

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::field::{Field, sample};
use crate::math::{Bounds, Ray};
use crate::medium::grid::Lattice;
use crate::pages;
use crate::render::surface::Surface;
use crate::scene::Scene;

/// The particles and shapes of a scene as matte bodies, measured from the same origin as the medium. Of shapes bonds alone stop and throw back light that is smooth. Lights, looks and background of the scene do not matter; it must not be cut.
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

    /// The surface that a ray meets, but that of node `except`; the ray ends there.
    #[inline]
    pub(super) fn meet(&self, ray: &mut Ray, except: Option<u32>) -> Option<Surface> {
        let met = self.scene.enter(ray, except)?;
        ray.t_max = met.0;
        Some(Surface::new(self.scene, ray, met))
    }

    /// The surface that a ray from the eye shows; the ray ends at what it meets, also where that hides without being shown.
    #[inline]
    pub(super) fn show(&self, ray: &mut Ray) -> Option<Surface> {
        let met = self.scene.enter(ray, None)?;
        ray.t_max = met.0;
        (!self.scene.is_holdout(met.1)).then(|| Surface::new(self.scene, ray, met))
    }

    /// Whether a ray meets anything but node `except`.
    pub(super) fn block(&self, ray: &Ray, except: Option<u32>) -> bool {
        self.scene.is_shadowed(ray, except)
    }

    /// The balls that stand for all on a lattice: spheres, and bonds as rows of spheres.
    fn balls(&self, spacing: f32) -> impl Iterator<Item = Ball> {
        let structure = self.scene.structure();
        let spheres = (0..structure.nodes()).filter(|&node| structure.shows(node)).map(|node| {
            let (center, radius) = structure.sphere(node);
            Ball { node, center, radius, stops: 1.0, holds: 1.0 }
        });
        spheres.chain(self.bonds(spacing))
    }

    /// Those of bonds.
    fn bonds(&self, spacing: f32) -> impl Iterator<Item = Ball> {
        let structure = self.scene.structure();
        let halves = self.scene.shapes().into_iter().flat_map(|it| it.halves(structure));
        halves.flat_map(move |(node, [from, to], radius)| {
            let length = from.distance(to);
            let count = (length / (2.0 * radius).max(0.5 * spacing)).ceil();
            // A cylinder stops what a fourth of its side does on average, a sphere what its circle does.
            let stops = 0.5 * length / (radius * count.max(1.0));
            (0..count as u32).map(move |place| {
                let center = from + (place as f32 + 0.5) / count * (to - from);
                Ball { node, center, radius, stops, holds: 1.5 * stops }
            })
        })
    }

    /// The share that the balls on a lattice throw back of what they meet at a point so that the bodies throw back theirs: the mean by cross section.
    fn color(&self, spacing: f32) -> Vec3 {
        let structure = self.scene.structure();
        let weighted = |node: u32, radius: f32, share: f32| {
            let color = Vec3::from(self.scene.color(structure.original(node)));
            let (area, caught) = (share * radius * radius, caught(radius, spacing));
            (area * (1.0 + caught) * color / (1.0 + caught * color)).extend(area)
        };
        let of_sphere = |node: u32| weighted(node, structure.sphere(node).1, 1.0);
        // The same sum for any number of threads: chunks of a fixed size, in order.
        let chunks: Vec<Vec4> = (0..structure.nodes().div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| chunk * CHUNK..((chunk + 1) * CHUNK).min(structure.nodes()))
            .map(|nodes| nodes.filter(|&node| structure.shows(node)).map(of_sphere).sum())
            .collect();
        let bonds = self.bonds(spacing).map(|it| weighted(it.node, it.radius, it.stops));
        let sum: Vec4 = chunks.into_iter().chain(bonds).sum();
        sum.truncate() / sum.w.max(f32::MIN_POSITIVE)
    }

    /// Dims the `transmittances` of the samples of a lattice, `channels` each, by the share of their cells at which a light is hidden; `toward` tells for a place the
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
            // Bodies that hold the place are entered by a ray from the light.
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
            if of_sample.iter().all(|it| *it <= 0.0) {
                return;
            }
            let middle = lattice.position(sample(lattice, place));
            let hidden =
                CORNERS.iter().filter(|it| is_hidden(middle + 0.25 * lattice.spacing * **it)).count();
            let lit = 1.0 - hidden as f32 / CORNERS.len() as f32;
            of_sample.iter_mut().for_each(|it| *it *= lit);
        });
    }

    /// What the bodies are for light that is smooth: how much of it they stop, per unit length, and the share of that which they throw back.
    pub(super) fn smooth(&self, lattice: Lattice) -> Smooth {
        let nothing = || pages::zeros(lattice.sample_count() as usize);
        let mut extinction = nothing();
        let mut glow = self.scene.glows().then(|| [(); 3].map(|()| nothing()));
        let structure = self.scene.structure();
        let thickness = Thickness::new();
        for Ball { node, center, radius, stops, .. } in self.balls(lattice.spacing) {
            let original = structure.original(node);
            // What leaves a ball was thrown back within it.
            let color = Vec3::from(self.scene.color(original));
            let radiance =
                Vec3::from(self.scene.glow(original)) / (1.0 + caught(radius, lattice.spacing) * color);
            spread(
                &lattice,
                center,
                radius,
                |wide| stops * thickness.of(wide),
                |place, added| {
                    // What overlaps is not thicker than what is full.
                    let added =
                        (added.min(MOST) / lattice.spacing).min(MOST / lattice.spacing - extinction[place]);
                    extinction[place] += added;
                    for (sum, radiance) in glow.iter_mut().flatten().zip(radiance.to_array()) {
                        sum[place] += added * radiance;
                    }
                },
            );
        }
        for values in glow.iter_mut().flatten() {
            values.iter_mut().zip(&extinction).for_each(|(sum, it)| *sum /= it.max(f32::MIN_POSITIVE));
        }
        Smooth { extinction, color: self.color(lattice.spacing), glow }
    }

    /// The share of each cell of a lattice that lies within bodies, where they do not overlap.
    pub(super) fn covered(&self, lattice: Lattice) -> Field {
        let mut values = pages::zeros(lattice.sample_count() as usize);
        for Ball { center, radius, holds, .. } in self.balls(lattice.spacing) {
            // The ball is wider than the sphere, of which there is no more than there is.
            let filled = |wide: f32| holds * 4.0 / 3.0 * PI * wide.powi(3) / volume(wide);
            spread(&lattice, center, radius, filled, |place, added| {
                values[place] = (values[place] + added).min(1.0_f32);
            });
        }
        Field { lattice, values }
    }
}

/// A ball that stands for a sphere, or with others of its width for a bond.
struct Ball {
    node: u32,
    center: Vec3,
    radius: f32,
    /// How much it stops of what a sphere of that radius does, and how much of its space it takes.
    stops: f32,
    holds: f32,
}

/// Of a tetrahedron around a sample: places that stand for its cell.
const CORNERS: [Vec3; 4] =
    [Vec3::ONE, Vec3::new(1.0, -1.0, -1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::new(-1.0, -1.0, 1.0)];
/// Nodes whose colors are summed at a time.
const CHUNK: u32 = 1 << 16;

/// See [`Solids::smooth`].
#[derive(Clone, Debug)]
pub(super) struct Smooth {
    /// Per unit length, at the samples of a lattice.
    pub(super) extinction: Vec<f32>,
    /// RGB share that is thrown back at each point.
    pub(super) color: Vec3,
    /// Of each channel the radiance that they give off, at the samples, if they do.
    pub(super) glow: Option<[Vec<f32>; 3]>,
}

/// How often light that is thrown back within the ball of a sphere meets the ball again for each time that it escapes: half the radius in cells, a fit to solved
/// transport.
fn caught(radius: f32, spacing: f32) -> f32 {
    0.5 * radius / spacing
}

/// Tells for each sample that a sphere covers how much it adds there: `amount` of the radius in cells, all over the ball that stands for the sphere, whose rim is as wide as a cell, so that it has
/// no steps.
fn spread(
    lattice: &Lattice,
    center: Vec3,
    radius: f32,
    amount: impl Fn(f32) -> f32,
    mut add: impl FnMut(usize, f32),
) {
    let Lattice { origin, spacing, size } = *lattice;
    let wide = radius / spacing;
    if wide <= 0.0 {
        return;
    }
    let place = (center - origin) / spacing;
    let least = (place - wide - RIM).ceil().max(Vec3::ZERO);
    let most = (place + wide + RIM).floor();
    // The outermost samples stay free: light flows in there.
    let range = |axis: usize| {
        let last = size[axis].saturating_sub(1).max(1);
        (least[axis] as u32).clamp(1, last)..((most[axis] + 1.0).max(1.0) as u32).clamp(1, last)
    };
    let cells = || {
        let rows = range(2).flat_map(|k| range(1).map(move |j| [j, k]));
        rows.flat_map(|[j, k]| {
            range(0).map(move |i| {
                let away = (Vec3::new(i as f32, j as f32, k as f32) - place).length();
                (((k * size[1] + j) * size[0] + i) as usize, share(wide, away))
            })
        })
    };
    // Samples have as much in all as the ball has.
    let sum: f32 = cells().map(|(_, share)| share).sum();
    if sum > 0.0 {
        let each = amount(wide) * (volume(wide) / sum).min(MOST_EACH);
        cells().filter(|(_, share)| *share > 0.0).for_each(|(place, share)| add(place, each * share));
    }
}

/// How far the rim of a ball reaches beyond the sphere, in cells.
const RIM: f32 = 0.5;
/// What samples of a ball that lies between them have at most instead of others.
const MOST_EACH: f32 = 4.0;
/// The most that overlapping bodies stop in a cell.
const MOST: f32 = 8.0;

/// Of a ball for a sphere of a radius in cells, the share that is there at a distance from the middle.
fn share(wide: f32, away: f32) -> f32 {
    (wide + RIM - away).clamp(0.0, 1.0)
}

/// The integral of [`share`] over the ball.
fn volume(wide: f32) -> f32 {
    let (inner, outer) = ((wide - RIM).max(0.0), wide + RIM);
    let shell = |radius: f32| radius.powi(3) / 3.0 * outer - radius.powi(4) / 4.0;
    4.0 * PI * (inner.powi(3) / 3.0 * (wide + RIM - inner).min(1.0) + shell(outer) - shell(inner))
}

/// How thick balls are, by the radius of their spheres: they stop as much light as the spheres do by their cross sections.
struct Thickness(Vec<f32>);

impl Thickness {
    /// Radii of the table, in cells: from the first on in ratios of the square root of two.
    const FIRST: f32 = 1.0 / 64.0;
    const COUNT: usize = 28;

    fn new() -> Self {
        let of_entry = |entry: usize| {
            let wide = Self::FIRST * 2.0_f32.powf(0.5 * entry as f32);
            let wanted = PI * wide * wide;
            let (mut low, mut high) = (0.0, 64.0);
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                if cross_section(wide, middle) < wanted { low = middle } else { high = middle }
            }
            // What small spheres stop goes by their area.
            0.5 * (low + high) / (wide * wide)
        };
        Self((0..Self::COUNT).map(of_entry).collect())
    }

    /// Extinction in one over a cell.
    fn of(&self, wide: f32) -> f32 {
        let place = (2.0 * (wide / Self::FIRST).log2()).clamp(0.0, (Self::COUNT - 1) as f32);
        let first = (place as usize).min(Self::COUNT - 2);
        let (a, b) = (self.0[first], self.0[first + 1]);
        wide * wide * (a + (place - first as f32) * (b - a))
    }
}

/// The area, in cells, of what a ball of an extinction stops: 1 - e^-depth, over all rays through it.
fn cross_section(wide: f32, extinction: f32) -> f32 {
    const STEPS: usize = 48;
    let outer = wide + RIM;
    let at = |step: usize| (step as f32 + 0.5) / STEPS as f32;
    let rays = (0..STEPS).map(|step| {
        let from_middle = outer * at(step);
        let half = (outer * outer - from_middle * from_middle).max(0.0).sqrt();
        let depth: f32 = (0..STEPS).map(|step| share(wide, from_middle.hypot(half * at(step)))).sum();
        let stopped = 1.0 - (-extinction * depth * 2.0 * half / STEPS as f32).exp();
        TAU * from_middle * stopped * outer / STEPS as f32
    });
    rays.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn balls_stop_what_spheres_do() {
        let thickness = Thickness::new();
        for wide in [0.02, 0.3, 0.5, 0.8, 1.0, 1.7, 4.0, 30.0, 100.0] {
            let found = cross_section(wide, thickness.of(wide));
            assert!((found / (PI * wide * wide) - 1.0).abs() < 0.03, "{wide}: {found}");
            let steps = 2000;
            let sum: f64 = (0..steps)
                .map(|step| {
                    let away = (wide + RIM) * (step as f32 + 0.5) / steps as f32;
                    f64::from(4.0 * PI * away * away * share(wide, away) * (wide + RIM)) / steps as f64
                })
                .sum();
            assert!((f64::from(volume(wide)) / sum - 1.0).abs() < 1e-3, "{wide}: {} {sum}", volume(wide));
        }
    }
}
