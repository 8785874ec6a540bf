//! What a participating medium is: particles become a density on a grid, and light is absorbed and scattered in it.
//!
//! [`Medium`] takes a [`Grid`] of density and how matter of density 1 meets light; extinction and albedo are RGB. Its box and
//! all positions are measured from the particles' origin. Invariant: albedo within 0 and 1, extinction finite and at least 0; what
//! only adds its light does not scatter.

pub mod automatic;
pub mod black_body;
mod cells;
pub mod density;
pub mod emission;
pub mod grid;
pub mod kernel;
pub mod light;
pub mod noise;
pub mod optics;

use glam::Vec3;

use crate::error::{Error, Result};
use crate::math::Bounds;
pub use black_body::BlackBody;
pub use emission::Emission;
pub use grid::Grid;
pub use kernel::Kernel;
pub use light::Light;
pub use noise::{Noise, NoiseKind, NoiseSettings};
pub use optics::Phase;

/// A participating medium.
#[derive(Clone, Debug)]
pub struct Medium {
    density: Grid,
    optics: Optics,
    bounds: Bounds,
    emission: Option<Emission>,
}

/// How matter meets light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// RGB extinction per unit length where the density is 1: what light loses by absorption and scattering. At least 0.
    pub extinction: [f32; 3],
    /// RGB share of the extinction that is scattering. From 0 to 1.
    pub albedo: [f32; 3],
    /// How scattered light is spread.
    pub phase: Phase,
}

impl Optics {
    /// Whether all channels are treated alike.
    pub(crate) fn is_grey(&self) -> bool {
        let all_alike = |rgb: [f32; 3]| rgb[0] == rgb[1] && rgb[1] == rgb[2];
        all_alike(self.extinction) && all_alike(self.albedo)
    }
}

impl Medium {
    /// A medium of that density. Fails with [`Error::Setting`] where the optics or the extinction at the greatest density are out
    /// of range.
    pub fn new(density: Grid, optics: Optics) -> Result<Self> {
        let Optics { extinction, albedo, .. } = optics;
        if !extinction.iter().all(|value| (0.0..f32::INFINITY).contains(value)) {
            let allowed = "three finite numbers of at least 0";
            return Err(Error::setting("extinction", format!("{extinction:?}"), allowed));
        }
        if !albedo.iter().all(|value| (0.0..=1.0).contains(value)) {
            return Err(Error::setting("albedo", format!("{albedo:?}"), "three numbers from 0 to 1"));
        }
        let thickest = density.max() * extinction.into_iter().fold(0.0, f32::max);
        let depth = thickest * density.bounds().extent().length();
        if !depth.is_finite() {
            let allowed = format!("less, so that the greatest density, {}, stays finite", density.max());
            return Err(Error::setting("extinction", format!("{extinction:?}"), allowed));
        }
        let bounds = occupied(&density);
        Ok(Self { density, optics, bounds, emission: None })
    }

    /// The same medium, giving off light. Fails with [`Error::Setting`] if the field of the emission is on another lattice, or if it is
    /// additive and the medium scatters.
    pub fn with_emission(self, emission: Emission) -> Result<Self> {
        emission.check(&self.density)?;
        if emission.is_additive() && self.optics.albedo != [0.0; 3] {
            let albedo = format!("{:?}", self.optics.albedo);
            return Err(Error::setting("albedo", albedo, "0 where light is only added"));
        }
        Ok(Self { emission: Some(emission), ..self })
    }

    /// Mass per volume, on a grid.
    pub fn density(&self) -> &Grid {
        &self.density
    }

    /// How its matter meets light.
    pub fn optics(&self) -> &Optics {
        &self.optics
    }

    /// The light that it gives off.
    pub fn emission(&self) -> Option<&Emission> {
        self.emission.as_ref()
    }

    /// Whether light leaves as if there were no matter on its way: see [`Emission::additive`].
    pub fn is_additive(&self) -> bool {
        self.emission.as_ref().is_some_and(Emission::is_additive)
    }

    /// What radiance of thick matter is multiplied with to be what is added per extinction: the share that absorbs.
    #[inline(always)]
    pub(crate) fn emitting_share(&self) -> Vec3 {
        Vec3::ONE - Vec3::from(self.optics.albedo)
    }

    /// RGB radiance that is given off at a point, per extinction.
    #[inline]
    pub(crate) fn emitted(&self, at: Vec3) -> Vec3 {
        match &self.emission {
            Some(emission) => self.emitting_share() * emission.radiance(at),
            None => Vec3::ZERO,
        }
    }

    /// The box of the bricks that hold any density; empty without any.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }
}

/// The box of the bricks that hold any density.
fn occupied(density: &Grid) -> Bounds {
    let [x, y, z] = density.bricks();
    let mut bounds = Bounds::EMPTY;
    for c in 0..z {
        for b in 0..y {
            for a in 0..x {
                if density.brick_range([a, b, c]).max > 0.0 {
                    bounds = bounds.union(density.brick_bounds([a, b, c]));
                }
            }
        }
    }
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPTICS: Optics = Optics { extinction: [1.0; 3], albedo: [0.9; 3], phase: Phase::ISOTROPIC };

    fn grid(values: &[f32]) -> Grid {
        Grid::from_dense(Vec3::ZERO, 1.0, [values.len() as u32, 1, 1], values).unwrap()
    }

    #[test]
    fn optics_out_of_range_are_refused() {
        let attempt = |change: fn(&mut Optics)| {
            let mut optics = OPTICS;
            change(&mut optics);
            Medium::new(grid(&[1.0]), optics).map(|_| ())
        };
        assert!(attempt(|_| ()).is_ok());
        assert!(attempt(|it| it.albedo = [1.0, 0.0, 1.0]).is_ok());
        assert!(attempt(|it| it.extinction = [0.0; 3]).is_ok());
        let message = attempt(|it| it.albedo[1] = 1.01).unwrap_err().to_string();
        assert!(message.contains("albedo") && message.contains("1.01") && message.contains("0 to 1"));
        assert!(attempt(|it| it.albedo[2] = -0.1).is_err());
        assert!(attempt(|it| it.albedo[0] = f32::NAN).is_err());
        assert!(attempt(|it| it.extinction[0] = -1.0).is_err());
        assert!(attempt(|it| it.extinction[0] = f32::INFINITY).is_err());
        let huge = Medium::new(grid(&[1e30]), Optics { extinction: [1e30; 3], ..OPTICS });
        assert_eq!(huge.unwrap_err().code(), "setting");
    }

    #[test]
    fn the_bounds_leave_out_what_is_empty() {
        let mut values = [0.0; 40];
        values[20] = 1.0;
        let medium = Medium::new(grid(&values), OPTICS).unwrap();
        // The sample's own brick, and no other: 20 lies inside the brick of 16 to 23.
        assert_eq!((medium.bounds().min.x, medium.bounds().max.x), (16.0, 24.0));
        assert!(Medium::new(grid(&[0.0; 40]), OPTICS).unwrap().bounds().is_empty());
    }
}
