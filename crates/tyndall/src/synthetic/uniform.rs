//! `uniform`: independent points in the unit cube, as spheres that fill a tenth of it (overlaps counted twice).

use glam::{DVec3, Vec3};

use super::{Law, Particle, Plan, cell};
use crate::particles::Radii;
use crate::random::Stream;

struct Uniform {
    seed: u64,
}

pub(super) fn plan(count: u64, seed: u64) -> Plan<'static> {
    let volume = 0.10 / count.max(1) as f64;
    let radius = (volume * 3.0 / (4.0 * std::f64::consts::PI)).cbrt();
    Plan {
        law: Box::new(Uniform { seed }),
        radii: Radii::Uniform(radius as f32),
        attributes: Vec::new(),
        cell: Some(cell(DVec3::ONE, [false; 3])),
        length_unit: None,
    }
}

impl Law for Uniform {
    fn particle(&self, k: u64) -> Particle {
        let mut stream = Stream::new(self.seed, k);
        let position = Vec3::new(stream.unit(), stream.unit(), stream.unit());
        Particle { position, ..Particle::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::tests::generated;

    #[test]
    fn spheres_fill_a_tenth_of_the_cube_evenly() {
        let cloud = generated("uniform?n=100000&seed=3");
        let Some(Radii::Uniform(radius)) = cloud.radii() else { panic!("one radius") };
        let filled = 1e5 * 4.0 / 3.0 * std::f64::consts::PI * f64::from(*radius).powi(3);
        assert!((filled - 0.1).abs() < 1e-6);
        for column in cloud.positions().offsets() {
            assert!(column.iter().all(|it| (0.0..1.0).contains(it)));
            let half = column.iter().filter(|&&it| it < 0.5).count();
            assert!(half.abs_diff(50_000) < 700, "{half} in the lower half");
        }
    }
}
