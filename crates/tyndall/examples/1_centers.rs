//! Writes the centers of synthetic particles to an NPY file (float32, N x 3) and prints their radius: for programs that
//! are to render the same particles.
//!
//! `cargo run --release --example 1_centers -- "packed?n=1e6&seed=1" packed.npy`

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};

use tyndall::{Radii, synthetic};

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [specification, path] = &words[..] else {
        return Err("wanted two words: a specification such as packed?n=1e6, and a file".into());
    };
    let particles = synthetic::generate(specification, &())?;
    let Some(Radii::Uniform(radius)) = particles.radii() else {
        return Err("wanted particles of one radius: packed, uniform or clustered".into());
    };
    let mut file = BufWriter::new(File::create(path)?);
    file.write_all(header(particles.len()).as_slice())?;
    for id in 0..particles.len() {
        let center = particles.positions().world(id).as_vec3();
        file.write_all(bytemuck::bytes_of(&center))?;
    }
    file.flush()?;
    println!("{radius}");
    Ok(())
}

/// What stands before the numbers in an NPY file of version 1: 128 bytes.
fn header(count: usize) -> Vec<u8> {
    let description = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({count}, 3), }}");
    [b"\x93NUMPY\x01\x00\x76\x00", format!("{description:<117}\n").as_bytes()].concat()
}
