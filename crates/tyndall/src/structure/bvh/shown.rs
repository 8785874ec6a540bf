//! Which particles of the hierarchy are shown: a bit a particle, and a bit for every child that shows any.
//!
//! Rules are decided from nodes downward: where the box or the numbers of a subtree say that all or none of it are wanted, its
//! particles are not looked at.

use rayon::prelude::*;

use super::{Bvh, LEAF, Node, Place, WIDTH, power_of_two};
use crate::math::Bounds;
#[cfg(feature = "gpu")]
use crate::structure::selection::Bits;
use crate::structure::selection::{Test, Verdict, bits, thinned};

/// See the module. Empty where all are shown.
#[derive(Clone, Default)]
pub(super) struct Shown {
    /// By leaf: a bit for every particle.
    leaves: Vec<u16>,
    /// By node, in the order of the nodes: a bit for every child.
    children: Vec<u8>,
}

/// Subtrees of this level are decided by one thread each.
const CHUNK_LEVEL: u8 = 3;

impl Node {
    /// The box of a child.
    fn child_box(&self, child: usize) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for axis in 0..3 {
            let step = power_of_two(self.exponent[axis]);
            let at = |steps: u8| self.corner[axis] + step * f32::from(steps);
            bounds.min[axis] = at(self.steps[axis][child]);
            bounds.max[axis] = at(self.steps[axis][WIDTH + child]);
        }
        bounds
    }
}

impl Bvh {
    /// A bit for every particle of the leaf that is shown.
    #[inline(always)]
    pub(crate) fn shown(&self, leaf: usize) -> u32 {
        self.shown.leaves.get(leaf).map_or(0xffff, |&bits| bits.into())
    }

    /// Whether the particle at `node` is shown.
    #[inline(always)]
    pub(in crate::structure) fn shows(&self, node: u32) -> bool {
        self.shown(node as usize / LEAF) >> (node as usize % LEAF) & 1 == 1
    }

    /// The bits, where not all are shown.
    #[cfg(feature = "gpu")]
    pub(in crate::structure) fn shown_bits(&self) -> Option<Bits<'_>> {
        let Shown { leaves, children } = &self.shown;
        (!leaves.is_empty()).then_some(Bits { particles: leaves, subtrees: children })
    }

    /// A bit for every child that has particles that are shown.
    #[inline(always)]
    pub(crate) fn shown_children(&self, place: Place) -> u32 {
        let node = (self.first[place.level as usize] + place.index) as usize;
        self.shown.children.get(node).map_or_else(|| self.existing(place), |&bits| bits.into())
    }

    /// Shows the particles that fulfill all tests; without a test all. Returns how many.
    pub(in crate::structure) fn show(&mut self, tests: &[Test]) -> u64 {
        self.shown = Shown::default();
        if tests.is_empty() || self.ids.is_empty() {
            return self.ids.len() as u64;
        }
        let level = self.top.min(CHUNK_LEVEL);
        let mut leaves = vec![0; self.count[0] as usize];
        let tests: Vec<&Test> = tests.iter().collect();
        leaves.par_chunks_mut(WIDTH.pow(level.into())).enumerate().for_each(|(index, leaves)| {
            self.decide(Place { index: index as u32, level }, &tests, leaves);
        });
        let count = leaves.par_iter().map(|bits| u64::from(bits.count_ones())).sum();
        self.set_shown(leaves);
        count
    }

    /// Hides those of the shown particles that `keeps` does not keep, by node.
    pub(in crate::structure) fn thin(&mut self, keeps: impl Fn(u32) -> bool + Sync) {
        let shown = Some(&self.shown.leaves[..]).filter(|leaves| !leaves.is_empty());
        self.set_shown(thinned(self.ids.len(), shown, keeps));
    }

    fn set_shown(&mut self, leaves: Vec<u16>) {
        let children = self.children_of(&leaves);
        self.shown = Shown { leaves, children };
    }

    /// Decides the particles below a node.
    fn decide(&self, place: Place, tests: &[&Test], leaves: &mut [u16]) {
        let width = WIDTH.pow(u32::from(place.level) - 1);
        for (child, leaves) in leaves.chunks_mut(width).enumerate() {
            let at = self.child(place, child);
            let bounds = self.node(place).child_box(child).grown(self.slack);
            let verdict = |test: &&&Test| test.verdict(at.level.into(), at.index as usize, &bounds);
            if tests.iter().any(|test| verdict(&test) == Verdict::None) {
                continue;
            }
            let open: Vec<&Test> =
                tests.iter().filter(|test| verdict(test) == Verdict::Some).copied().collect();
            if at.level > 0 && !open.is_empty() {
                self.decide(at, &open, leaves);
                continue;
            }
            for (leaf, bits) in (at.index as usize * width..).zip(leaves) {
                *bits = self.decide_leaf(leaf, &open);
            }
        }
    }

    fn decide_leaf(&self, leaf: usize, tests: &[&Test]) -> u16 {
        bits(leaf * LEAF, self.ids.len(), tests.iter().copied(), |node| self.sphere(node as u32).0)
    }

    /// Which children show anything, from the leaves upward.
    fn children_of(&self, leaves: &[u16]) -> Vec<u8> {
        fn masks<T: Copy + Default + PartialEq + Sync>(
            below: &[T],
        ) -> impl IndexedParallelIterator<Item = u8> {
            let any =
                |mask: u8, (child, below): (usize, &T)| mask | u8::from(*below != T::default()) << child;
            below.par_chunks(WIDTH).map(move |below| below.iter().enumerate().fold(0, any))
        }
        let mut children: Vec<u8> = Vec::with_capacity(self.nodes.len());
        children.par_extend(masks(leaves));
        for level in 2..=self.top as usize {
            let below = self.first[level - 1] as usize..self.first[level] as usize;
            let above: Vec<u8> = masks(&children[below]).collect();
            children.extend(above);
        }
        children
    }
}
