//! The readers, one file a format, behind one recognition by content.

pub(crate) mod bgeo;
pub(crate) mod npy;
pub(crate) mod numbers;
pub(crate) mod ply;
pub(crate) mod records;

#[cfg(test)]
pub(crate) mod real_data;

/// A reader: the format's name, whether content begins like it, and how it is read.
type Reader = (
    &'static str,
    fn(&[u8]) -> bool,
    fn(&std::path::Path, &[u8], &dyn tyndall::Progress) -> tyndall::Result<crate::Frame>,
);

/// The readers of binary tables.
#[doc(hidden)]
pub const BINARY: [Reader; 3] = [
    ("BGEO (classic)", bgeo::recognise, bgeo::read),
    ("NumPy", npy::recognise, npy::read),
    ("PLY", ply::recognise, ply::read),
];
