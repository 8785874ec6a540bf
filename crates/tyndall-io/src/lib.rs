//! Particle files in, pictures out.
//!
//! [`Sequence::open`] recognises a file by its content and reads its frames one at a time; [`mod@write`] puts an image on disk.

pub mod parts;
pub mod read;
pub mod sequence;
mod topology;
pub mod write;

pub use parts::Parts;
pub use sequence::{Frame, Options, Sequence};
