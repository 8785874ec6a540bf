//! Cutting the particles into treelets, up to eight runs a node; then nodes are written from the root down.
//!
//! A node takes the runs that three levels of cuts leave, and opens the longest of them until it has eight. So a node lies at most a
//! third as deep as the cuts do, of which the middle is allowed `MIDDLE_LEVELS` and the median needs 28 for 2^32 particles and 12
//! within a treelet: less than 27 nodes, each of which leaves at most seven children on a walk's stack.

use rayon::prelude::*;

use super::{Children, Cut, Options, Treelets, WIDTH};
use crate::error::{Error, Result};
use crate::math::Bounds;
use crate::progress::Progress;
use crate::structure::box_slack;
use crate::structure::build::{PROBES, Record, cut, middle, widest};
use crate::structure::bvh::Node;
use crate::structure::heap::{self, Columns, Heap};

/// Below this many particles a run is cut by one thread, and progress is told for it as a whole.
const PARALLEL_COUNT: usize = 1 << 14;
/// Deeper than this many cuts, no cut goes through the middle of space, which may leave all but one particle on one side.
const MIDDLE_LEVELS: u32 = 40;
/// Runs of this many particles are treelets even if their radii differ more than their centers: that many are tested at once.
const LEAST: usize = 16;

impl Treelets {
    /// Builds over `records`, in parallel; `radius` is that of all where the records have none. Fails only when interrupted.
    pub(in crate::structure) fn build<const N: usize>(
        mut records: Vec<Record<N>>,
        radius: f32,
        options: Options,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let builder = Builder { size: options.size.max(1) as usize, radius, options, progress };
        let mut nodes = Nodes::default();
        let mut bounds = Bounds::EMPTY;
        if !records.is_empty() {
            let part = builder.arrange(Run { records: &mut records, first: 0, depth: 0 });
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            bounds = part.bounds;
            match part.inside {
                Inside::Parts(parts) => nodes.add(parts),
                Inside::Treelet(_) => nodes.add(vec![part]),
            };
        }
        Ok(Self {
            columns: Columns::gather(&records, radius, |node| node, &nodes.heaps, options.heap),
            heaps: nodes.heaps.into(),
            nodes: nodes.nodes.into(),
            children: nodes.children.into(),
            bounds,
            slack: box_slack(&bounds),
            options,
        })
    }
}

/// A run of particles that is to be cut or made a treelet.
struct Run<'a, const N: usize> {
    records: &'a mut [Record<N>],
    /// The place of its first particle.
    first: u32,
    /// How many cuts led to it.
    depth: u32,
}

/// Cut particles, and the box of their spheres.
struct Part {
    bounds: Bounds,
    inside: Inside,
}

enum Inside {
    Treelet(Heap),
    Parts(Vec<Part>),
}

struct Builder<'a> {
    size: usize,
    radius: f32,
    options: Options,
    progress: &'a dyn Progress,
}

impl Builder<'_> {
    fn arrange<const N: usize>(&self, run: Run<N>) -> Part {
        if self.is_treelet(run.records) || self.progress.cancelled() {
            return self.treelet(run);
        }
        let is_long = run.records.len() > PARALLEL_COUNT;
        let mut runs = self.cut_runs(run, 3);
        while runs.len() < WIDTH {
            let open = |place: &usize| !self.is_treelet(runs[*place].records);
            let longest = (0..runs.len()).filter(open).max_by_key(|&place| runs[place].records.len());
            let Some(longest) = longest else { break };
            let opened = self.cut_runs(runs.remove(longest), 1);
            runs.splice(longest..longest, opened);
        }
        let part = |run: Run<N>| {
            let count = run.records.len();
            let part = self.arrange(run);
            if is_long && count <= PARALLEL_COUNT {
                self.progress.advance(count as u64);
            }
            part
        };
        let parts: Vec<Part> = match is_long {
            true => runs.into_par_iter().map(part).collect(),
            false => runs.into_iter().map(part).collect(),
        };
        let bounds = parts.iter().fold(Bounds::EMPTY, |bounds, part| bounds.union(part.bounds));
        Part { bounds, inside: Inside::Parts(parts) }
    }

    /// Whether a run is short enough, and its radii do not differ by more than its centers lie apart.
    fn is_treelet<const N: usize>(&self, records: &[Record<N>]) -> bool {
        let of_similar_radii = || N == 3 || widest(records, records.len()) < 3;
        records.len() <= LEAST.min(self.size) || (records.len() <= self.size && of_similar_radii())
    }

    /// Makes a heap of a run.
    fn treelet<const N: usize>(&self, run: Run<N>) -> Part {
        let heap = Heap::over(run.records, self.radius, run.first);
        heap::sort(run.records, heap.centers, 0, self.options.heap, &());
        heap::reorder(run.records);
        let sphere = |record: &Record<N>| {
            let center = record.center();
            Bounds { min: center, max: center }.grown(record.radius(self.radius))
        };
        let bounds = run.records.iter().map(sphere).fold(Bounds::EMPTY, Bounds::union);
        Part { bounds, inside: Inside::Treelet(heap) }
    }

    /// The runs that at most `levels` levels of cuts leave.
    fn cut_runs<'a, const N: usize>(&self, run: Run<'a, N>, levels: u32) -> Vec<Run<'a, N>> {
        if levels == 0 || self.is_treelet(run.records) {
            return vec![run];
        }
        let left_count = self.cut(run.records, run.depth);
        let depth = run.depth + 1;
        let (left, right) = run.records.split_at_mut(left_count);
        let is_long = left.len().min(right.len()) > PARALLEL_COUNT;
        let left = Run { records: left, first: run.first, depth };
        let right = Run { records: right, first: run.first + left_count as u32, depth };
        let cut_left = || self.cut_runs(left, levels - 1);
        let cut_right = || self.cut_runs(right, levels - 1);
        let (mut runs, right) =
            if is_long { rayon::join(cut_left, cut_right) } else { (cut_left(), cut_right()) };
        runs.extend(right);
        runs
    }

    /// Moves the particles that belong to the left to the front; how many they are, neither none nor all.
    fn cut<const N: usize>(&self, records: &mut [Record<N>], depth: u32) -> usize {
        let is_short = records.len() <= self.size;
        if (self.options.cut == Cut::Middle || is_short) && depth < MIDDLE_LEVELS {
            // One large particle must not be overlooked in what could be a treelet.
            let probes = if is_short { records.len() } else { PROBES };
            let (axis, middle) = middle(records, probes);
            let mut left_count = 0;
            for place in 0..records.len() {
                if records[place].coordinates[axis] < middle {
                    records.swap(left_count, place);
                    left_count += 1;
                }
            }
            if left_count > 0 && left_count < records.len() {
                return left_count;
            }
        }
        let left_count = match is_short {
            true => records.len() / 2,
            false => {
                // Whole treelets, and whole subtrees of full nodes.
                let mut share = self.size;
                while share * WIDTH < records.len() {
                    share *= WIDTH;
                }
                records.len().div_ceil(share).div_ceil(2) * share
            }
        };
        let axis = widest(records, PROBES);
        cut(records, axis, left_count);
        left_count
    }
}

/// Nodes and treelets as they are written.
#[derive(Default)]
struct Nodes {
    nodes: Vec<Node>,
    children: Vec<Children>,
    heaps: Vec<Heap>,
}

impl Nodes {
    /// Writes a node over `parts` and all that is below; its place.
    fn add(&mut self, parts: Vec<Part>) -> u32 {
        let node = self.nodes.len();
        let boxes: Vec<Bounds> = parts.iter().map(|part| part.bounds).collect();
        self.nodes.push(Node::encode(&boxes));
        self.children.push(Children {
            places: [0; WIDTH],
            treelets: 0,
            existing: ((1u32 << parts.len()) - 1) as u8,
            unused: [0; 2],
        });
        for (child, part) in parts.into_iter().enumerate() {
            self.children[node].places[child] = match part.inside {
                Inside::Treelet(heap) => {
                    self.children[node].treelets |= 1 << child;
                    self.heaps.push(heap);
                    self.heaps.len() as u32 - 1
                }
                Inside::Parts(parts) => self.add(parts),
            };
        }
        node as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::structure::pkd;
    use crate::structure::treelets::Child;
    use glam::Vec3;

    /// Particles with a radius each, of which a few are large.
    fn records(count: usize) -> Vec<Record<4>> {
        let record = |id: usize| {
            let at = |step: f32| (id as f32 * step).fract();
            let radius = if id.is_multiple_of(97) { 0.3 } else { 0.01 };
            Record {
                coordinates: [at(0.754_877), at(0.569_84), at(0.618_034).powi(4), radius],
                id: id as u32,
            }
        };
        (0..count).map(record).collect()
    }

    /// Walks the whole tree, checks boxes and heaps, and collects the nodes of particles.
    fn visit(treelets: &Treelets, place: usize, depth: usize, found: &mut Vec<u32>) -> Bounds {
        assert!(depth < 27);
        let children = &treelets.children[place];
        let mut all = Bounds::EMPTY;
        for child in (0..WIDTH).filter(|child| children.existing >> child & 1 == 1) {
            let inside = match children.child(child) {
                Child::Node(place) => visit(treelets, place as usize, depth + 1, found),
                Child::Treelet(place) => {
                    let (heap, count) = treelets.heap(place as usize);
                    let nodes = heap.first..heap.first + count as u32;
                    found.extend(nodes.clone());
                    let grown = |node| {
                        let (center, radius) = treelets.sphere(node);
                        assert!(heap.centers.contains(center) && radius <= heap.radius);
                        Bounds { min: center, max: center }.grown(radius)
                    };
                    nodes.map(grown).fold(Bounds::EMPTY, Bounds::union)
                }
            };
            let [min, max] = treelets.nodes[place].decoded(child);
            assert!(min.cmple(inside.min + treelets.slack).all());
            assert!(max.cmpge(inside.max - treelets.slack).all());
            all = all.union(inside);
        }
        all
    }

    #[test]
    fn every_particle_is_in_one_treelet_and_every_box_holds_what_is_below_it() {
        for cut in [Cut::Median, Cut::Middle] {
            for size in [1, 16, 64, 4096] {
                for count in [0, 1, 2, 15, 16, 17, 63, 64, 65, 512, 513, 4097, 40_000] {
                    let options = Options { size, cut, heap: pkd::Options::default() };
                    let treelets = Treelets::build(records(count), 0.0, options, &()).unwrap();
                    let mut found = Vec::new();
                    if count > 0 {
                        let bounds = visit(&treelets, 0, 0, &mut found);
                        assert_eq!(bounds, treelets.bounds());
                    }
                    assert!(found.into_iter().eq(0..count as u32), "{count} particles, {size}, {cut:?}");
                    let mut ids = treelets.ids().to_vec();
                    ids.sort_unstable();
                    assert!(ids.into_iter().eq(0..count as u32), "{count} particles, {size}, {cut:?}");
                    assert!(treelets.heaps.iter().all(|heap| heap.centers.min != Vec3::INFINITY));
                }
            }
        }
    }

    #[test]
    fn median_cuts_leave_full_treelets_and_few_nodes() {
        let records: Vec<Record<3>> = records(64 * 512)
            .iter()
            .map(|record| Record { coordinates: record.center().to_array(), id: record.id })
            .collect();
        let options = Options { size: 64, ..Options::default() };
        let treelets = Treelets::build(records, 0.01, options, &()).unwrap();
        assert_eq!((treelets.heaps.len(), treelets.nodes.len()), (512, 64 + 8 + 1));
        assert!((0..512).all(|treelet| treelets.heap(treelet).1 == 64));
    }

    #[test]
    fn large_particles_part_from_small_ones_within_a_treelet() {
        let mut records = records(4096);
        records.iter_mut().for_each(|record| record.coordinates[3] = 1e-4);
        records[1234].coordinates[3] = 10.0;
        let treelets =
            Treelets::build(records, 0.0, Options { size: 4096, ..Options::default() }, &()).unwrap();
        let mut radii: Vec<f32> = treelets.heaps.iter().map(|heap| heap.radius).collect();
        radii.sort_by(f32::total_cmp);
        assert_eq!(radii, [1e-4, 10.0]);
    }
}
