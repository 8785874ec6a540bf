//! Large arrays on huge pages: a walk that misses the cache then misses the page table less often, and the first touch of the memory
//! costs little.
//!
//! Where the system has none, or gives none, the arrays are ordinary ones.

#[cfg(feature = "gpu")]
use bytemuck::Pod;
use rayon::prelude::*;

#[cfg(feature = "gpu")]
use crate::error::Result;
#[cfg(feature = "gpu")]
use crate::frozen::Frozen;

/// Arrays below this size stay on ordinary pages.
#[cfg(target_os = "linux")]
const LEAST_BYTES: usize = 8 << 20;
/// The size of a huge page.
#[cfg(target_os = "linux")]
const PAGE_BYTES: usize = 2 << 20;

/// Threads write at least so many items each.
const LEAST_ITEMS: usize = 1 << 16;

/// `count` zeros.
pub(crate) fn zeros(count: usize) -> Vec<f32> {
    filled(count, 0.0)
}

/// `count` times the same, written to memory even if it is zero: a page that is read before it is written to is mapped twice.
pub(crate) fn filled<T: Copy + Send + Sync>(count: usize, item: T) -> Vec<T> {
    let mut array = with_capacity(count);
    array.par_extend(rayon::iter::repeat_n(item, count).with_min_len(LEAST_ITEMS));
    array
}

/// An array of `count` items, whose memory `fill` writes.
#[cfg(feature = "gpu")]
pub(crate) fn written<T: Pod + Send + Sync>(
    count: usize,
    fill: impl FnOnce(&mut [u8]) -> Result<()>,
) -> Result<Frozen<T>> {
    let mut array = filled(count, T::zeroed());
    fill(bytemuck::cast_slice_mut(&mut array))?;
    Ok(array.into())
}

/// An empty array with room for `count` items.
pub(crate) fn with_capacity<T>(count: usize) -> Vec<T> {
    let mut array = Vec::new();
    reserve(&mut array, count);
    array
}

/// Makes room for `count` more items.
pub fn reserve<T>(array: &mut Vec<T>, count: usize) {
    array.reserve(count);
    advise(array);
}

/// Asks for huge pages for the memory that an array has reserved and not yet filled.
#[cfg(target_os = "linux")]
#[expect(unsafe_code, reason = "the system takes a range of addresses")]
fn advise<T>(array: &mut Vec<T>) {
    let room = array.spare_capacity_mut();
    let bytes = size_of_val(room);
    let start = room.as_mut_ptr();
    let skipped = start.addr().next_multiple_of(PAGE_BYTES) - start.addr();
    if bytes < LEAST_BYTES {
        return;
    }
    let (first, length) = (start.wrapping_byte_add(skipped), (bytes - skipped) / PAGE_BYTES * PAGE_BYTES);
    // SAFETY: the range lies in memory that this array owns and that nothing else refers to; the advice changes how it is paged,
    // never what it holds.
    let advised = unsafe { rustix::mm::madvise(first.cast(), length, rustix::mm::Advice::LinuxHugepage) };
    // A system without huge pages refuses: the array is as good without.
    advised.ok();
}

#[cfg(not(target_os = "linux"))]
fn advise<T>(_: &mut Vec<T>) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_hold_what_they_are_given() {
        for count in [0, 1, 1000, 3_000_000] {
            let mut array = with_capacity(count);
            array.extend(0..count as u64);
            assert!(array.into_iter().eq(0..count as u64));
            assert_eq!(zeros(count), vec![0.0; count]);
        }
    }
}
