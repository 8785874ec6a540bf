//! Blosc 1 containers with LZ4 inside, as OpenVDB writes them.
//!
//! Takes a container, fills the memory that its content must have exactly. Source: c-blosc 1.21, README_CHUNK_FORMAT.rst: 16 bytes of
//! header, places of the blocks, and blocks of one or several streams, each with its length; bytes of numbers may be shuffled, all
//! first bytes first.

/// Bytes of the header.
const HEADER: usize = 16;
/// A block is split into a stream for each byte of its numbers if these have at most so many bytes ...
const MOST_SPLITS: usize = 16;
/// ... and each stream has at least so many.
const LEAST_STREAM: usize = 128;

/// Unpacks a container; says what is wrong with it.
pub(super) fn unpack(packed: &[u8], content: &mut [u8]) -> Result<(), String> {
    let number = |at: usize| -> Result<usize, String> {
        let bytes = packed.get(at..at + 4).ok_or("a Blosc container ends early")?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize)
    };
    let [_version, _, flags, type_bytes] = *packed.first_chunk().ok_or("a Blosc container ends early")?;
    let [bytes, block_bytes] = [number(4)?, number(8)?];
    if bytes != content.len() {
        return Err(format!("a Blosc container of {bytes} bytes was found where {} belong", content.len()));
    }
    let type_bytes = usize::from(type_bytes).max(1);
    if flags & 2 != 0 {
        let plain = packed.get(HEADER..HEADER + bytes).ok_or("a Blosc container ends early")?;
        content.copy_from_slice(plain);
        return Ok(());
    }
    let compressor = flags >> 5;
    if compressor != 1 {
        let name = ["BloscLZ", "LZ4", "Snappy", "Zlib", "Zstandard"].get(usize::from(compressor));
        let name = name.map_or_else(|| format!("number {compressor}"), |it| it.to_string());
        return Err(format!("a Blosc container is packed by {name}, not by LZ4 as OpenVDB does"));
    }
    if flags & 4 != 0 {
        return Err("a Blosc container has its bits shuffled, which OpenVDB does not do".into());
    }
    if block_bytes == 0 {
        return Err("a Blosc container has blocks of no bytes".into());
    }
    let mut shuffled = Vec::new();
    for (k, block) in content.chunks_mut(block_bytes).enumerate() {
        let is_split = flags & 0x10 == 0
            && type_bytes <= MOST_SPLITS
            && block_bytes / type_bytes >= LEAST_STREAM
            && block.len() == block_bytes;
        let streams = if is_split { type_bytes } else { 1 };
        let is_shuffled = flags & 1 != 0 && type_bytes > 1;
        let mut at = number(HEADER + 4 * k)?;
        shuffled.resize(if is_shuffled { block.len() } else { 0 }, 0);
        let target = if is_shuffled { &mut shuffled[..] } else { &mut *block };
        if target.len() % streams != 0 {
            return Err("a block of a Blosc container cannot be split".into());
        }
        for stream in target.chunks_mut(target.len() / streams) {
            let length = number(at)?;
            let end = at.checked_add(4).and_then(|it| it.checked_add(length));
            let data = end.and_then(|end| packed.get(at + 4..end)).ok_or("a Blosc container ends early")?;
            if length == stream.len() {
                stream.copy_from_slice(data);
            } else {
                let count = lz4_flex::block::decompress_into(data, stream).map_err(|error| error.to_string());
                if count? != stream.len() {
                    return Err("a stream of a Blosc container is too short".into());
                }
            }
            at += 4 + length;
        }
        if is_shuffled {
            unshuffle(&shuffled, type_bytes, block);
        }
    }
    Ok(())
}

/// Brings the bytes of numbers together; what is left at the end is not shuffled.
fn unshuffle(shuffled: &[u8], type_bytes: usize, block: &mut [u8]) {
    let count = block.len() / type_bytes;
    for (k, number) in block.chunks_exact_mut(type_bytes).enumerate() {
        for (byte, target) in number.iter_mut().enumerate() {
            *target = shuffled[byte * count + k];
        }
    }
    let whole = count * type_bytes;
    block[whole..].copy_from_slice(&shuffled[whole..]);
}
