//! Filters of HDF5 beside those that the reader has: LZF, which h5py brings, bzip2 and Zstandard.

use std::io::Read;

use hdf5_reader::FilterRegistry;
use hdf5_reader::error::Error;
use hdf5_reader::filters::FilterFn;
use hdf5_reader::messages::filter_pipeline::FilterDescription;

/// No chunk is larger: HDF5 counts its bytes in 32 bits.
const MOST_BYTES: u64 = u32::MAX as u64;

const BZIP2: u16 = 307;
const LZF: u16 = 32000;
const ZSTD: u16 = 32015;

/// The filters that can be undone.
pub(super) fn registry() -> FilterRegistry {
    let mut registry = FilterRegistry::new();
    let filters: [(u16, FilterFn); 3] =
        [(BZIP2, Box::new(bzip2)), (LZF, Box::new(lzf)), (ZSTD, Box::new(zstd))];
    for (id, filter) in filters {
        registry.register(id, filter);
    }
    registry
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

fn all(stream: impl Read) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    stream.take(MOST_BYTES).read_to_end(&mut bytes).map_err(failed)?;
    Ok(bytes)
}

fn bzip2(_: &FilterDescription, data: &[u8], _: usize) -> Result<Vec<u8>, Error> {
    all(::bzip2::read::BzDecoder::new(data))
}

fn zstd(_: &FilterDescription, data: &[u8], _: usize) -> Result<Vec<u8>, Error> {
    all(ruzstd::decoding::StreamingDecoder::new(data).map_err(failed)?)
}

fn lzf(_: &FilterDescription, data: &[u8], _: usize) -> Result<Vec<u8>, Error> {
    crate::read::lzf::unpack(data, MOST_BYTES as usize).map_err(failed)
}
