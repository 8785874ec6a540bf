//! LibLZF, with which PCL packs point clouds and h5py HDF5.
//!
//! A stream is runs of literal bytes, and copies of what came up to 8 KiB before. Source: lzf_d.c of LibLZF (BSD).

/// Unpacks `packed`, to at most `most` bytes; says what is wrong with it.
pub(crate) fn unpack(packed: &[u8], most: usize) -> Result<Vec<u8>, &'static str> {
    // A pair of bytes makes at most 264, so a small stream that claims to be huge gets no memory.
    let mut out = Vec::with_capacity(most.min(packed.len().saturating_mul(4)));
    let mut bytes = packed.iter().copied();
    let mut next = || bytes.next().ok_or("the LZF data end early");
    while let Ok(control) = next() {
        if control < 32 {
            for _ in 0..=control {
                out.push(next()?);
            }
        } else {
            let mut length = usize::from(control >> 5) + 2;
            if length == 9 {
                length += usize::from(next()?);
            }
            let distance = (usize::from(control & 31) << 8 | usize::from(next()?)) + 1;
            let start = out.len().checked_sub(distance).ok_or("the LZF data point before their beginning")?;
            for place in start..start + length {
                out.push(out[place]);
            }
        }
        if out.len() > most {
            return Err("the LZF data are longer than they should be");
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_repeat_what_came_before() {
        // Three literals, then nine bytes from three back, which overlap what they make.
        let packed = [2, b'a', b'b', b'c', 7 << 5, 0, 2];
        assert_eq!(unpack(&packed, 12).unwrap(), b"abcabcabcabc");
        assert!(unpack(&packed, 11).is_err());
        for broken in [&[5u8, b'a'][..], &[7 << 5, 0], &[1 << 5, 0]] {
            assert!(unpack(broken, 100).is_err(), "{broken:?}");
        }
    }
}
