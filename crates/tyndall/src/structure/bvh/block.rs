//! Blocks: the centers of sixteen particles side by side, as they are or packed.
//!
//! A packed block holds whole numbers of steps from its corner. The step is a power of two, so that center = corner + number * step
//! is rounded once. What the block gives back is what is rendered: boxes, walks and shading all decode the same centers.

use bytemuck::{Pod, Zeroable};
use fearless_simd::{f32x16, prelude::*, u32x16};
use glam::Vec3;
use rayon::prelude::*;

use super::LEAF;
#[cfg(feature = "gpu")]
use crate::error::Result;
use crate::frozen::{Frozen, Region};
use crate::math::Bounds;
use crate::pages;
use crate::simd::{Lanes3, floats_of_bytes, floats_of_words};
use crate::structure::build::Record;

/// How a block holds the centers of its particles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Packing {
    /// As they are: 12 bytes a particle.
    #[default]
    Exact,
    /// 16 bits a coordinate: 7 bytes a particle.
    Bits16,
    /// 11, 11 and 10 bits: 5 bytes a particle.
    Bits11,
    /// 8 bits a coordinate: 4 bytes a particle.
    Bits8,
}

/// Sixteen centers, or fewer in the last block.
pub(crate) trait Block: Copy + Send + Sync {
    /// Holds `centers`, at least one and at most sixteen.
    fn encode(centers: &[Vec3]) -> Self;

    /// The center at `place`.
    fn center(&self, place: usize) -> Vec3;

    /// All centers; places that are left over hold NaN, which no test accepts.
    fn centers<S: Simd>(&self, simd: S) -> Lanes3<f32x16<S>>;

    /// Whether the places from `place` on are left over.
    fn ends_before(&self, place: usize) -> bool;
}

/// Centers as they are.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Exact([[f32; LEAF]; 3]);

impl Block for Exact {
    fn encode(centers: &[Vec3]) -> Self {
        let mut block = Self([[f32::NAN; LEAF]; 3]);
        for (place, center) in centers.iter().enumerate() {
            for axis in 0..3 {
                block.0[axis][place] = center[axis];
            }
        }
        block
    }

    #[inline(always)]
    fn center(&self, place: usize) -> Vec3 {
        Vec3::new(self.0[0][place], self.0[1][place], self.0[2][place])
    }

    #[inline(always)]
    fn centers<S: Simd>(&self, simd: S) -> Lanes3<f32x16<S>> {
        Lanes3::load(simd, &self.0)
    }

    fn ends_before(&self, place: usize) -> bool {
        self.0.iter().all(|column| column[place..].iter().all(|it| it.is_nan()))
    }
}

/// Where a packed block lies, how long its steps are, and how many particles it holds.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Frame {
    corner: [f32; 3],
    /// Biased exponents of the steps.
    exponent: [u8; 3],
    count: u8,
}

/// The power of two with this biased exponent.
#[inline(always)]
pub(super) fn power_of_two(exponent: u8) -> f32 {
    f32::from_bits(u32::from(exponent) << 23)
}

/// The biased exponent of the least power of two of which `steps` reach as far as `extent`.
pub(super) fn step_exponent(extent: f32, steps: f32) -> u8 {
    let least = extent / steps;
    let exponent = (least.to_bits() >> 23).clamp(1, 254) as u8;
    if power_of_two(exponent) < least && exponent < 254 { exponent + 1 } else { exponent }
}

impl Frame {
    /// Around `centers`, with as many steps along each axis as `steps` says.
    fn around(centers: &[Vec3], steps: [f32; 3]) -> Self {
        let bounds = centers.iter().fold(Bounds::EMPTY, |bounds, &center| bounds.with(center));
        let exponent = std::array::from_fn(|axis| step_exponent(bounds.extent()[axis], steps[axis]));
        Self { corner: bounds.min.to_array(), exponent, count: centers.len() as u8 }
    }

    /// How many steps from the corner `center` lies along `axis`, at most `most`.
    fn steps(&self, center: Vec3, axis: usize, most: f32) -> u32 {
        let steps = (center[axis] - self.corner[axis]) / power_of_two(self.exponent[axis]);
        steps.round().clamp(0.0, most) as u32
    }

    #[inline(always)]
    fn coordinate(&self, axis: usize, steps: u32) -> f32 {
        self.corner[axis] + steps as f32 * power_of_two(self.exponent[axis])
    }

    /// Coordinates along one axis; NaN at the places that are left over.
    #[inline(always)]
    fn coordinates<S: Simd>(&self, simd: S, axis: usize, steps: f32x16<S>) -> f32x16<S> {
        let step = f32x16::splat(simd, power_of_two(self.exponent[axis]));
        let coordinates = steps * step + f32x16::splat(simd, self.corner[axis]);
        if (self.count as usize) < LEAF {
            let mut coordinates = coordinates.to_array();
            coordinates[self.count as usize..].fill(f32::NAN);
            return f32x16::load_array(simd, coordinates);
        }
        coordinates
    }
}

macro_rules! columns_block {
    ($columns:ident, $number:ty, $floats:ident) => {
        /// A frame and columns of unsigned numbers.
        #[derive(Clone, Copy, Pod, Zeroable)]
        #[repr(C)]
        pub(crate) struct $columns {
            frame: Frame,
            steps: [[$number; LEAF]; 3],
        }

        impl Block for $columns {
            fn encode(centers: &[Vec3]) -> Self {
                let most = <$number>::MAX as f32;
                let frame = Frame::around(centers, [most; 3]);
                let mut steps = [[0; LEAF]; 3];
                for (place, &center) in centers.iter().enumerate() {
                    for axis in 0..3 {
                        steps[axis][place] = frame.steps(center, axis, most) as $number;
                    }
                }
                Self { frame, steps }
            }

            #[inline(always)]
            fn center(&self, place: usize) -> Vec3 {
                let coordinate =
                    |axis: usize| self.frame.coordinate(axis, u32::from(self.steps[axis][place]));
                Vec3::new(coordinate(0), coordinate(1), coordinate(2))
            }

            #[inline(always)]
            fn centers<S: Simd>(&self, simd: S) -> Lanes3<f32x16<S>> {
                let [x, y, z] = &self.steps;
                Lanes3 {
                    x: self.frame.coordinates(simd, 0, $floats(simd, x)),
                    y: self.frame.coordinates(simd, 1, $floats(simd, y)),
                    z: self.frame.coordinates(simd, 2, $floats(simd, z)),
                }
            }

            fn ends_before(&self, place: usize) -> bool {
                usize::from(self.frame.count) <= place
            }
        }
    };
}

columns_block!(Columns16, u16, floats_of_words);
columns_block!(Columns8, u8, floats_of_bytes);

/// A frame and one word a particle: 11 bits of x, 11 of y, 10 of z.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Words {
    frame: Frame,
    words: [u32; LEAF],
}

/// First bit and number of bits of each axis in a word.
const WORD: [(u32, u32); 3] = [(0, 11), (11, 11), (22, 10)];

/// The steps along `axis` in a word.
#[inline(always)]
fn of_word(word: u32, axis: usize) -> u32 {
    let (first, bits) = WORD[axis];
    word >> first & ((1 << bits) - 1)
}

/// [`of_word`] on lanes.
#[inline(always)]
fn steps_of_words<S: Simd>(simd: S, words: u32x16<S>, axis: usize) -> f32x16<S> {
    let (first, bits) = WORD[axis];
    f32x16::float_from((words >> first) & u32x16::splat(simd, (1 << bits) - 1))
}

impl Block for Words {
    fn encode(centers: &[Vec3]) -> Self {
        let most = WORD.map(|(_, bits)| ((1 << bits) - 1) as f32);
        let frame = Frame::around(centers, most);
        let mut words = [0; LEAF];
        for (word, &center) in words.iter_mut().zip(centers) {
            for (axis, (first, _)) in WORD.into_iter().enumerate() {
                *word |= frame.steps(center, axis, most[axis]) << first;
            }
        }
        Self { frame, words }
    }

    #[inline(always)]
    fn center(&self, place: usize) -> Vec3 {
        let coordinate = |axis: usize| self.frame.coordinate(axis, of_word(self.words[place], axis));
        Vec3::new(coordinate(0), coordinate(1), coordinate(2))
    }

    #[inline(always)]
    fn centers<S: Simd>(&self, simd: S) -> Lanes3<f32x16<S>> {
        let words = u32x16::load_array_ref(simd, &self.words);
        Lanes3 {
            x: self.frame.coordinates(simd, 0, steps_of_words(simd, words, 0)),
            y: self.frame.coordinates(simd, 1, steps_of_words(simd, words, 1)),
            z: self.frame.coordinates(simd, 2, steps_of_words(simd, words, 2)),
        }
    }

    fn ends_before(&self, place: usize) -> bool {
        usize::from(self.frame.count) <= place
    }
}

/// The blocks of a tree, all of one packing.
#[derive(Clone)]
pub(crate) enum Blocks {
    Exact(Frozen<Exact>),
    Bits16(Frozen<Columns16>),
    Bits11(Frozen<Words>),
    Bits8(Frozen<Columns8>),
}

/// Blocks that are still written, one after the other.
pub(super) enum Unfrozen {
    Exact(Vec<Exact>),
    Bits16(Vec<Columns16>),
    Bits11(Vec<Words>),
    Bits8(Vec<Columns8>),
}

/// Packs records, sixteen a block.
fn extend<B: Block, const N: usize>(blocks: &mut Vec<B>, records: &[Record<N>]) {
    let block = |records: &[Record<N>]| {
        let mut centers = [Vec3::ZERO; LEAF];
        for (center, record) in centers.iter_mut().zip(records) {
            *center = record.center();
        }
        B::encode(&centers[..records.len()])
    };
    blocks.par_extend(records.par_chunks(LEAF).with_min_len(1 << 10).map(block));
}

/// Runs the same expression on whichever array [`Blocks`] or [`Unfrozen`] holds.
macro_rules! each_blocks {
    ($store:ident, $blocks:expr, $held:ident => $body:expr) => {
        match $blocks {
            $store::Exact($held) => $body,
            $store::Bits16($held) => $body,
            $store::Bits11($held) => $body,
            $store::Bits8($held) => $body,
        }
    };
}

impl Unfrozen {
    /// None yet, with room for `count`, on huge pages.
    pub(super) fn with_capacity(packing: Packing, count: usize) -> Self {
        match packing {
            Packing::Exact => Self::Exact(pages::with_capacity(count)),
            Packing::Bits16 => Self::Bits16(pages::with_capacity(count)),
            Packing::Bits11 => Self::Bits11(pages::with_capacity(count)),
            Packing::Bits8 => Self::Bits8(pages::with_capacity(count)),
        }
    }

    /// Packs sorted records, sixteen a block.
    pub(super) fn extend<const N: usize>(&mut self, records: &[Record<N>]) {
        each_blocks!(Unfrozen, self, blocks => extend(blocks, records))
    }

    /// The center at `place` of a block.
    pub(super) fn center(&self, block: usize, place: usize) -> Vec3 {
        each_blocks!(Unfrozen, self, blocks => blocks[block].center(place))
    }

    /// All of them.
    pub(super) fn freeze(self) -> Blocks {
        match self {
            Self::Exact(blocks) => Blocks::Exact(blocks.into()),
            Self::Bits16(blocks) => Blocks::Bits16(blocks.into()),
            Self::Bits11(blocks) => Blocks::Bits11(blocks.into()),
            Self::Bits8(blocks) => Blocks::Bits8(blocks.into()),
        }
    }
}

impl Blocks {
    /// Those whose memory is `region`; none if it is not that of blocks.
    pub(super) fn of(packing: Packing, region: Region) -> Option<Self> {
        Some(match packing {
            Packing::Exact => Self::Exact(Frozen::of(region)?),
            Packing::Bits16 => Self::Bits16(Frozen::of(region)?),
            Packing::Bits11 => Self::Bits11(Frozen::of(region)?),
            Packing::Bits8 => Self::Bits8(Frozen::of(region)?),
        })
    }

    /// Whether these are the blocks of so many particles, and none more is in the last one.
    pub(super) fn hold(&self, particles: usize) -> bool {
        fn hold<B: Block>(blocks: &[B], particles: usize) -> bool {
            let ends = |last: &B| last.ends_before(particles - LEAF * (blocks.len() - 1));
            blocks.len() == particles.div_ceil(LEAF) && blocks.last().is_none_or(ends)
        }
        each_blocks!(Blocks, self, blocks => hold(blocks, particles))
    }

    /// The centers of a block.
    #[inline(always)]
    pub(crate) fn centers<S: Simd>(&self, simd: S, block: usize) -> Lanes3<f32x16<S>> {
        each_blocks!(Blocks, self, blocks => blocks[block].centers(simd))
    }

    /// The center at `place` of a block.
    #[inline(always)]
    pub(crate) fn center(&self, block: usize, place: usize) -> Vec3 {
        each_blocks!(Blocks, self, blocks => blocks[block].center(place))
    }

    /// Memory they take, in bytes.
    pub(super) fn bytes(&self) -> usize {
        each_blocks!(Blocks, self, blocks => size_of_val(&blocks[..]))
    }

    /// How they hold their centers.
    pub(super) fn packing(&self) -> Packing {
        match self {
            Self::Exact(_) => Packing::Exact,
            Self::Bits16(_) => Packing::Bits16,
            Self::Bits11(_) => Packing::Bits11,
            Self::Bits8(_) => Packing::Bits8,
        }
    }

    /// `count` of them, whose memory `fill` writes.
    #[cfg(feature = "gpu")]
    pub(super) fn read(
        packing: Packing,
        count: usize,
        fill: impl FnOnce(&mut [u8]) -> Result<()>,
    ) -> Result<Self> {
        Ok(match packing {
            Packing::Exact => Self::Exact(pages::written(count, fill)?),
            Packing::Bits16 => Self::Bits16(pages::written(count, fill)?),
            Packing::Bits11 => Self::Bits11(pages::written(count, fill)?),
            Packing::Bits8 => Self::Bits8(pages::written(count, fill)?),
        })
    }

    /// Their memory as it is.
    pub(super) fn as_bytes(&self) -> &[u8] {
        each_blocks!(Blocks, self, blocks => bytemuck::cast_slice(blocks))
    }
}
