//! Reads all frames of files, as one sequence, and says how fast: frames, particles of the last one, seconds to open, seconds to read,
//! MB/s of the files, and the most memory that the process had, in MB, where the system tells.
//!
//!     cargo run --release -p tyndall-io --example 1_frames -- topol.gro traj.xtc

use std::path::PathBuf;
use std::time::Instant;

use tyndall_io::{Options, Sequence};

fn main() -> tyndall::Result<()> {
    let paths: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let bytes: u64 = paths.iter().filter_map(|path| std::fs::metadata(path).ok()).map(|it| it.len()).sum();
    let start = Instant::now();
    let sequence = Sequence::open(&paths, &Options::default(), &())?;
    let opened = start.elapsed().as_secs_f64();
    let mut particles = 0;
    for frame in 0..sequence.len() {
        particles = sequence.frame(frame, &())?.particles.len();
    }
    let secs = start.elapsed().as_secs_f64();
    println!(
        "{} frames  {particles} particles  open {opened:.4} s  read {:.4} s  {:.0} MB/s  {} MB",
        sequence.len(),
        secs - opened,
        bytes as f64 / secs / 1e6,
        peak_bytes().map_or("?".into(), |bytes| (bytes / 1_000_000).to_string())
    );
    Ok(())
}

/// The most memory that this process had at one time: files that are mapped count.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
}
