//! The command `tyndall`.

fn main() {}
