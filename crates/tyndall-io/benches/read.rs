//! How fast files are read that lie in the system's cache: a generated file for each hot path, in MB/s of the file.
//!
//! One thread: `RAYON_NUM_THREADS=1 cargo bench -p tyndall-io --bench read`. The files have `TYNDALL_BENCH_ROWS` rows (default
//! 4,000,000, of text 200 to 260 MB) and lie in the temporary folder while the benchmark runs.
#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run should stop")]

use std::io::{BufWriter, Write};
use std::path::PathBuf;

use divan::Bencher;
use divan::counter::BytesCount;
use tyndall::scene::wanted::Wanted;
use tyndall_io::{Options, Sequence, write};

fn main() {
    divan::main();
}

/// A file that is gone when it is dropped.
struct Generated(PathBuf);

impl Drop for Generated {
    fn drop(&mut self) {
        // Nothing can be done about a file that stays in the temporary folder.
        let _ = std::fs::remove_file(&self.0);
    }
}

fn rows() -> u64 {
    std::env::var("TYNDALL_BENCH_ROWS").ok().and_then(|it| it.parse().ok()).unwrap_or(4_000_000)
}

/// Writes `header` and rows made of a random walk, as a simulation would print them.
fn generated(name: &str, header: &str, row: impl Fn(u64, [f64; 6]) -> String) -> Generated {
    let path = std::env::temp_dir().join(format!("tyndall-bench-{}-{name}", std::process::id()));
    let mut file = BufWriter::new(std::fs::File::create(&path).unwrap());
    file.write_all(header.as_bytes()).unwrap();
    let mut state = 1u64;
    for k in 0..rows() {
        let values = std::array::from_fn(|_| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 * 1e-5
        });
        file.write_all(row(k, values).as_bytes()).unwrap();
    }
    file.flush().unwrap();
    Generated(path)
}

/// Writes particles in the format of an extension.
fn converted(extension: &str) -> Generated {
    let path = std::env::temp_dir().join(format!("tyndall-bench-{}.{extension}", std::process::id()));
    let source = format!("synthetic:fluid?n={}", rows());
    let sequence = Sequence::open(&[source.into()], &Options::default(), &()).unwrap();
    write::particles::particles(&path, None, 1, |frame| Ok(sequence.frame(frame, &())?.particles)).unwrap();
    Generated(path)
}

fn read(bencher: Bencher, file: &Generated) {
    read_with(bencher, file, &Options::default());
}

fn read_with(bencher: Bencher, file: &Generated, options: &Options) {
    let bytes = std::fs::metadata(&file.0).unwrap().len();
    bencher.counter(BytesCount::new(bytes)).bench(|| {
        let sequence = Sequence::open(std::slice::from_ref(&file.0), options, &()).unwrap();
        sequence.frame(0, &()).unwrap()
    });
}

/// Formats of columns or rows of numbers.
#[divan::bench(args = ["npy", "ply", "mmpld", "bgeo", "prt", "vtp"], sample_count = 5, sample_size = 1)]
fn binary(bencher: Bencher, extension: &str) {
    read(bencher, &converted(extension));
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn lammps(bencher: Bencher) {
    read(bencher, &dump());
}

/// What a picture in one color looks at.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn lammps_positions(bencher: Bencher) {
    let wanted = Wanted { coloring: "#fff".parse().unwrap(), ..Wanted::default() };
    read_with(bencher, &dump(), &Options { wanted: Some(wanted), ..Options::default() });
}

fn dump() -> Generated {
    let header = format!(
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{}\nITEM: BOX BOUNDS pp pp pp\n0 200\n0 200\n0 200\nITEM: ATOMS id type x y z vx vy vz\n",
        rows()
    );
    let row = |k: u64, [x, y, z, u, v, w]: [f64; 6]| {
        format!("{} {} {x:.4} {y:.4} {z:.4} {u:.5} -{v:.5} {w:.5}\n", k + 1, k % 3 + 1)
    };
    generated("a.dump", &header, row)
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn csv(bencher: Bencher) {
    let row = |_, [x, y, z, u, v, w]: [f64; 6]| format!("{x:.6},{y:.6},{z:.6},{u:.6},-{v:.6},{w:.6}\n");
    read(bencher, &generated("a.csv", "x,y,z,vx,vy,vz\n", row));
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn xyz(bencher: Bencher) {
    let header = format!("{}\nProperties=species:S:1:pos:R:3:force:R:3\n", rows());
    let row = |k: u64, [x, y, z, u, v, w]: [f64; 6]| {
        let element = ["H", "O", "Cu"][(k % 3) as usize];
        format!("{element} {x:.8} {y:.8} {z:.8} {u:.6} -{v:.6} {w:.6}\n")
    };
    read(bencher, &generated("a.xyz", &header, row));
}
