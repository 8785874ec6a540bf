//! Which particles of heaps are shown, and which subtrees show any.

use rayon::prelude::*;

use super::{Columns, Heap};
#[cfg(feature = "gpu")]
use crate::structure::selection::Bits;
use crate::structure::selection::{RUN, Test, all_bits, shows, thinned};

/// A bit a node, sixteen a word: whether it is shown itself, and whether anything of its subtree is.
#[derive(Clone)]
pub(super) struct Shown {
    own: Vec<u16>,
    any: Vec<u16>,
}

impl Columns {
    /// Shows the particles that fulfill all tests; without a test all. Returns how many. `heaps` are all, in order.
    pub(in crate::structure) fn show(&mut self, tests: &[Test], heaps: &[Heap]) -> u64 {
        self.shown = None;
        let count = self.ids.len();
        if tests.is_empty() {
            return count as u64;
        }
        let own = all_bits(count, tests, |node| self.sphere(node as u32).0);
        let shown = own.par_iter().map(|bits| u64::from(bits.count_ones())).sum();
        self.set_shown(own, heaps);
        shown
    }

    /// Hides those of the shown particles that `keeps` does not keep, by node. `heaps` are all, in order.
    pub(in crate::structure) fn thin(&mut self, keeps: impl Fn(u32) -> bool + Sync, heaps: &[Heap]) {
        let shown = self.shown.as_ref().map(|shown| &shown.own[..]);
        self.set_shown(thinned(self.ids.len(), shown, keeps), heaps);
    }

    fn set_shown(&mut self, own: Vec<u16>, heaps: &[Heap]) {
        let count = self.ids.len();
        let mut any = own.clone();
        for (place, heap) in heaps.iter().enumerate() {
            let first = heap.first as usize;
            // Children come after their parents.
            for node in (1..super::count(heaps, place, count)).rev() {
                let parent = first + (node - 1) / 2;
                any[parent / RUN] |= u16::from(shows(&any, first + node)) << (parent % RUN);
            }
        }
        self.shown = Some(Shown { own, any });
    }

    /// Whether the particle at `node` is shown.
    #[inline(always)]
    pub(in crate::structure) fn shows(&self, node: usize) -> bool {
        self.shown.as_ref().is_none_or(|shown| shows(&shown.own, node))
    }

    /// The bits, where not all are shown.
    #[cfg(feature = "gpu")]
    pub(in crate::structure) fn shown_bits(&self) -> Option<Bits<'_>> {
        let Shown { own, any } = self.shown.as_ref()?;
        Some(Bits { particles: own, subtrees: bytemuck::cast_slice(any) })
    }

    /// Whether anything below `node` is shown, itself included.
    #[inline(always)]
    pub(super) fn shows_any(&self, node: usize) -> bool {
        self.shown.as_ref().is_none_or(|shown| shows(&shown.any, node))
    }
}
