//! What a participating medium is: particles become a density on a grid.

pub mod grid;

pub use grid::Grid;
