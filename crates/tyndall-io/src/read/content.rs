//! The content of a file that has an owner: for readers that keep what they read from, and for files beside the one that was opened.

use std::path::Path;

use tyndall::Result;

use super::map::Map;
use super::{Packing, map, unpack, unpacked};

/// The content of a file.
pub(crate) enum Content {
    /// As it is on disk.
    Mapped(Map),
    /// Unpacked.
    Unpacked(Vec<u8>),
}

impl AsRef<[u8]> for Content {
    fn as_ref(&self) -> &[u8] {
        match self {
            Self::Mapped(map) => map,
            Self::Unpacked(bytes) => bytes,
        }
    }
}

impl Content {
    /// The map, if it is one.
    pub(crate) fn map(&self) -> Option<&Map> {
        match self {
            Self::Mapped(map) => Some(map),
            Self::Unpacked(_) => None,
        }
    }
}

/// The content of a file, which may be compressed.
pub(crate) fn content(path: &Path) -> Result<Content> {
    let mapped = map(path)?;
    match Packing::of(&mapped[..mapped.len().min(unpack::MAGIC_BYTES)]) {
        Packing::Plain => Ok(Content::Mapped(mapped)),
        packing => Ok(Content::Unpacked(unpacked(path, packing, &())?)),
    }
}

/// The content `bytes` of `path` once more: mapped anew, or copied if the file is compressed.
pub(crate) fn kept(path: &Path, bytes: &[u8]) -> Content {
    let head = |bytes: &[u8]| bytes[..bytes.len().min(512)].to_vec();
    let mapped = map(path).ok().filter(|map| map.len() == bytes.len() && head(map) == head(bytes));
    mapped.map_or_else(|| Content::Unpacked(bytes.to_vec()), Content::Mapped)
}
