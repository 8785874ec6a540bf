//! The radii of the particles in the leaves: one for all, of a short table, each its own, or packed.

use bytemuck::{Pod, Zeroable};
use fearless_simd::{f32x16, prelude::*};

use super::LEAF;
use super::block::Packing;
#[cfg(feature = "gpu")]
use crate::error::Result;
use crate::frozen::Frozen;
#[cfg(feature = "gpu")]
use crate::pages;

/// Radii of sixteen particles, packed: 8 bits each, in equal ratios from the least.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct LogRadii {
    least: f32,
    /// Binary logarithm of the ratio of two neighbors.
    step: f32,
    codes: [u8; LEAF],
}

impl LogRadii {
    fn encode(radii: &[f32]) -> Self {
        // What is zero stays zero; the others are never less than the least.
        let positive = radii.iter().copied().filter(|&radius| radius > 0.0);
        let (least, greatest) = positive
            .fold((f32::INFINITY, 0.0_f32), |(least, greatest), it| (least.min(it), greatest.max(it)));
        if greatest == 0.0 {
            return Self { least: 0.0, step: 0.0, codes: [0; LEAF] };
        }
        let span = (f64::from(greatest) / f64::from(least)).log2() as f32;
        let step = span / (u8::MAX - 1) as f32;
        let mut codes = [0; LEAF];
        for (code, &radius) in codes.iter_mut().zip(radii).filter(|&(_, &radius)| radius > 0.0) {
            let place = (f64::from(radius) / f64::from(least)).log2() as f32 / step.max(f32::MIN_POSITIVE);
            *code = 1 + place.round().clamp(0.0, (u8::MAX - 1) as f32) as u8;
        }
        Self { least, step, codes }
    }

    #[inline(always)]
    fn radius(&self, place: usize) -> f32 {
        let code = self.codes[place];
        let radius = self.least * exp2_series(self.step * (i32::from(code) - 1).max(0) as f32);
        if code == 0 { 0.0 } else { radius }
    }
}

/// Two to the power of `x` >= 0, good to 3e-7, with the same bits on every machine: products and sums only.
#[inline(always)]
fn exp2_series(x: f32) -> f32 {
    let whole = x as i32;
    let part = x - whole as f32;
    // Taylor's series of exp(part ln 2) around 1/2.
    let t = (part - 0.5) * std::f32::consts::LN_2;
    let series = 1.0
        + t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0 + t * (1.0 / 720.0))))));
    std::f32::consts::SQRT_2 * series * f32::from_bits(((whole.clamp(0, 127) + 127) as u32) << 23)
}

/// See the module.
#[derive(Clone)]
pub(crate) enum Sizes {
    /// All alike.
    Uniform(f32),
    /// Of at most 256 different ones: a byte each.
    Table {
        /// The different radii.
        radii: Box<[f32; 256]>,
        /// Which of them each particle has.
        codes: Frozen<[u8; LEAF]>,
    },
    /// Each its own.
    Each(Frozen<[f32; LEAF]>),
    /// Each its own, packed.
    Log(Frozen<LogRadii>),
}

impl Sizes {
    /// Holds radii that come in leaf by leaf: sixteen a leaf, the last one may have fewer.
    pub(super) fn encode(radii: &[f32], packing: Packing) -> Self {
        let leaves = radii.chunks(LEAF);
        let law = Law::of(radii, packing);
        if let Law::Table(table) = law {
            let code = |radius: f32| table.binary_search_by(|it| it.total_cmp(&radius)).unwrap_or(0) as u8;
            let codes = leaves.map(|leaf| {
                let mut codes = [0; LEAF];
                codes.iter_mut().zip(leaf).for_each(|(slot, &radius)| *slot = code(radius));
                codes
            });
            return Self::Table { codes: codes.collect::<Vec<_>>().into(), radii: padded(&table) };
        }
        if matches!(law, Law::Each) {
            let each = leaves.map(|leaf| {
                let mut each = [0.0; LEAF];
                each[..leaf.len()].copy_from_slice(leaf);
                each
            });
            return Self::Each(each.collect::<Vec<_>>().into());
        }
        Self::Log(leaves.map(LogRadii::encode).collect::<Vec<_>>().into())
    }

    /// The radii of so many leaves, whose memory `fill` writes.
    #[cfg(feature = "gpu")]
    pub(super) fn read(law: &Law, leaves: usize, fill: impl FnOnce(&mut [u8]) -> Result<()>) -> Result<Self> {
        Ok(match law {
            Law::Uniform(radius) => {
                fill(&mut [])?;
                Self::Uniform(*radius)
            }
            Law::Table(table) => Self::Table { radii: padded(table), codes: pages::written(leaves, fill)? },
            Law::Each => Self::Each(pages::written(leaves, fill)?),
            Law::Log => Self::Log(pages::written(leaves, fill)?),
        })
    }

    /// The memory that stands leaf by leaf.
    pub(super) fn as_bytes(&self) -> &[u8] {
        match self {
            Self::Uniform(_) => &[],
            Self::Table { codes, .. } => codes.as_flattened(),
            Self::Each(radii) => bytemuck::cast_slice(radii),
            Self::Log(radii) => bytemuck::cast_slice(radii),
        }
    }

    /// The radii of a leaf's particles.
    #[inline(always)]
    pub(crate) fn radii<S: Simd>(&self, simd: S, leaf: usize) -> f32x16<S> {
        match self {
            Self::Uniform(radius) => f32x16::splat(simd, *radius),
            Self::Table { radii, codes } => {
                let mut each = [0.0; LEAF];
                for (slot, &code) in each.iter_mut().zip(&codes[leaf]) {
                    *slot = radii[code as usize];
                }
                f32x16::load_array(simd, each)
            }
            Self::Each(radii) => f32x16::load_array_ref(simd, &radii[leaf]),
            Self::Log(radii) => {
                let mut each = [0.0; LEAF];
                for (place, slot) in each.iter_mut().enumerate() {
                    *slot = radii[leaf].radius(place);
                }
                f32x16::load_array(simd, each)
            }
        }
    }

    /// The radius at `place` of a leaf.
    #[inline(always)]
    pub(crate) fn radius(&self, leaf: usize, place: usize) -> f32 {
        match self {
            Self::Uniform(radius) => *radius,
            Self::Table { radii, codes } => radii[codes[leaf][place] as usize],
            Self::Each(radii) => radii[leaf][place],
            Self::Log(radii) => radii[leaf].radius(place),
        }
    }

    /// Memory they take, in bytes.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Uniform(_) => 0,
            Self::Table { radii, codes } => size_of_val(&radii[..]) + size_of_val(&codes[..]),
            Self::Each(radii) => size_of_val(&radii[..]),
            Self::Log(radii) => size_of_val(&radii[..]),
        }
    }
}

/// How radii are held.
pub(crate) enum Law {
    /// All alike.
    #[cfg(feature = "gpu")]
    Uniform(f32),
    /// The different ones, in ascending order.
    Table(Vec<f32>),
    Each,
    Log,
}

impl Law {
    /// How these are held, in any order.
    pub(super) fn of(radii: &[f32], packing: Packing) -> Self {
        match (table(radii), packing) {
            (Some(table), _) => Self::Table(table),
            (None, Packing::Exact) => Self::Each,
            (None, _) => Self::Log,
        }
    }
}

/// A table as walks read it.
pub(super) fn padded(table: &[f32]) -> Box<[f32; 256]> {
    let mut padded = Box::new([0.0; 256]);
    padded[..table.len()].copy_from_slice(table);
    padded
}

/// The different radii in ascending order, if they are at most 256.
fn table(radii: &[f32]) -> Option<Vec<f32>> {
    let mut table: Vec<f32> = Vec::new();
    let mut last = f32::NAN;
    for &radius in radii {
        // Neighbors often have the same.
        if radius.to_bits() == last.to_bits() {
            continue;
        }
        last = radius;
        if let Err(place) = table.binary_search_by(|it| it.total_cmp(&radius)) {
            if table.len() == 256 {
                return None;
            }
            table.insert(place, radius);
        }
    }
    Some(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two_are_as_good_as_single_precision_can() {
        for k in 0..4000 {
            let x = k as f32 * 0.01;
            let exact = f64::from(x).exp2();
            assert!((f64::from(exp2_series(x)) / exact - 1.0).abs() < 4e-7, "{x}");
        }
    }

    #[test]
    fn packed_radii_are_right_to_their_step() {
        let radii: Vec<f32> = (0..16).map(|k| 1e-4 * 1.7_f32.powi(k)).collect();
        let packed = LogRadii::encode(&radii);
        for (place, &radius) in radii.iter().enumerate() {
            let error = (packed.radius(place) / radius).log2().abs();
            assert!(error < 0.51 * packed.step + 1e-5, "{error}");
        }
        let with_zero = LogRadii::encode(&[0.0, 3.0]);
        assert_eq!((with_zero.radius(0), with_zero.radius(1)), (0.0, 3.0 * exp2_series(0.0)));
    }

    #[test]
    fn few_different_radii_become_a_table_and_stay_exact() {
        let radii: Vec<f32> = (0..1000).map(|k| 0.1 * (1 + k % 200) as f32).collect();
        let sizes = Sizes::encode(&radii, Packing::Bits8);
        assert!(matches!(sizes, Sizes::Table { .. }));
        assert!((0..1000).all(|k| sizes.radius(k / LEAF, k % LEAF) == radii[k]));
    }
}
