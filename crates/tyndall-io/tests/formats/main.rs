//! Readers through the front door: own fixtures always, the shared real files where they are.
#![allow(clippy::unwrap_used, reason = "all of this is tests")]

mod convert;
mod cosmology;
mod effects;
mod molecules;
mod pieces;
mod saved;
#[cfg(feature = "parquet")]
mod tables;
mod text;
mod wanted;

use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tyndall::{DVec3, Particles};
use tyndall_io::{Frame, Options, Sequence};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

fn open(path: &Path) -> Sequence {
    Sequence::open(&[path.to_path_buf()], &Options::default(), &()).unwrap_or_else(|error| panic!("{error}"))
}

fn frame(sequence: &Sequence, frame: usize) -> Frame {
    sequence.frame(frame, &()).unwrap_or_else(|error| panic!("{}: {error}", sequence.name(frame)))
}

/// A folder that is gone when it is dropped.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("tyndall-text-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).unwrap();
    }
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn zstd(bytes: &[u8]) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)
}

/// The expected values of the shared files, if these are there.
fn shared() -> Option<(PathBuf, Value)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let Ok(text) = std::fs::read_to_string(folder.join("expected.json")) else {
        println!("skipped: no shared data at {}", folder.display());
        return None;
    };
    Some((folder, serde_json::from_str(&text).unwrap()))
}

fn vector(value: &Value) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|axis| value[axis].as_f64().unwrap()))
}

/// What must hold of one frame: `expected` has `particles`, `bounds` and maybe more.
fn check_frame(name: &str, particles: &Particles, expected: &Value) {
    assert_eq!(particles.len() as u64, expected["particles"].as_u64().unwrap(), "{name}");
    let [min, max] = ["min", "max"].map(|it| vector(&expected["bounds"][it]));
    let tolerance = 1e-5 * (max - min).max_element();
    let near = |what: &str, found: DVec3, wanted: DVec3| {
        assert!(found.abs_diff_eq(wanted, tolerance), "{name}: {what} is {found}, wanted {wanted}");
    };
    let (bounds, origin) = (particles.bounds(), particles.positions().origin());
    near("min", origin + bounds.min.as_dvec3(), min);
    near("max", origin + bounds.max.as_dvec3(), max);
    for (end, place) in [("first", 0), ("last", particles.len() - 1)] {
        let position = particles.positions().world(place);
        for key in [format!("{end}_position"), end.to_string()] {
            let value = &expected[key.as_str()];
            for wanted in [value, &value["Position"], &value["position"]] {
                if wanted.as_array().is_some_and(|it| it.len() == 3) {
                    near(end, position, vector(wanted));
                }
            }
        }
    }
    if let Some(step) = expected["timestep"].as_f64().or(expected["timestep_first_frame"].as_f64()) {
        assert_eq!(particles.time(), Some(step), "{name}");
    }
}

/// Opens a shared file, compares all its frames with what is expected, and gives it back with that; `None` if the files are not there.
fn check_shared(name: &str) -> Option<(Sequence, Value)> {
    let (folder, all) = shared()?;
    let expected = all["files"][name]["expected"].clone();
    let sequence = open(&folder.join(name));
    assert_eq!(sequence.len() as u64, expected["frames"].as_u64().unwrap(), "{name}");
    check_frame(name, &frame(&sequence, 0).particles, &expected);
    for (k, count) in expected["particles_per_frame"].as_array().into_iter().flatten().enumerate() {
        assert_eq!(frame(&sequence, k).particles.len() as u64, count.as_u64().unwrap(), "{name}: frame {k}");
    }
    if let Some(last) = expected["last_frame"].as_object() {
        let mut last = Value::from(last.clone());
        // Where it is not said, it is as in the first frame.
        if last["particles"].is_null() {
            last["particles"] = expected["particles"].clone();
        }
        check_frame(name, &frame(&sequence, sequence.len() - 1).particles, &last);
    }
    Some((sequence, expected))
}

/// Cuts a file at fifty places: each must give an error, or its whole frames with a warning that says so, never a part in silence.
/// `name` has the file's own extension.
fn check_truncated(name: &str, bytes: &[u8]) {
    let folder = Folder::new(&format!("cut-{name}"));
    let whole = open(&folder.file(name, bytes));
    let counts: Vec<usize> = (0..whole.len()).map(|k| frame(&whole, k).particles.len()).collect();
    for place in 1..=50 {
        let length = bytes.len() * place / 51;
        let path = folder.file(name, &bytes[..length]);
        let Ok(sequence) = Sequence::open(&[path], &Options::default(), &()) else { continue };
        for k in 0..sequence.len() {
            let Ok(frame) = sequence.frame(k, &()) else { continue };
            let what = format!("{name} cut to {length} of {} bytes, frame {k}", bytes.len());
            assert_eq!(frame.particles.len(), counts[k], "{what}");
            // What was cut off may be what nobody needs, but not a frame.
            let said = sequence.len() == counts.len() || !frame.warnings.is_empty();
            assert!(said, "{what}: no word about the frames that are missing");
        }
    }
}
