//! What a participating medium is: particles become a density on a grid.

pub mod grid;
pub mod noise;

pub use grid::Grid;
pub use noise::{Noise, NoiseSettings};
