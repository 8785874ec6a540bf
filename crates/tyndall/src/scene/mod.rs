//! What is seen, and how.

mod amounts;
pub mod automatic;
pub mod color;
pub mod coloring;
pub mod colormap;
mod colormap_tables;
pub mod element;
mod kinds;
mod names;
pub mod quantity;
mod rgb;
mod spacing;
mod statistics;
