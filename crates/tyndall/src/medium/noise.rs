//! Noise from a table of four components: three displace the points at which a medium is looked up (position noise), the
//! fourth makes its density uneven (density noise).
//!
//! The table is periodic and computed once; a look-up is one trilinear interpolation an octave, for all four components. The
//! noise belongs to space, not to the grid or the camera, so that animations do not swim; in a sequence it may go with the particles instead
//! ([`advection`]). Octaves that a pixel is too wide for fade out, which leaves the mean as it is. Invariant: over all of space the density keeps its mean, whatever the amplitude and however much has faded.
//! Sources: K. Perlin, "Improving noise", SIGGRAPH 2002; D. Cha, S. Son, I. Ihm, "GPU-assisted high quality particle
//! rendering", EGSR 2009 (the table of four components, the two kinds of noise).

pub mod advection;
mod flow;
pub mod moved;
mod table;

use glam::{Vec3, Vec4};

use self::advection::{Advection, PHASES};
use self::table::{CELLS, Table};
use crate::error::{Error, Result};
use crate::random::Stream;

/// The most octaves.
const OCTAVES: usize = 8;
/// How many times finer an octave is than the one before. Not exactly 2: zeros of the octaves, which all have at the cells' corners, do not
/// meet.
const LACUNARITY: f32 = 2.03;
/// How far an octave lies from the one before, in its cells.
const SHIFT: Vec3 = Vec3::new(5.3, 1.7, 9.1);
/// An octave has all of its weight where its cells are so many times as wide as where it has none.
const FADING: f32 = 4.0;
/// Places at which it is looked how much density the clipping at 0 adds; they leave an error of 0.2 % at amplitude 3.
const PLACES: u32 = 1 << 14;
/// Steps of what has faded at which that is looked up.
const STEPS: usize = 16;

/// How the noise looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseSettings {
    /// How points are displaced.
    pub kind: NoiseKind,
    /// How far a point is displaced at most by the first octave, in units of `scale`; 0 to 10, 0 switches position noise off.
    pub position: f32,
    /// By which part of itself the density changes at most by the first octave; 0 to 10, 0 switches density noise off.
    pub density: f32,
    /// Layers, each twice as fine and half as strong as the one before; 1 to 8.
    pub octaves: u32,
    /// Size of the cells of the first octave, in units of length; above 0.
    pub scale: f32,
    /// Where the noise is anchored, as an offset from the particles' origin.
    pub anchor: Vec3,
    /// Octaves whose cells are narrower than so many pixels are left out; they fade from four times that on. 0 to 100, 0 keeps all.
    pub detail: f32,
    /// Another seed gives another noise.
    pub seed: u32,
}

impl Default for NoiseSettings {
    fn default() -> Self {
        Self {
            kind: NoiseKind::Perlin,
            position: 0.0,
            density: 0.0,
            octaves: 1,
            scale: 1.0,
            anchor: Vec3::ZERO,
            detail: 1.0,
            seed: 0,
        }
    }
}

/// How points are displaced by position noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NoiseKind {
    /// Each axis by a Perlin noise of its own: matter is gathered in some places and thinned out in others.
    #[default]
    Perlin,
    /// By the curl of three: matter is stirred and keeps its density.
    Curl,
}

/// A noise ready to be looked up.
#[derive(Clone, Debug)]
pub struct Noise {
    settings: NoiseSettings,
    table: Table,
    /// By what has faded, from nothing to all: 1 over the mean that the densities' factors have by themselves.
    balance: [f32; STEPS + 1],
    /// How it has moved, and by how many cells its phases are shifted.
    advection: Option<(Advection, [Vec3; PHASES])>,
}

impl Noise {
    /// Fills the table. Fails with [`Error::Setting`] if a number is out of its range.
    pub fn new(settings: NoiseSettings) -> Result<Self> {
        let NoiseSettings { kind, position, density, octaves, scale, anchor, detail, seed } = settings;
        for amplitude in [position, density] {
            if !(0.0..=10.0).contains(&amplitude) {
                return Err(Error::setting("noise", amplitude, "an amplitude from 0 to 10"));
            }
        }
        if !(1..=OCTAVES as u32).contains(&octaves) {
            return Err(Error::setting("noise", octaves, "1 to 8 octaves"));
        }
        if !(scale > 0.0 && scale.is_finite() && anchor.is_finite()) {
            return Err(Error::setting("noise-scale", scale, "a length above 0"));
        }
        if !(0.0..=100.0).contains(&detail) {
            return Err(Error::setting("noise-detail", detail, "0 to 100 pixels"));
        }
        let unbalanced =
            Self { settings, table: Table::new(kind, seed), balance: [1.0; STEPS + 1], advection: None };
        Ok(Self { balance: unbalanced.balance(), ..unbalanced })
    }

    /// The same noise as it has gone with particles.
    pub fn advected(self, advection: Advection) -> Self {
        let shifts = advection.shifts(self.settings.seed);
        Self { advection: Some((advection, shifts)), ..self }
    }

    /// The knobs that it was made with.
    pub fn settings(&self) -> &NoiseSettings {
        &self.settings
    }

    /// How far points are displaced along an axis at most.
    pub fn reach(&self) -> f32 {
        2.0 * self.settings.position * self.settings.scale
    }

    /// Where a medium is looked up in place of `at`, and what its density there is multiplied with: at least 0, 1 on average. It is seen
    /// through a pixel that is `footprint` wide there, a length; with 0 no octave has faded.
    #[inline]
    pub fn disperse(&self, at: Vec3, footprint: f32) -> (Vec3, f32) {
        if self.has_faded(footprint) {
            return (at, 1.0);
        }
        let NoiseSettings { position, density, scale, .. } = self.settings;
        let value = self.value(at, footprint);
        let factor = (1.0 + density * value.w).max(0.0) * self.balance_at(footprint);
        (at + position * scale * value.truncate(), factor)
    }

    /// Whether nothing is left of it where it is seen through pixels so wide or wider.
    pub fn has_faded(&self, footprint: f32) -> bool {
        shown(self.settings.detail * footprint / self.settings.scale) <= 0.0
    }

    /// The octaves at a point that is seen through a pixel `footprint` wide: each component within -2 and 2, 0 on average.
    #[inline]
    fn value(&self, at: Vec3, footprint: f32) -> Vec4 {
        match &self.advection {
            None => self.unmoved(at, Vec3::ZERO, footprint),
            Some((advection, shifts)) => {
                advection.value(at, shifts, |at, shift| self.unmoved(at, shift, footprint))
            }
        }
    }

    /// The octaves at a point of the noise that stands in space, shifted by so many cells.
    #[inline]
    fn unmoved(&self, at: Vec3, shift: Vec3, footprint: f32) -> Vec4 {
        let NoiseSettings { octaves, scale, anchor, detail, .. } = self.settings;
        let mut place = (at - anchor) / scale + shift;
        // In cells of the octave: as wide as cells are that are left out.
        let mut lost = detail * footprint / scale;
        let mut weight = 1.0;
        let mut sum = Vec4::ZERO;
        for _ in 0..octaves {
            let share = shown(lost);
            if share <= 0.0 {
                break;
            }
            sum += share * weight * self.table.value(place);
            weight *= 0.5;
            place = LACUNARITY * place + SHIFT;
            lost *= LACUNARITY;
        }
        sum
    }

    /// Counterweight to the clipping, seen through a pixel so wide.
    #[inline]
    fn balance_at(&self, footprint: f32) -> f32 {
        let NoiseSettings { octaves, scale, detail, .. } = self.settings;
        let lost = detail * footprint / scale;
        // Where nothing is clipped before anything has faded, nothing is clipped at all.
        if self.balance[0] == 1.0 || lost <= least_lost(octaves) {
            return self.balance[0];
        }
        let step = STEPS as f32 * (1.0 - lost.log2() / least_lost(octaves).log2()).clamp(0.0, 1.0);
        let below = step as usize;
        let [low, high] = [below, below + 1].map(|it| self.balance[it.min(STEPS)]);
        low + (step - below as f32) * (high - low)
    }

    /// By what has faded what brings the mean of the densities' factors to 1: they are 1 on average, but for what is below 0 and is clipped.
    fn balance(&self) -> [f32; STEPS + 1] {
        let NoiseSettings { density, octaves, seed, .. } = self.settings;
        // The octaves add up to less than twice the first one.
        if 2.0 * density <= 1.0 {
            return [1.0; STEPS + 1];
        }
        let shares: [[f32; OCTAVES]; STEPS + 1] = std::array::from_fn(|step| {
            let lost = least_lost(octaves).powf(1.0 - step as f32 / STEPS as f32);
            std::array::from_fn(|octave| shown(lost * LACUNARITY.powi(octave as i32)))
        });
        let mut clipped = [0.0; STEPS + 1];
        let mut stream = Stream::new(u64::from(seed), 0);
        for _ in 0..PLACES {
            let mut place = CELLS as f32 * stream.cube();
            let mut values = [0.0; OCTAVES];
            let mut weight = 1.0;
            for value in values.iter_mut().take(octaves as usize) {
                *value = weight * self.table.value(place).w;
                weight *= 0.5;
                place = LACUNARITY * place + SHIFT;
            }
            for (clipped, shares) in clipped.iter_mut().zip(&shares) {
                let value: f32 = shares.iter().zip(&values).map(|(share, value)| share * value).sum();
                *clipped += f64::from((-1.0 - density * value).max(0.0));
            }
        }
        clipped.map(|it| (1.0 / (1.0 + it / f64::from(PLACES))) as f32)
    }
}

/// What may be left out, in cells of the first octave, before the last one begins to fade.
#[inline]
fn least_lost(octaves: u32) -> f32 {
    1.0 / (FADING * LACUNARITY.powi(octaves as i32 - 1))
}

/// The share of an octave that is left where what is left out is so wide, counted in its cells.
#[inline]
fn shown(lost: f32) -> f32 {
    1.0 - fade([1.0 / FADING, 1.0], lost)
}

/// 0 up to the first number, 1 from the second on, smooth between them.
#[inline]
fn fade([from, to]: [f32; 2], at: f32) -> f32 {
    let share = ((at - from) / (to - from)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    const SETTINGS: NoiseSettings = NoiseSettings {
        kind: NoiseKind::Perlin,
        position: 0.5,
        density: 0.7,
        octaves: 3,
        scale: 2.0,
        anchor: Vec3::new(1.0, -2.0, 0.5),
        detail: 1.0,
        seed: 3,
    };

    fn mean_and_deviation(values: &[f32]) -> [f64; 2] {
        let count = values.len() as f64;
        let mean = values.iter().map(|&it| f64::from(it)).sum::<f64>() / count;
        let variance = values.iter().map(|&it| (f64::from(it) - mean).powi(2)).sum::<f64>() / count;
        [mean, variance.sqrt()]
    }

    #[test]
    fn each_component_is_zero_on_average_and_independent_of_the_others() {
        let noise = Noise::new(SETTINGS).unwrap();
        let mut stream = Stream::new(1, 0);
        let at: Vec<Vec4> = (0..30_000).map(|_| noise.value(1000.0 * stream.cube(), 0.0)).collect();
        for component in 0..4 {
            let [mean, deviation] =
                mean_and_deviation(&at.iter().map(|it| it[component]).collect::<Vec<_>>());
            assert!(mean.abs() < 0.02, "component {component}: {mean}");
            assert!((0.2..0.5).contains(&deviation), "component {component}: {deviation}");
            for other in 0..component {
                let product: f64 = at.iter().map(|it| f64::from(it[component] * it[other])).sum();
                assert!((product / 3e4).abs() < 0.01, "components {component} and {other}");
            }
            assert!(at.iter().all(|it| it[component].abs() <= 2.0));
        }
    }

    #[test]
    fn noise_is_continuous_and_scales_with_its_cells() {
        let noise = Noise::new(SETTINGS).unwrap();
        let finer = Noise::new(NoiseSettings { scale: 1.0, ..SETTINGS }).unwrap();
        let mut stream = Stream::new(2, 0);
        for _ in 0..1000 {
            let at = 50.0 * stream.cube();
            let step = 1e-3 * stream.cube();
            assert!(noise.value(at, 0.0).abs_diff_eq(noise.value(at + step, 0.0), 0.03), "{at}");
            let offset = at - SETTINGS.anchor;
            let near = finer.value(SETTINGS.anchor + 0.5 * offset, 0.0);
            assert!(noise.value(at, 0.0).abs_diff_eq(near, 1e-3), "{at}");
        }
    }

    #[test]
    fn dispersed_densities_keep_their_mean_and_displacements_their_bound() {
        let noise = Noise::new(SETTINGS).unwrap();
        let mut stream = Stream::new(3, 0);
        let dispersed = (0..30_000).map(|_| {
            let at = 100.0 * stream.cube();
            let (moved, factor) = noise.disperse(at, 0.0);
            assert!(moved.distance(at) <= 2.0 * 3_f32.sqrt() * 0.5 * 2.0 && factor >= 0.0);
            factor
        });
        let [mean, _] = mean_and_deviation(&dispersed.collect::<Vec<_>>());
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
    }

    #[test]
    fn however_strong_the_noise_and_whatever_has_faded_the_mean_of_the_density_stays() {
        for density in [1.0, 3.0, 10.0] {
            let noise = Noise::new(NoiseSettings { density, ..SETTINGS }).unwrap();
            // In pixels as wide as a cell of the first octave nothing is left of it, which leaves no error.
            for footprint in [0.0, 0.3, 0.8, 1.3, 2.0] {
                let mut stream = Stream::new(8, 0);
                let factors: Vec<f32> =
                    (0..20_000).map(|_| noise.disperse(200.0 * stream.cube(), footprint).1).collect();
                let [mean, deviation] = mean_and_deviation(&factors);
                assert!((mean - 1.0).abs() < 0.03 * deviation + 1e-6, "{density} {footprint}: {mean}");
            }
        }
        // Where nothing is clipped nothing is balanced.
        let noise = Noise::new(NoiseSettings { density: 0.4, ..SETTINGS }).unwrap();
        assert_eq!(noise.balance, [1.0; STEPS + 1]);
    }

    #[test]
    fn octaves_fade_one_after_the_other_and_all_are_kept_without_detail() {
        let noise = Noise::new(SETTINGS).unwrap();
        let all = Noise::new(NoiseSettings { detail: 0.0, ..SETTINGS }).unwrap();
        let mut stream = Stream::new(9, 0);
        for _ in 0..100 {
            let at = 50.0 * stream.cube();
            let sharp = noise.value(at, 0.0);
            // The last octave has cells of 2 / 2.03^2.
            assert_eq!(noise.value(at, 0.12), sharp);
            assert_eq!(all.value(at, 100.0), sharp);
            assert_eq!(noise.disperse(at, 2.0), (at, 1.0));
            let single = Noise { settings: NoiseSettings { octaves: 1, ..SETTINGS }, ..noise.clone() };
            assert_eq!(noise.value(at, 2.0 / LACUNARITY), single.value(at, 2.0 / LACUNARITY));
            let [near, far] = [0.3, 0.301].map(|footprint| noise.value(at, footprint));
            assert!(near.abs_diff_eq(far, 0.01), "{at}: {near} {far}");
        }
    }

    #[test]
    fn the_seed_decides_and_bad_settings_are_refused() {
        let values = |seed| Noise::new(NoiseSettings { seed, ..SETTINGS }).unwrap().table;
        assert_eq!(values(7), values(7));
        assert_ne!(values(7), values(8));
        for bad in [
            NoiseSettings { position: -0.1, ..SETTINGS },
            NoiseSettings { density: f32::NAN, ..SETTINGS },
            NoiseSettings { octaves: 0, ..SETTINGS },
            NoiseSettings { octaves: 9, ..SETTINGS },
            NoiseSettings { scale: 0.0, ..SETTINGS },
            NoiseSettings { detail: -1.0, ..SETTINGS },
        ] {
            assert_eq!(Noise::new(bad).unwrap_err().code(), "setting");
        }
    }
}
