//! Particles that are never all in memory: a source gives any part of them whenever it is asked.

use std::ops::Range;

use glam::Vec3;

use crate::error::Result;

/// Particles that can be read part by part, in any order of parts, as often as needed.
pub trait Source: Sync {
    /// How many there are, at most 2^32 - 2.
    fn len(&self) -> u64;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Replaces what is in `into` by the centers of the particles in `range`, as offsets from the origin; what is not finite will be
    /// left out.
    fn read(&self, range: Range<u64>, into: &mut Vec<Vec3>) -> Result<()>;
}
