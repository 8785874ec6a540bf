//! Bonds: pairs of particles, checked and put in order on entry; where they were saved, when somebody asks for them.
//!
//! Invariant of what is given out: both ids are those of particles, the smaller first, each pair once, in order.

use std::sync::OnceLock;

use rayon::prelude::*;

use crate::frozen::Frozen;

/// See the module.
#[derive(Clone, Debug, Default)]
pub(super) struct Bonds {
    /// As they were saved: nobody has looked at them.
    saved: Frozen<[u32; 2]>,
    checked: OnceLock<Vec<[u32; 2]>>,
}

impl Bonds {
    /// Of pairs of places; see [`checked`].
    pub(super) fn new(bonds: Vec<[u32; 2]>, count: usize, places: Option<&[u64]>) -> Self {
        Self { saved: Frozen::default(), checked: OnceLock::from(checked(bonds, count, places)) }
    }

    /// Of pairs of ids, such as those of a mapped file.
    pub(super) fn saved(saved: Frozen<[u32; 2]>) -> Self {
        Self { saved, checked: OnceLock::new() }
    }

    /// The bonds of `count` particles.
    pub(super) fn of(&self, count: usize) -> &[[u32; 2]] {
        self.checked.get_or_init(|| checked(self.saved.to_vec(), count, None))
    }

    /// Memory that they take, in bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.checked.get().map_or(&self.saved[..], Vec::as_slice))
    }
}

/// Each bond once, in order, between two of `count` particles; where some were dropped, `places` are the places of the others.
fn checked(mut bonds: Vec<[u32; 2]>, count: usize, places: Option<&[u64]>) -> Vec<[u32; 2]> {
    let id = |place: u32| match places {
        Some(places) => places.binary_search(&u64::from(place)).ok().map(|id| id as u32),
        None => Some(place).filter(|&place| (place as usize) < count),
    };
    bonds.retain_mut(|bond| {
        let (Some(one), Some(other)) = (id(bond[0]), id(bond[1])) else { return false };
        *bond = [one.min(other), one.max(other)];
        one != other
    });
    bonds.par_sort_unstable();
    bonds.dedup();
    bonds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_saved_is_checked_when_it_is_asked_for() {
        let pairs = vec![[2, 1], [0, 3], [1, 2], [1, 1], [0, 4], [u32::MAX, 0], [0, 1]];
        let saved = Bonds::saved(pairs.clone().into());
        assert_eq!(saved.bytes(), 8 * pairs.len(), "nobody has asked");
        let wanted = [[0, 1], [0, 3], [1, 2]];
        assert_eq!((saved.of(4), Bonds::new(pairs, 4, None).of(4)), (&wanted[..], &wanted[..]));
        assert_eq!(saved.bytes(), 8 * wanted.len());
        let places = [5, 7, 9];
        assert_eq!(Bonds::new(vec![[9, 5], [5, 6]], 3, Some(&places)).of(3), [[0, 2]]);
    }
}
