//! Light in a medium, on the CPU.

mod field;
mod harmonics;
mod sweep;
