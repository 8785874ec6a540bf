//! Light that matter gives off by itself.
//!
//! What is given is the radiance of thick matter: a medium that absorbs emits that radiance per absorption (Kirchhoff's law), so that
//! a slab without scattering of optical thickness t shows B (1 - exp(-t)). Takes a density and the radiance at its samples, gives a
//! field that is trilinear between them. A sample without density beside one with some has the mean of its neighbors, so that
//! matter keeps its color up to its edge. Invariant: radiance is finite and at least 0, on the lattice of the density.

use glam::{IVec3, Vec3};
use rayon::prelude::*;

use super::grid::{BRICK, Brick, CORE_SAMPLES, Grid, Lattice};
use crate::environment::brightness;
use crate::error::{Error, Result};

/// What matter emits, and whether it absorbs too.
#[derive(Clone, Debug)]
pub struct Emission {
    glow: Glow,
    additive: bool,
}

/// Radiance of thick matter, RGB.
#[derive(Clone, Debug)]
enum Glow {
    /// The same everywhere.
    Even(Vec3),
    /// R, G and B.
    Field(Box<[Grid; 3]>),
}

impl Emission {
    /// The same radiance everywhere, linear RGB. [`Error::Setting`] unless it is finite and at least 0.
    pub fn even(radiance: [f32; 3]) -> Result<Self> {
        Ok(Self { glow: Glow::Even(brightness("emission", radiance)?), additive: false })
    }

    /// Of a density, with the linear RGB `radiance` of each sample, which is asked for where there is density. What is negative or not finite
    /// counts as 0.
    pub fn of(density: &Grid, radiance: impl Fn([u32; 3]) -> [f32; 3] + Sync) -> Self {
        let glowing = Glowing::new(density, radiance);
        let lattice = density.lattice();
        let grid = |channel: usize| {
            let brick = |number: usize| glowing.brick(number, channel);
            Grid::from_cores(lattice, (0..lattice.brick_count()).into_par_iter().map(brick).collect())
        };
        Self { glow: Glow::Field(Box::new([grid(0), grid(1), grid(2)])), additive: false }
    }

    /// The same without absorption: light leaves as if there were no matter on its way, and what is seen is the sum over the ray of
    /// extinction times radiance.
    pub fn additive(self) -> Self {
        Self { additive: true, ..self }
    }

    /// Whether nothing is absorbed.
    pub fn is_additive(&self) -> bool {
        self.additive
    }

    /// The radiance where it is the same everywhere.
    pub(crate) fn one_radiance(&self) -> Option<Vec3> {
        match &self.glow {
            Glow::Even(radiance) => Some(*radiance),
            Glow::Field(_) => None,
        }
    }

    /// The radiance at a sample.
    #[inline(always)]
    pub(crate) fn sample(&self, [i, j, k]: [u32; 3]) -> Vec3 {
        match &self.glow {
            Glow::Even(radiance) => *radiance,
            Glow::Field(grids) => Vec3::from(grids.each_ref().map(|grid| grid.value(i, j, k))),
        }
    }

    /// The radiance at a point; that of a field is 0 outside its box.
    #[inline]
    pub(crate) fn radiance(&self, at: Vec3) -> Vec3 {
        match &self.glow {
            Glow::Even(radiance) => *radiance,
            Glow::Field(grids) => Vec3::from(grids.each_ref().map(|grid| grid.density(at))),
        }
    }

    /// The greatest radiance in a brick, channel by channel.
    pub(crate) fn brick_max(&self, brick: [u32; 3]) -> Vec3 {
        match &self.glow {
            Glow::Even(radiance) => *radiance,
            Glow::Field(grids) => Vec3::from(grids.each_ref().map(|grid| grid.brick_range(brick).max)),
        }
    }

    /// The field of a channel; `None` where the radiance is the same everywhere.
    pub(crate) fn channel(&self, channel: usize) -> Option<&Grid> {
        match &self.glow {
            Glow::Even(_) => None,
            Glow::Field(grids) => Some(&grids[channel]),
        }
    }

    /// Refuses a field on another lattice than that of the density.
    pub(super) fn check(&self, density: &Grid) -> Result<()> {
        match &self.glow {
            Glow::Field(grids) if grids[0].lattice() != density.lattice() => {
                let size = format!("{:?} samples", grids[0].size());
                Err(Error::setting("emission", size, "a field on the lattice of the density"))
            }
            _ => Ok(()),
        }
    }
}

/// Radiance at the samples with density, brick by brick; `None` for bricks without.
struct Glowing {
    lattice: Lattice,
    bricks: [u32; 3],
    cores: Vec<Option<Box<[Option<Vec3>; CORE_SAMPLES]>>>,
}

impl Glowing {
    fn new(density: &Grid, radiance: impl Fn([u32; 3]) -> [f32; 3] + Sync) -> Self {
        let lattice = density.lattice();
        let core = |number: usize| {
            let brick = lattice.brick(number);
            if density.brick_range(brick).max <= 0.0 {
                return None;
            }
            let mut core = Box::new([None; CORE_SAMPLES]);
            for (place, sample) in core.iter_mut().enumerate() {
                let at = sample_of(brick, place);
                let inside = (0..3).all(|axis| at[axis] < lattice.size[axis]);
                if inside && density.value(at[0], at[1], at[2]) > 0.0 {
                    let usable = |it: f32| if it.is_finite() { it.max(0.0) } else { 0.0 };
                    *sample = Some(Vec3::from(radiance(at).map(usable)));
                }
            }
            core.iter().any(Option::is_some).then_some(core)
        };
        let cores = (0..lattice.brick_count()).into_par_iter().map(core).collect();
        Self { lattice, bricks: lattice.bricks(), cores }
    }

    /// A channel of a brick, with the samples beside matter.
    fn brick(&self, number: usize, channel: usize) -> Brick {
        let brick = self.lattice.brick(number);
        let near = |offset: IVec3| self.core(IVec3::from_array(brick.map(|it| it as i32)) + offset).is_some();
        if !around().any(near) {
            return Brick::EMPTY;
        }
        let mut samples = Box::new([0.0; CORE_SAMPLES]);
        for (place, sample) in samples.iter_mut().enumerate() {
            let at = IVec3::from_array(sample_of(brick, place).map(|it| it as i32));
            if let Some(own) = self.sample(at) {
                *sample = own[channel];
                continue;
            }
            let found = around().filter_map(|offset| self.sample(at + offset));
            let (sum, count) = found.fold((0.0, 0), |(sum, count), it| (sum + it[channel], count + 1));
            *sample = sum / count.max(1) as f32;
        }
        if samples.iter().all(|it| *it == 0.0) { Brick::EMPTY } else { Brick::Samples(samples) }
    }

    fn core(&self, brick: IVec3) -> Option<&[Option<Vec3>; CORE_SAMPLES]> {
        let [x, y, z] = self.bricks.map(|it| it as i32);
        let inside = brick.cmpge(IVec3::ZERO).all() && brick.cmplt(IVec3::new(x, y, z)).all();
        let number = || ((brick.z * y + brick.y) as usize) * x as usize + brick.x as usize;
        if inside { self.cores[number()].as_deref() } else { None }
    }

    fn sample(&self, at: IVec3) -> Option<Vec3> {
        let edge = BRICK as i32;
        let core = self.core(at.div_euclid(IVec3::splat(edge)))?;
        let inside = at.rem_euclid(IVec3::splat(edge));
        core[((inside.z * edge + inside.y) * edge + inside.x) as usize]
    }
}

/// A place and the 26 around it.
fn around() -> impl Iterator<Item = IVec3> {
    (0..27).map(|k| IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1))
}

/// The lattice place of a sample of a brick.
fn sample_of(brick: [u32; 3], place: usize) -> [u32; 3] {
    std::array::from_fn(|axis| brick[axis] * BRICK + (place as u32 >> (3 * axis) & 7))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_keeps_its_color_up_to_the_edge_of_matter() {
        let mut values = vec![0.0; 20 * 9 * 9];
        let place = |i: usize| (4 * 9 + 4) * 20 + i;
        // Matter on both sides of the border between the first and the second brick.
        (3..8).for_each(|i| values[place(i)] = 1.0);
        let density = Grid::from_dense(Vec3::ZERO, 1.0, [20, 9, 9], &values).unwrap();
        let emission = Emission::of(&density, |[i, ..]| [i as f32, 2.0, f32::NAN]);
        assert_eq!(emission.sample([5, 4, 4]), Vec3::new(5.0, 2.0, 0.0));
        // Beside the last sample with matter, across the border.
        assert_eq!(emission.sample([8, 5, 3]), Vec3::new(7.0, 2.0, 0.0));
        assert_eq!(emission.sample([2, 4, 4]), Vec3::new(3.0, 2.0, 0.0));
        assert_eq!(emission.sample([9, 4, 4]), Vec3::ZERO);
        assert_eq!(emission.radiance(Vec3::new(7.5, 4.0, 4.0)), Vec3::new(7.0, 2.0, 0.0));
        assert_eq!(emission.brick_max([1, 0, 0]).y, 2.0);
        assert!(emission.check(&density).is_ok() && emission.one_radiance().is_none());
        let other = Grid::from_dense(Vec3::ZERO, 2.0, [20, 9, 9], &values).unwrap();
        assert!(emission.check(&other).is_err());
    }

    #[test]
    fn even_radiance_is_checked() {
        let emission = Emission::even([1.0, 0.5, 0.0]).unwrap();
        assert_eq!(emission.one_radiance(), Some(Vec3::new(1.0, 0.5, 0.0)));
        assert!(!emission.is_additive() && emission.additive().is_additive());
        for bad in [[-1.0, 0.0, 0.0], [f32::NAN; 3], [f32::INFINITY; 3]] {
            assert_eq!(Emission::even(bad).unwrap_err().code(), "setting");
        }
    }
}
