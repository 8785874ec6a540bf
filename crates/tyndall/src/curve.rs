//! The Hilbert curve through a lattice of cells: neighbors along it are neighbors in space, so that a run of it is compact.
//!
//! Source: J. Skilling, "Programming the Hilbert curve", AIP Conf. Proc. 707, 2004.

/// The place on the curve of a cell of the lattice with 2^`bits` cells an axis; `bits` is 1 to 21.
pub(crate) fn hilbert(mut cell: [u32; 3], bits: u32) -> u64 {
    // Undo the excess rotations and reflections, from the coarsest cube to the finest.
    for level in (1..bits).rev() {
        let (bit, mask) = (1 << level, (1 << level) - 1);
        for axis in 0..3 {
            if cell[axis] & bit != 0 {
                cell[0] ^= mask;
            } else {
                let swapped = (cell[0] ^ cell[axis]) & mask;
                cell[0] ^= swapped;
                cell[axis] ^= swapped;
            }
        }
    }
    // Gray code.
    cell[1] ^= cell[0];
    cell[2] ^= cell[1];
    let bits_of_z = (1..bits).filter(|level| cell[2] >> level & 1 == 1);
    let flips = bits_of_z.fold(0, |flips, level| flips ^ ((1 << level) - 1));
    let [x, y, z] = cell.map(|it| spread(u64::from(it ^ flips)));
    x << 2 | y << 1 | z
}

/// Twenty-one bits with two zeros between neighbors.
fn spread(mut bits: u64) -> u64 {
    bits = (bits | bits << 32) & 0x001f_0000_0000_ffff;
    bits = (bits | bits << 16) & 0x001f_0000_ff00_00ff;
    bits = (bits | bits << 8) & 0x100f_00f0_0f00_f00f;
    bits = (bits | bits << 4) & 0x10c3_0c30_c30c_30c3;
    (bits | bits << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbors_on_the_curve_are_neighbors_in_space() {
        for bits in [3, 16, 20, 21] {
            let mut cells: Vec<(u64, [u32; 3])> = Vec::new();
            for (x, y, z) in (0..512).map(|k| (k & 7, k >> 3 & 7, k >> 6)) {
                let cell = [x, y, z].map(|it| it << (bits - 3));
                cells.push((hilbert(cell, bits) >> (3 * (bits - 3)), [x, y, z]));
            }
            cells.sort_unstable();
            for (place, pair) in cells.windows(2).enumerate() {
                let steps: u32 = (0..3).map(|axis| pair[0].1[axis].abs_diff(pair[1].1[axis])).sum();
                assert_eq!((pair[0].0, steps), (place as u64, 1));
            }
        }
    }

    #[test]
    fn every_cell_has_a_place_of_its_own() {
        let mut places: Vec<u64> = (0..4096).map(|k| hilbert([k & 15, k >> 4 & 15, k >> 8], 4)).collect();
        places.sort_unstable();
        assert!(places.into_iter().eq(0..4096));
    }
}
