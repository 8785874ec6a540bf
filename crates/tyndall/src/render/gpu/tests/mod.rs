//! What the shaders are made of: valid kernels, records, formulas. Whole pictures stand in `crate::tests::twins`.

mod confidence;
mod formulas;
mod updates;
mod validation;
