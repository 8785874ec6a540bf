//! What a participating medium is: particles become a density on a grid.

mod cells;
pub mod density;
pub mod grid;
pub mod kernel;

pub use grid::Grid;
pub use kernel::Kernel;
