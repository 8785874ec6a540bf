//! Filters of HDF5 beside those that the reader has: LZF, which h5py brings, bzip2 and Zstandard.
//!
//! A chunk is unpacked to no more than the largest chunk of the file's data sets has by its extent.

use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use hdf5_reader::FilterRegistry;
use hdf5_reader::error::Error;
use hdf5_reader::filters::FilterFn;
use hdf5_reader::messages::filter_pipeline::FilterDescription;

/// Checksums and the like, which other filters put into a chunk.
const BESIDES: u64 = 1 << 12;

const BZIP2: u16 = 307;
const LZF: u16 = 32000;
const ZSTD: u16 = 32015;

/// Unpacks a chunk to at most so many bytes.
type Unpack = fn(&[u8], u64) -> Result<Vec<u8>, Error>;

/// The filters that can be undone. `chunk_bytes` is how many bytes the largest chunk of the data sets that were opened has.
pub(super) fn registry(chunk_bytes: Arc<AtomicU64>) -> FilterRegistry {
    let mut registry = FilterRegistry::new();
    let filters: [(u16, Unpack); 3] = [(BZIP2, bzip2), (LZF, lzf), (ZSTD, zstd)];
    for (id, unpack) in filters {
        let chunk_bytes = Arc::clone(&chunk_bytes);
        let filter: FilterFn = Box::new(move |_: &FilterDescription, data, _| {
            unpack(data, chunk_bytes.load(Relaxed).saturating_add(BESIDES))
        });
        registry.register(id, filter);
    }
    registry
}

/// Whether it is one of those that are undone here.
pub(super) fn is_ours(id: u16) -> bool {
    [BZIP2, LZF, ZSTD].contains(&id)
}

/// What a filter that cannot be undone is called, by its number in The HDF Group's register.
pub(super) fn name(id: &str) -> Option<&'static str> {
    Some(match id {
        "32001" => "Blosc",
        "32008" => "Bitshuffle",
        "32013" => "ZFP",
        "32017" | "32024" => "SZ",
        "32026" => "Blosc2",
        _ => return None,
    })
}

fn failed(error: impl std::fmt::Display) -> Error {
    Error::DecompressionError(error.to_string())
}

fn all(stream: impl Read, most: u64) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    stream.take(most.saturating_add(1)).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > most {
        return Err(failed(format!("a chunk is larger than the {most} bytes that its extent has")));
    }
    Ok(bytes)
}

fn bzip2(data: &[u8], most: u64) -> Result<Vec<u8>, Error> {
    all(::bzip2::read::BzDecoder::new(data), most)
}

fn zstd(data: &[u8], most: u64) -> Result<Vec<u8>, Error> {
    all(ruzstd::decoding::StreamingDecoder::new(data).map_err(failed)?, most)
}

fn lzf(data: &[u8], most: u64) -> Result<Vec<u8>, Error> {
    crate::read::lzf::unpack(data, usize::try_from(most).unwrap_or(usize::MAX)).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chunk_is_not_unpacked_beyond_its_extent() {
        let zeros = vec![0; 1 << 20];
        let packed =
            ruzstd::encoding::compress_to_vec(&zeros[..], ruzstd::encoding::CompressionLevel::Fastest);
        assert_eq!(zstd(&packed, 1 << 20).unwrap(), zeros);
        let error = zstd(&packed, (1 << 20) - 1).unwrap_err().to_string();
        assert!(error.contains("larger than"), "{error}");
        let mut encoder = ::bzip2::write::BzEncoder::new(Vec::new(), ::bzip2::Compression::fast());
        std::io::Write::write_all(&mut encoder, &zeros).unwrap();
        let packed = encoder.finish().unwrap();
        assert!(bzip2(&packed, 1 << 20).is_ok() && bzip2(&packed, 1 << 10).is_err());
    }
}
