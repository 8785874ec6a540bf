//! `cloud1`, `cloud2`, `smoke`: puffs and a plume, drawn out by frozen turbulence, as input for a medium.
//!
//! The domains of the clouds are boxes of about 20 units, y up; no particle lies outside. Attributes: `density`, how much a
//! particle holds, 1 at a source; `age`, from 0 to 1; `smoke` has `temperature` (K) too. The radius is for drawing particles
//! as spheres, a third of their mean distance at the published count; a medium's smoothing length is a setting of the medium.

use glam::Vec3;

use super::turbulence::Turbulence;
use super::{Filled, Law, Particle, Plan, TABLES, cell};
use crate::particles::Radii;
use crate::random::Stream;

/// Tries to place a particle inside the box before it is put on the box' wall, which should never be needed.
const TRIES: u64 = 64;

/// A flat slab of 160 puffs.
pub(super) fn cloud1(count: u64, seed: u64) -> Plan<'static> {
    cloud(count, seed, Vec3::new(18.9, 2.3, 20.0), 160, 500_000.0)
}

/// A heaped cluster of 40 puffs.
pub(super) fn cloud2(count: u64, seed: u64) -> Plan<'static> {
    cloud(count, seed, Vec3::new(20.0, 10.7, 20.0), 40, 50_000.0)
}

/// A plume from a hot ball.
pub(super) fn smoke(count: u64, seed: u64) -> Plan<'static> {
    let law = Smoke { seed, field: Turbulence::new(seed) };
    let mut attributes = scalars();
    attributes.push(Filled::in_unit("temperature", "K"));
    plan(law, SMOKE, 0.05, count as f64 / 326_752.0, attributes)
}

fn scalars() -> Vec<Filled> {
    vec![Filled::real("density"), Filled::real("age")]
}

/// `radius` is that at the published count, `more` how many times that count there are.
fn plan(
    law: impl Law + 'static,
    size: Vec3,
    radius: f64,
    more: f64,
    attributes: Vec<Filled>,
) -> Plan<'static> {
    let radius = if more > 0.0 { radius / more.cbrt() } else { radius };
    Plan {
        law: Box::new(law),
        radii: Radii::Uniform(radius as f32),
        attributes,
        cell: Some(cell(size.as_dvec3(), [false; 3])),
        length_unit: None,
    }
}

/// The first of a particle's tries that lies between the corners, else the last one moved there.
fn inside(low: Vec3, high: Vec3, mut attempt: impl FnMut(u64) -> Particle) -> Particle {
    let fits = |it: Vec3| it.cmpgt(low).all() && it.cmplt(high).all();
    let mut particle = attempt(0);
    for number in 1..TRIES {
        if fits(particle.position) {
            return particle;
        }
        particle = attempt(number);
    }
    particle.position = particle.position.clamp(low, high);
    particle
}

struct Cloud {
    seed: u64,
    field: Turbulence,
    size: Vec3,
    puffs: Vec<Puff>,
}

struct Puff {
    center: Vec3,
    radius: f32,
    age: f32,
    /// Volume of this puff and those before it, in volumes of all.
    share: f32,
}

fn cloud(count: u64, seed: u64, size: Vec3, puff_count: usize, published: f64) -> Plan<'static> {
    let mut stream = Stream::new(seed, TABLES);
    let sizes: Vec<f32> = (0..puff_count).map(|_| stream.gamma(3)).collect();
    let mean = sizes.iter().sum::<f32>() / puff_count as f32;
    let typical = 0.115 * size.x.min(size.z) / (puff_count as f32 / 24.0).sqrt();
    let mut volume = 0.0;
    let puff = |size_share: f32| {
        let radius = (size_share / mean * typical).min(0.30 * size.y);
        let mut center = size * (0.5 + 0.21 * stream.normal3());
        center.y = 0.32 * size.y + 0.9 * radius * stream.unit();
        let center = center.clamp(0.12 * size, 0.88 * size);
        volume += radius.powi(3);
        Puff { center, radius, age: stream.unit(), share: volume }
    };
    let mut puffs: Vec<Puff> = sizes.into_iter().map(puff).collect();
    for puff in &mut puffs {
        puff.share /= volume;
    }
    let law = Cloud { seed, field: Turbulence::new(seed), size, puffs };
    // The clouds fill about a tenth of their boxes.
    let spacing = (0.1 * f64::from(size.element_product()) / published).cbrt();
    plan(law, size, spacing / 3.0, count as f64 / published, scalars())
}

impl Law for Cloud {
    fn particle(&self, k: u64) -> Particle {
        let mut stream = Stream::new(self.seed, k);
        inside(0.02 * self.size, 0.98 * self.size, |_| {
            let pick = stream.unit();
            let puff =
                &self.puffs[self.puffs.partition_point(|it| it.share <= pick).min(self.puffs.len() - 1)];
            let share = stream.unit().powf(0.40);
            let mut position = puff.center + puff.radius * share * stream.direction();
            for _ in 0..6 {
                let slow = 0.085 * self.field.at(position, 8.0);
                position += slow + 0.03 * self.field.at(position + 1.7, 2.3);
            }
            let density = (1.0 - 0.8 * share * share) * (0.15 * stream.normal()).exp();
            // Puffs dissolve from outside.
            let age = (0.7 * puff.age + 0.3 * share).min(1.0);
            Particle { position, values: [density, age, 0.0] }
        })
    }
}

/// The plume's box.
const SMOKE: Vec3 = Vec3::new(20.48, 16.32, 16.96);
/// The middle and the radius of the ball from which it rises.
const SOURCE: Vec3 = Vec3::new(3.0, 2.4, 8.48);
const SOURCE_RADIUS: f32 = 1.5;
/// Steps of a particle's way.
const STEPS: usize = 28;

struct Smoke {
    seed: u64,
    field: Turbulence,
}

impl Smoke {
    /// Wind, lift that fades as exp(-1.5 time), spreading, and two scales of turbulence.
    #[inline(always)]
    fn velocity(&self, position: Vec3, time: f32, fading: f32) -> Vec3 {
        let wind = Vec3::new(5.0 + 6.0 * time, 11.0 * fading, 0.0);
        let away = position - Vec3::new(3.0, 5.0, 8.48);
        let spread = away * Vec3::new(0.25, 0.55 * time, 1.2 * time);
        let eddies = 8.0 * (0.35 + time) * self.field.at(position, 14.0);
        wind + spread + eddies + 2.6 * self.field.at(position + 4.3, 5.0)
    }
}

impl Law for Smoke {
    fn particle(&self, k: u64) -> Particle {
        let mut stream = Stream::new(self.seed, k);
        inside(Vec3::splat(0.3), SMOKE - 0.3, |_| {
            let age = stream.unit().powf(0.36);
            let mut position = SOURCE + SOURCE_RADIUS * stream.unit().cbrt() * stream.direction();
            let step_time = age / STEPS as f32;
            let step_fading = (-1.5 * step_time).exp();
            let mut fading = step_fading.sqrt();
            for step in 0..STEPS {
                let time = (step as f32 + 0.5) * step_time;
                position += self.velocity(position, time, fading) * step_time;
                fading *= step_fading;
            }
            position += (0.15 + 0.35 * age) * stream.normal3();
            let density = (-1.2 * age + 0.15 * stream.normal()).exp();
            let temperature = 290.0 + 900.0 * (-3.0 * age).exp() * (1.0 + 0.05 * stream.normal());
            Particle { position, values: [density, age, temperature] }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::tests::generated;

    #[test]
    fn clouds_stay_in_their_boxes_and_fill_part_of_them() {
        for (name, size) in
            [("cloud1", [18.9, 2.3, 20.0]), ("cloud2", [20.0, 10.7, 20.0]), ("smoke", [20.48, 16.32, 16.96])]
        {
            let cloud = generated(&format!("{name}?n=10000&seed=5"));
            let size = Vec3::from_array(size);
            let mut cells = vec![false; 8000];
            let mut walls = 0;
            for id in 0..cloud.len() {
                let position = cloud.positions().offset(id);
                assert!(position.cmpge(Vec3::ZERO).all() && position.cmple(size).all(), "{name} {id}");
                let cell = (20.0 * position / size).as_uvec3().min(glam::UVec3::splat(19));
                cells[((cell.x * 20 + cell.y) * 20 + cell.z) as usize] = true;
                let edge = if name == "smoke" { Vec3::splat(0.3) } else { 0.02 * size };
                walls += u32::from(position.cmple(edge).any() || position.cmpge(size - edge).any());
            }
            let filled = cells.iter().filter(|&&it| it).count() as f64 / 8000.0;
            assert!((0.05..0.6).contains(&filled), "{name} fills {filled} of its box");
            assert_eq!(walls, 0, "{name}: particles on the walls");
            let age = cloud.attribute("age").unwrap();
            assert!((0..cloud.len()).all(|id| (0.0..=1.0).contains(&age.number(id, 0))));
        }
    }

    #[test]
    fn smoke_rises_cools_and_drifts_with_age() {
        let cloud = generated("smoke?n=20000&seed=6");
        let [age, temperature] = ["age", "temperature"].map(|name| cloud.attribute(name).unwrap());
        let mean = |old: bool, value: &dyn Fn(usize) -> f64| {
            let picked: Vec<f64> =
                (0..cloud.len()).filter(|&id| (age.number(id, 0) > 0.6) == old).map(value).collect();
            picked.iter().sum::<f64>() / picked.len() as f64
        };
        for axis in 0..2 {
            let position = |id: usize| f64::from(cloud.positions().offset(id)[axis]);
            let way = mean(true, &position) - mean(false, &position);
            assert!(way > 0.5, "axis {axis}: {way}");
        }
        let kelvin = |id: usize| temperature.number(id, 0);
        assert!(mean(true, &kelvin) < mean(false, &kelvin) - 50.0);
    }
}
