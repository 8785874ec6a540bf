//! Particle files in, pictures out.
//!
//! [`mod@annotation`] writes titles, color bars and scale bars over pictures.
//!
//! [`Sequence::open`] recognises a file by its content and reads its frames one at a time; [`mod@write`] puts an image on disk,
//! [`mod@saved`] particles with their structure.

pub mod annotation;
mod frame_index;
mod groups;
pub mod parts;
pub mod read;
pub mod saved;
pub mod sequence;
mod topology;
pub mod vdb;
pub mod write;
mod xmp;

pub use parts::Parts;
pub use saved::Saved;
pub use sequence::{Frame, Options, Sequence};
