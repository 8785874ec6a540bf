//! What packing costs: how far the centers and radii that a tree gives back are from the exact ones, while both are at hand.
//!
//! Every center and radius is compared. What shifts of single centers mean for the whole is told by the radial distribution function
//! g(r), the density of particles at distance r from a particle over the mean density (M. Allen, D. Tildesley, Computer Simulation
//! of Liquids, 2017): it is taken before and after over the same pairs, around some thousand centers spread evenly over the tree.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use super::{Bvh, LEAF, Place, WIDTH};
use crate::structure::build::Record;

/// How far what a packed structure holds is from what it was built from. Lengths are in the unit of the positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackingError {
    /// The largest difference of a center, along each axis.
    pub center_largest: [f32; 3],
    /// The root of the mean squared difference of the centers, along each axis.
    pub center_rms: [f32; 3],
    /// The largest difference of a radius, relative to that radius.
    pub radius_largest: f32,
    /// The mean of the exact radii, to compare lengths with.
    pub mean_radius: f32,
    /// The spacing of 32-bit floats at the largest coordinate: exact centers differ from those in the file by up to half of it.
    pub float_spacing: f32,
    /// The largest difference of the radial distribution function up to four mean radii, relative to its largest value; none where
    /// there are too few pairs to tell, or where the particles were read in parts and never there as a whole.
    pub distribution_largest: Option<f32>,
}

impl PackingError {
    /// Whether no center is off by more than 32-bit floats are rounded at the largest coordinate.
    pub fn is_within_float(&self) -> bool {
        self.center_largest.iter().all(|&largest| largest <= 0.5 * self.float_spacing)
    }
}

/// Compares what `bvh` holds with the `records` that it was built from, in the order of its nodes; `radius` is that of all where the
/// records have none.
pub(super) fn measure<const N: usize>(records: &[Record<N>], radius: f32, bvh: &Bvh) -> PackingError {
    let error = Sums::over(records, radius, 0, |node| bvh.sphere(node)).error(records.len());
    let largest = error.center_largest.into_iter().fold(0.0, f32::max);
    let pairs = Pairs::of(records, bvh, error.mean_radius / BINS_A_RADIUS as f32, largest);
    PackingError { distribution_largest: pairs.compare(), ..error }
}

/// Particles that one thread compares at a time: whole leaves.
const STRETCH: usize = 1024 * LEAF;

/// Largest differences and sums over some particles.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    center_largest: [f32; 3],
    center_squares: [f64; 3],
    radius_largest: f32,
    radii: f64,
    coordinate: f32,
}

impl Sums {
    /// Over records of which the first is at node `first`; `held` says what is at a node instead.
    pub(super) fn over<const N: usize>(
        records: &[Record<N>],
        radius: f32,
        first: usize,
        held: impl Fn(u32) -> (Vec3, f32) + Sync,
    ) -> Self {
        let stretches = records.par_chunks(STRETCH).zip((0..records.len()).into_par_iter().step_by(STRETCH));
        let sums: Vec<Self> =
            stretches.map(|(records, at)| Self::of(records, radius, first + at, &held)).collect();
        // One after the other, so that the result does not depend on the threads.
        sums.into_iter().fold(Self::default(), Self::and)
    }

    /// The error of `count` particles, but for what pairs of them tell.
    pub(super) fn error(self, count: usize) -> PackingError {
        let count = count.max(1) as f64;
        PackingError {
            center_largest: self.center_largest,
            center_rms: self.center_squares.map(|sum| (sum / count).sqrt() as f32),
            radius_largest: self.radius_largest,
            mean_radius: (self.radii / count) as f32,
            float_spacing: self.coordinate.next_up() - self.coordinate,
            distribution_largest: None,
        }
    }

    fn of<const N: usize>(
        records: &[Record<N>],
        uniform: f32,
        first: usize,
        held: impl Fn(u32) -> (Vec3, f32),
    ) -> Self {
        let mut sums = Self::default();
        for (node, record) in (first..).zip(records) {
            let (center, radius) = held(node as u32);
            let (exact_center, exact_radius) = (record.center(), record.radius(uniform));
            let off = (center - exact_center).abs();
            for axis in 0..3 {
                sums.center_largest[axis] = sums.center_largest[axis].max(off[axis]);
                sums.center_squares[axis] += f64::from(off[axis]).powi(2);
            }
            sums.coordinate = sums.coordinate.max(exact_center.abs().max_element());
            sums.radii += f64::from(exact_radius);
            if radius != exact_radius {
                sums.radius_largest = sums.radius_largest.max((radius - exact_radius).abs() / exact_radius);
            }
        }
        sums
    }

    pub(super) fn and(self, other: Self) -> Self {
        let axes = [0, 1, 2];
        Self {
            center_largest: axes.map(|axis| self.center_largest[axis].max(other.center_largest[axis])),
            center_squares: axes.map(|axis| self.center_squares[axis] + other.center_squares[axis]),
            radius_largest: self.radius_largest.max(other.radius_largest),
            radii: self.radii + other.radii,
            coordinate: self.coordinate.max(other.coordinate),
        }
    }
}

/// Centers whose neighbors are counted, spread evenly over the tree, which is as good as random and needs no seed.
const CENTERS: usize = 4096;
/// Leaves around a center that are looked at, at most: where particles crowd, part of the pairs is enough.
const LEAVES: usize = 64;
/// Bins of distance: one every so many to a mean radius, up to four of it.
const BINS_A_RADIUS: usize = 8;
const BINS: usize = 4 * BINS_A_RADIUS + 1;
/// A pair counts as so many shares, which are dealt to the two bins that it lies between: a crystal has all its pairs at a few
/// distances, and a bin with sharp edges would tell where these lie, not how far they moved.
const SHARES: u64 = 1 << 24;
/// A bin with fewer pairs than this says more about chance than about packing.
const LEAST_PAIRS: u64 = 500;

/// Shares of pairs by distance, before and after. Whole numbers: their sum does not depend on its order.
struct Pairs {
    before: [u64; BINS + 1],
    after: [u64; BINS + 1],
}

impl Pairs {
    const NONE: Self = Self { before: [0; BINS + 1], after: [0; BINS + 1] };

    /// In bins `width` apart, where no center is off by more than `largest` along an axis.
    fn of<const N: usize>(records: &[Record<N>], bvh: &Bvh, width: f32, largest: f32) -> Self {
        if width <= 0.0 {
            return Self::NONE;
        }
        let centers = CENTERS.min(records.len());
        let reach = width * BINS as f32 + 4.0 * largest;
        let of_center = |leaves: &mut Vec<u32>, at: usize| {
            let node = at * records.len() / centers;
            dispatch!(Level::new(), simd => leaves_around(simd, bvh, node, reach, leaves));
            let mut pairs = Self::NONE;
            pairs.add(records, bvh, node, width, leaves);
            pairs
        };
        (0..centers)
            .into_par_iter()
            .with_min_len(64)
            .map_init(Vec::new, of_center)
            .reduce(|| Self::NONE, Self::and)
    }

    /// Adds the pairs of the particle at `node` with those of `leaves`.
    fn add<const N: usize>(
        &mut self,
        records: &[Record<N>],
        bvh: &Bvh,
        node: usize,
        width: f32,
        leaves: &[u32],
    ) {
        let (before, after) = (records[node].center(), bvh.sphere(node as u32).0);
        for &leaf in leaves {
            let first = leaf as usize * LEAF;
            for other in (first..records.len().min(first + LEAF)).filter(|&other| other != node) {
                deal(&mut self.before, before.distance(records[other].center()) / width);
                deal(&mut self.after, after.distance(bvh.sphere(other as u32).0) / width);
            }
        }
    }

    fn and(self, other: Self) -> Self {
        let sum = |a: [u64; BINS + 1], b: [u64; BINS + 1]| std::array::from_fn(|bin| a[bin] + b[bin]);
        Self { before: sum(self.before, other.before), after: sum(self.after, other.after) }
    }

    /// The largest difference of g(r) over the bins with enough pairs, relative to the largest g(r). Mean density and number of
    /// centers, by which g(r) is divided, are the same in both and cancel.
    fn compare(&self) -> Option<f32> {
        let counted = (0..BINS).filter(|&bin| self.before[bin].max(self.after[bin]) >= LEAST_PAIRS * SHARES);
        let of_bin = |bin: usize| {
            // The integral of a bin's triangle over the shells at its distances, in units of 4 pi width^3.
            let volume = if bin == 0 { 1.0 / 12.0 } else { (bin * bin) as f64 + 1.0 / 6.0 };
            let (before, after) = (self.before[bin] as f64, self.after[bin] as f64);
            (before / volume, (after - before).abs() / volume)
        };
        let most =
            |(g, off): (f64, f64), (other_g, other_off): (f64, f64)| (g.max(other_g), off.max(other_off));
        let (g, off) = counted.map(of_bin).reduce(most)?;
        Some((off / g) as f32)
    }
}

/// Deals a pair's shares to the bins below and above `at`; beyond the last bin there is nobody to deal to.
fn deal(bins: &mut [u64; BINS + 1], at: f32) {
    if at < BINS as f32 {
        let bin = at as usize;
        let above = ((at - bin as f32) * SHARES as f32) as u64;
        bins[bin] += SHARES - above;
        bins[bin + 1] += above;
    }
}

/// The leaves whose boxes are not farther than `reach` from the center at `node` along any axis, or the first [`LEAVES`] of them.
#[simd]
fn leaves_around<S: Simd>(simd: S, bvh: &Bvh, node: usize, reach: f32, leaves: &mut Vec<u32>) {
    leaves.clear();
    let center: Vec3 = bvh.sphere(node as u32).0;
    let mut stack: Vec<Place> = bvh.root().into_iter().collect();
    while let Some(place) = stack.pop() {
        if place.level == 0 {
            leaves.push(place.index);
            if leaves.len() == LEAVES {
                return;
            }
            continue;
        }
        let (middle, half) = bvh.node(place).decode(simd, center, reach);
        let near =
            middle.x.abs().simd_le(half.x) & middle.y.abs().simd_le(half.y) & middle.z.abs().simd_le(half.z);
        let near = near.to_bitmask() as u32 & bvh.existing(place);
        for child in 0..WIDTH {
            if near >> child & 1 == 1 {
                stack.push(bvh.child(place, child));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Packing;
    use super::*;
    use crate::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
    use crate::random::Stream;
    use crate::structure::{Kind, Store, Structure};
    use glam::DVec3;

    fn build(centers: impl Iterator<Item = Vec3>, radii: Vec<f32>, packing: Packing) -> Structure {
        let mut offsets: [Vec<f32>; 3] = Default::default();
        for center in centers {
            (0..3).for_each(|axis| offsets[axis].push(center[axis]));
        }
        let positions = Positions::from_offsets(DVec3::ZERO, offsets);
        let (radii, attributes) = match radii[..] {
            [radius] => (Radii::Uniform(radius), Vec::new()),
            _ => (
                Radii::PerParticle { attribute: 0, scale: 1.0 },
                vec![Attribute::new("radius", 1, Values::F32(radii))],
            ),
        };
        let particles = Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap();
        Structure::build(Kind::Bvh(packing), particles, &radii, 1.0, &()).unwrap()
    }

    /// A cubic lattice of 20 x 20 x 20 particles that touch, `spacing` apart.
    fn lattice(spacing: f32, packing: Packing) -> Structure {
        let center =
            |id: i32| spacing * Vec3::new((id % 20) as f32, (id / 20 % 20) as f32, (id / 400) as f32);
        build((0..8000).map(center), vec![0.5 * spacing], packing)
    }

    fn error(structure: &Structure) -> PackingError {
        *structure.packing_error().unwrap()
    }

    /// What the tree holds, as if it had been built from that.
    fn held(structure: &Structure) -> (&Bvh, Vec<Record<4>>) {
        let Store::Bvh(bvh) = &structure.store else { unreachable!("a hierarchy was asked for") };
        let record = |(node, &id): (u32, &u32)| {
            let (center, radius) = bvh.sphere(node);
            Record { coordinates: [center.x, center.y, center.z, radius], id }
        };
        (bvh, (0..).zip(bvh.ids()).map(record).collect())
    }

    #[test]
    fn a_lattice_of_whole_steps_is_packed_without_error() {
        for packing in [Packing::Bits16, Packing::Bits11, Packing::Bits8] {
            let found = error(&lattice(1.0, packing));
            assert_eq!((found.center_largest, found.center_rms), ([0.0; 3], [0.0; 3]), "{packing:?}");
            assert_eq!((found.radius_largest, found.mean_radius), (0.0, 0.5));
            assert_eq!(found.distribution_largest, Some(0.0));
            assert_eq!(found.float_spacing, 19.0_f32.next_up() - 19.0);
            assert!(found.is_within_float());
        }
        assert!(lattice(1.0, Packing::Exact).packing_error().is_none());
    }

    #[test]
    fn the_error_of_a_lattice_is_at_most_half_a_step_and_falls_with_the_bits() {
        // A leaf of sixteen is at least a spacing and at most fifteen wide; a step is less than two of its shares.
        let mut last = PackingError { center_largest: [0.0; 3], ..error(&lattice(0.3, Packing::Bits16)) };
        for (packing, steps) in
            [(Packing::Bits16, 65535.0), (Packing::Bits11, 1023.0), (Packing::Bits8, 255.0)]
        {
            let found = error(&lattice(0.3, packing));
            for axis in 0..3 {
                assert!(found.center_largest[axis] <= 15.0 * 0.3 / steps, "{packing:?}: {found:?}");
                assert!(found.center_largest[axis] > last.center_largest[axis], "{packing:?}: {found:?}");
                assert!((0.0..=found.center_largest[axis]).contains(&found.center_rms[axis]));
            }
            if last.center_largest[0] > 0.0 {
                assert!(found.distribution_largest > last.distribution_largest, "{packing:?}: {found:?}");
            }
            last = found;
        }
    }

    #[test]
    fn one_altered_center_or_radius_is_told() {
        let structure = lattice(1.0, Packing::Bits16);
        let (bvh, mut records) = held(&structure);
        let same = measure(&records, 0.0, bvh);
        assert_eq!(same, error(&structure));
        records[1234].coordinates[1] += 0.25;
        let moved = measure(&records, 0.0, bvh);
        assert_eq!((moved.center_largest, moved.radius_largest), ([0.0, 0.25, 0.0], 0.0));
        assert!((moved.center_rms[1] - 0.25 / 8000_f32.sqrt()).abs() < 1e-8);
        assert!(moved.distribution_largest > Some(0.0) && !moved.is_within_float());
        records[1234].coordinates[1] -= 0.25;
        records[77].coordinates[3] = 0.4;
        let swollen = measure(&records, 0.0, bvh);
        assert_eq!(
            swollen,
            PackingError {
                radius_largest: (0.5 - 0.4) / 0.4,
                mean_radius: swollen.mean_radius,
                distribution_largest: swollen.distribution_largest,
                ..same
            }
        );
    }

    #[test]
    fn pairs_of_two_centers_far_from_the_others_are_counted_twice_and_by_their_distance() {
        let centers = [Vec3::ZERO, Vec3::new(2.25, 0.0, 0.0), Vec3::splat(100.0)];
        let structure = build(centers.into_iter(), vec![1.0], Packing::Bits16);
        let (bvh, records) = held(&structure);
        let pairs = Pairs::of(&records, bvh, 1.0 / BINS_A_RADIUS as f32, 0.0);
        assert_eq!(pairs.before[9 * BINS_A_RADIUS / 4], 2 * SHARES);
        assert_eq!(pairs.before.iter().sum::<u64>(), 2 * SHARES);
        assert_eq!(pairs.before[..BINS], pairs.after[..BINS]);
        assert_eq!(pairs.compare(), None, "two pairs are too few");
    }

    #[test]
    fn degenerate_particles_have_an_error_too() {
        let one = error(&build([Vec3::ONE].into_iter(), vec![0.0], Packing::Bits8));
        assert_eq!((one.center_largest, one.mean_radius, one.distribution_largest), ([0.0; 3], 0.0, None));
        assert!(error(&build([].into_iter(), vec![1.0], Packing::Bits8)).is_within_float());
        let equal = error(&build((0..5000).map(|_| Vec3::ONE), vec![1.0], Packing::Bits16));
        assert_eq!((equal.center_largest, equal.distribution_largest), ([0.0; 3], Some(0.0)));
        let mut random = Stream::new(3, 0);
        let radii: Vec<f32> = (0..3000).map(|_| random.range(0.0, 1.0)).collect();
        let mixed = error(&build((0..3000).map(|_| random.cube()), radii, Packing::Bits16));
        assert!(mixed.radius_largest > 0.0 && mixed.radius_largest < 0.1, "{mixed:?}");
    }

    #[test]
    fn threads_do_not_alter_the_error() {
        let found = [1, 2].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut random = Stream::new(9, 0);
            let centers: Vec<Vec3> = (0..40_000).map(|_| random.cube()).collect();
            pool.install(|| error(&build(centers.into_iter(), vec![0.05], Packing::Bits11)))
        });
        assert_eq!(found[0], found[1]);
    }
}
