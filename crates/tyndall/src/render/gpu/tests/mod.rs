//! The card against the CPU: formulas, layouts, pictures. Without an adapter what needs one says so and is skipped.

mod pictures;
mod validation;
