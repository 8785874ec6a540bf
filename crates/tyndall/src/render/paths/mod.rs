//! Light that goes from particle to particle, by path tracing.
//!
//! A path starts where the eye's ray met a surface. There the key light, or what is bright in an image, is looked at by a shadow ray, and the path
//! goes on in a direction that the surface's material draws; what leaves the particles sees what is far away in so far as looking at it has not found it
//! (the balance heuristic). Paths end after the bounces that are wanted, or by Russian roulette. Invariant: the expected value of every pixel is its radiance
//! with that many bounces; the same seed gives the same bits for any number of threads.
//!
//! Sources: J. Kajiya, "The rendering equation", SIGGRAPH 1986; E. Veach, L. Guibas, "Optimally combining sampling techniques for Monte Carlo
//! rendering", SIGGRAPH 1995.

mod clear;
mod far;
mod scatter;

use std::f32::consts::TAU;

use glam::Vec3;

use super::sampling::{Dimension, shuffled_point};
use super::surface::Surface;
use crate::math::Ray;
use crate::random::Stream;
use crate::scene::Scene;
use crate::scene::camera::View;
use crate::scene::light::{Lens, Lights, Paths};
use crate::scene::material::Material;
use clear::Body;
use far::Far;
use scatter::Scatter;

/// Paths whose throughput falls below this are ended with a chance.
const ROULETTE: f32 = 0.25;

/// Surfaces that light goes through or is mirrored by within clear bodies, at most: then a path ends.
const MOST_CLEAR: u32 = 64;

/// A sample of a pixel, whose random numbers are its own.
#[derive(Clone, Copy)]
pub(super) struct Sample {
    pub(super) seed: u32,
    /// Of the pixel.
    pub(super) pixel: [u32; 2],
    /// Among those of the pixel.
    pub(super) number: u32,
}

impl Sample {
    fn stream(&self) -> Stream {
        let [x, y] = self.pixel.map(u64::from);
        Stream::new(u64::from(self.seed), (y << 16 | x) << 32 | u64::from(self.number))
    }

    fn point(&self, dimension: Dimension) -> [f32; 2] {
        shuffled_point(self.seed, dimension, self.pixel[1] << 16 | self.pixel[0], self.number)
    }
}

/// Follows light in a scene.
pub(super) struct Tracer<'a> {
    scene: &'a Scene,
    paths: &'a Paths,
    far: Far<'a>,
}

impl<'a> Tracer<'a> {
    pub(super) fn new(scene: &'a Scene, paths: &'a Paths) -> Self {
        Self { scene, paths, far: Far::new(&paths.lights) }
    }

    /// RGB radiance along a ray that meets nothing, where what is far away is seen.
    pub(super) fn behind(&self, direction: Vec3) -> Option<Vec3> {
        let is_seen = matches!(self.paths.lights, Lights::Image { is_seen: true, .. });
        is_seen.then(|| self.far.seen(direction, None))
    }

    /// RGB radiance toward the origin of `ray`, which meets a node at a distance.
    pub(super) fn radiance(&self, ray: &Ray, met: (f32, u32), sample: Sample) -> Vec3 {
        let mut stream = sample.stream();
        let mut direction = ray.direction;
        let mut surface = Surface::new(self.scene, ray, met);
        let mut throughput = Vec3::ONE;
        let mut radiance = Vec3::ZERO;
        let (mut bounces, mut clear) = (0, 0);
        loop {
            let body = match self.paths.material {
                Material::Clear { index } => Body::at(self.scene, surface.node).map(|body| (body, index)),
                _ => None,
            };
            let next = match body {
                Some((body, index)) => {
                    clear += 1;
                    let out = clear::cross(self.scene, (&surface, body), direction, index, &mut stream);
                    throughput *= out.throughput;
                    if clear > MOST_CLEAR || throughput == Vec3::ZERO {
                        return radiance;
                    }
                    direction = out.direction;
                    let met = self.leave(out.origin, direction, out.node);
                    if met.is_none() {
                        // Nothing has looked at the light before.
                        return radiance + throughput * self.far.seen(direction, None);
                    }
                    met
                }
                None => {
                    let is_first = bounces == 0 && clear == 0;
                    let spread = |dimension, stream: &mut Stream| {
                        if is_first { sample.point(dimension) } else { [stream.unit(), stream.unit()] }
                    };
                    let scatter =
                        Scatter::new(&self.paths.material, surface.normal, -direction, surface.color);
                    let random = spread(Dimension::Key, &mut stream);
                    radiance += throughput * self.looked_for(&surface, &scatter, random);
                    let random = spread(Dimension::Sky, &mut stream);
                    direction = scatter.draw(random, stream.unit());
                    let thrown = scatter.evaluate(direction);
                    if thrown.density <= 0.0 || thrown.share == Vec3::ZERO {
                        return radiance;
                    }
                    throughput *= thrown.share / thrown.density;
                    let met = self.leave(surface.position, direction, surface.node);
                    if met.is_none() {
                        return radiance + throughput * self.far.seen(direction, Some(thrown.density));
                    }
                    bounces += 1;
                    met
                }
            };
            if bounces > self.paths.bounces {
                return radiance;
            }
            let most = throughput.max_element();
            if most < ROULETTE {
                if stream.unit() * ROULETTE >= most {
                    return radiance;
                }
                throughput *= ROULETTE / most;
            }
            let Some(next) = next else { return radiance };
            surface = next;
        }
    }

    /// The surface that is met from another in a direction, if any.
    fn leave(&self, origin: Vec3, direction: Vec3, from: u32) -> Option<Surface> {
        let ray = Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY };
        Some(Surface::new(self.scene, &ray, self.scene.enter(&ray, Some(from))?))
    }

    /// Light that a surface throws on and that looking for it finds.
    fn looked_for(&self, surface: &Surface, scatter: &Scatter, random: [f32; 2]) -> Vec3 {
        let Some(look) = self.far.look(random) else { return Vec3::ZERO };
        let thrown = scatter.evaluate(look.toward);
        if thrown.share == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let ray = Ray { origin: surface.position, direction: look.toward, t_min: 0.0, t_max: f32::INFINITY };
        if self.scene.is_shadowed(&ray, Some(surface.node)) {
            return Vec3::ZERO;
        }
        thrown.share * (look.radiance / (look.density + thrown.density))
    }
}

/// The ray of a sample through a lens, for one through the middle of the lens.
pub(super) fn through_lens(view: &View, lens: &Lens, ray: &Ray, sample: Sample) -> Ray {
    let sharp = ray.origin + ray.direction * (lens.focus / ray.direction.dot(view.forward));
    let random = sample.point(Dimension::Lens);
    let (radius, (sin, cos)) = (lens.radius * random[0].sqrt(), (TAU * random[1]).sin_cos());
    let origin = ray.origin + (radius * cos) * view.right + (radius * sin) * view.up;
    Ray { origin, direction: (sharp - origin).normalize_or(ray.direction), ..*ray }
}

#[cfg(test)]
mod tests;
