//! Photons: from the lights and from glowing matter through the medium, stored where they scatter.
//!
//! Takes a medium and its lights, gives positions, directions of travel and RGB power. A stored photon's power is what is
//! scattered there: the sum of `power * phase(cosine)` over the photons of a small ball, over its volume, is the radiance that
//! the medium adds per unit length. Invariant: emitted power is what leaves plus what is absorbed, to rounding where extinction is
//! grey and on average where it is not; the same seed gives the same photons in the same order for any number of threads.
//! Source: H. Jensen, P. Christensen, "Efficient simulation of light transport in scenes with participating media using photon
//! maps", SIGGRAPH 1998; distances by [`FreePath`].

use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::free_path::{FreePath, Tracker};
use super::glowing::Glowing;
use super::solids::{Solids, cosine_direction};
use crate::error::{Error, Result};
use crate::math::{Bounds, Ray};
use crate::medium::light::Emission;
use crate::medium::{Light, Medium};
use crate::progress::Progress;
use crate::random::Stream;

/// The knobs of photon tracing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Photons that are emitted, shared out between the lights by their power; 1 to 2^32.
    pub count: u64,
    /// Another seed gives other photons.
    pub seed: u32,
    /// How the distance to the next interaction is drawn.
    pub free_path: FreePath,
    /// Which scatterings are stored.
    pub stored: Stored,
    /// Memory that those may take, in bytes, sorting included; `None`: as much as it takes.
    pub memory_bytes: Option<u64>,
}

/// Which scatterings of a photon are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stored {
    /// Every one.
    All,
    /// Those after the first, whose light is found in another way; of what the medium emits every one.
    Multiple,
}

/// A photon at a scattering.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Photon {
    /// Where.
    pub position: Vec3,
    /// Where it travelled to when it came; unit length.
    pub direction: Vec3,
    /// RGB power that is scattered there.
    pub power: Vec3,
}

/// What photon tracing gives.
#[derive(Clone, Debug, Default)]
pub struct Photons {
    /// The stored ones, in the order of emission.
    pub stored: Vec<Photon>,
    /// How many were emitted.
    pub emitted: u64,
    /// Interactions of all of them, stored or not.
    pub interactions: u64,
    /// RGB power that was emitted.
    pub emitted_power: DVec3,
    /// RGB power that left the medium, scattered or not.
    pub escaped_power: DVec3,
    /// RGB power that was absorbed.
    pub absorbed_power: DVec3,
}

/// Photons that one thread follows at a time.
const CHUNK: u64 = 4096;

/// Memory that a stored photon takes at most at one time: twice itself while it is joined and sorted, and its place.
pub const STORED_BYTES: u64 = 2 * size_of::<Photon>() as u64 + 16;

/// Follows photons of all `lights` through `medium`. Fails with [`Error::Setting`] for an impossible count, with [`Error::Memory`] as
/// soon as more are stored than may be, and when interrupted.
pub fn trace(
    medium: &Medium,
    lights: &[Light],
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Photons> {
    trace_around(medium, lights, None, settings, progress)
}

/// The same with opaque bodies, which photons do not enter: they throw them back, or end them. Light that came from a body counts as scattered.
pub fn trace_around(
    medium: &Medium,
    lights: &[Light],
    solids: Option<Solids>,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Photons> {
    if !(1..=1 << 32).contains(&settings.count) {
        return Err(Error::setting("photons", settings.count, "1 to 2^32"));
    }
    progress.begin("photons", Some(settings.count), "photons");
    let bounds = solids.map_or(medium.bounds(), |it| medium.bounds().union(it.bounds()));
    let tracer = Tracer { tracker: Tracker::new(medium), solids, bounds, settings };
    let glowing = Glowing::new(medium);
    let lights = lights.iter().map(Emitter::Light).chain(glowing.iter().map(Emitter::Matter));
    let chunks = tracer.chunks(lights.collect());
    let available_bytes = settings.memory_bytes.unwrap_or(u64::MAX);
    let [emitted, stored] = [AtomicU64::new(0), AtomicU64::new(0)];
    let fits = || STORED_BYTES.saturating_mul(stored.load(Relaxed)) <= available_bytes;
    let traced: Vec<Photons> = chunks
        .into_par_iter()
        .map(|chunk| {
            if progress.cancelled() || !fits() {
                return Photons::default();
            }
            progress.advance(chunk.end - chunk.first);
            let photons = tracer.chunk(&chunk);
            emitted.fetch_add(photons.emitted, Relaxed);
            stored.fetch_add(photons.stored.len() as u64, Relaxed);
            photons
        })
        .collect();
    if progress.cancelled() {
        return Err(Error::Interrupted);
    }
    if !fits() {
        // The work was stopped: what all of it needs follows from the part that was done.
        let each = STORED_BYTES as f64 * stored.into_inner() as f64 / emitted.into_inner().max(1) as f64;
        let fitting = (0.9 * available_bytes as f64 / each) as u64;
        return Err(Error::Memory {
            what: format!("storing the scatterings of {} photons", settings.count),
            needed_bytes: (each * settings.count as f64) as u64,
            available_bytes,
            hint: format!("try --photons {fitting}, and more --photon-passes instead"),
        });
    }
    Ok(Photons::join(traced))
}

/// What emits photons.
#[derive(Clone, Copy)]
enum Emitter<'a> {
    Light(&'a Light),
    Matter(&'a Glowing<'a>),
}

impl Emitter<'_> {
    fn power(&self, bounds: &Bounds) -> Vec3 {
        match self {
            Self::Light(light) => light.power(bounds),
            Self::Matter(glowing) => glowing.power(),
        }
    }

    fn emit(&self, bounds: &Bounds, stream: &mut Stream) -> Emission {
        match self {
            Self::Light(light) => light.emit(bounds, std::array::from_fn(|_| stream.unit())),
            Self::Matter(glowing) => glowing.emit(stream),
        }
    }
}

/// Photons of one light.
struct Chunk<'a> {
    emitter: Emitter<'a>,
    /// Numbers of the photons, of all lights.
    first: u64,
    end: u64,
    /// How many the light emits in all.
    of: u64,
}

struct Tracer<'a> {
    tracker: Tracker<'a>,
    solids: Option<Solids<'a>>,
    /// Of all that light meets.
    bounds: Bounds,
    settings: &'a Settings,
}

impl Tracer<'_> {
    /// The work: every light with power gets its share of the photons, at least one.
    fn chunks<'a>(&self, emitters: Vec<Emitter<'a>>) -> Vec<Chunk<'a>> {
        let powers: Vec<f64> =
            emitters.iter().map(|emitter| f64::from(emitter.power(&self.bounds).element_sum())).collect();
        let total: f64 = powers.iter().sum();
        let mut chunks = Vec::new();
        let mut first = 0;
        for (emitter, power) in emitters.into_iter().zip(powers).filter(|(_, power)| *power > 0.0) {
            let of = ((self.settings.count as f64 * power / total).round() as u64).max(1);
            let starts = (first..first + of).step_by(CHUNK as usize);
            chunks.extend(starts.map(|start| {
                let end = (start + CHUNK).min(first + of);
                Chunk { emitter, first: start, end, of }
            }));
            first += of;
        }
        chunks
    }

    fn chunk(&self, chunk: &Chunk) -> Photons {
        let mut photons = Photons { emitted: chunk.end - chunk.first, ..Photons::default() };
        for number in chunk.first..chunk.end {
            let mut stream = Stream::new(u64::from(self.settings.seed), number);
            let mut emission = chunk.emitter.emit(&self.bounds, &mut stream);
            emission.power /= chunk.of as f32;
            if emission.power != Vec3::ZERO {
                let stores_first =
                    self.settings.stored == Stored::All || matches!(chunk.emitter, Emitter::Matter(_));
                self.follow(emission, stores_first, &mut stream, &mut photons);
            }
        }
        photons
    }

    /// Follows a photon to its end; gives the direction in which it left, `None` if it was absorbed.
    fn follow(
        &self,
        emission: Emission,
        stores_first: bool,
        stream: &mut Stream,
        photons: &mut Photons,
    ) -> Option<Vec3> {
        let optics = self.tracker.medium().optics();
        let albedo = Vec3::from(optics.albedo);
        let Emission { mut origin, mut direction, mut power } = emission;
        photons.emitted_power += power.as_dvec3();
        let mut is_first = true;
        let mut from = None;
        loop {
            let mut ray = Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY };
            let met = self.solids.and_then(|solids| solids.meet(&mut ray, from));
            let flown = self.tracker.next(self.settings.free_path, &ray, &mut power, stream);
            if let (None, Some(surface)) = (flown, met) {
                // What is thrown back has been neither seen from the light nor scattered: it is stored where it is.
                (origin, from, is_first) = (surface.position, Some(surface.node), false);
                let thrown = power * surface.color;
                let survival = thrown.max_element() / power.max_element();
                if stream.unit() >= survival {
                    photons.absorbed_power += power.as_dvec3();
                    return None;
                }
                photons.absorbed_power += (power - thrown / survival).as_dvec3();
                power = thrown / survival;
                direction = cosine_direction(&surface, [stream.unit(), stream.unit()]);
                continue;
            }
            from = None;
            let Some(distance) = flown else {
                photons.escaped_power += power.as_dvec3();
                return Some(direction);
            };
            origin += distance * direction;
            photons.interactions += 1;
            let scattered = power * albedo;
            if !is_first || stores_first {
                photons.stored.push(Photon { position: origin, direction, power: scattered });
            }
            is_first = false;
            // Russian roulette by the share that is left: power stays as it is where the albedo is grey.
            let survival = scattered.max_element() / power.max_element();
            if stream.unit() >= survival {
                photons.absorbed_power += power.as_dvec3();
                return None;
            }
            photons.absorbed_power += (power - scattered / survival).as_dvec3();
            power = scattered / survival;
            direction = optics.phase.sample(direction, [stream.unit(), stream.unit()]);
        }
    }
}

impl Photons {
    /// All of the parts, in order.
    fn join(parts: Vec<Self>) -> Self {
        let mut joined = Self::default();
        joined.stored.reserve_exact(parts.iter().map(|part| part.stored.len()).sum());
        for part in parts {
            joined.stored.extend_from_slice(&part.stored);
            joined.emitted += part.emitted;
            joined.interactions += part.interactions;
            joined.emitted_power += part.emitted_power;
            joined.escaped_power += part.escaped_power;
            joined.absorbed_power += part.absorbed_power;
        }
        joined
    }
}

#[cfg(test)]
mod tests;
