//! Particles to files: the extension says which format, and a file appears whole or not at all.
//!
//! A format is a file here and a line in `FORMATS`. What a format cannot hold is said, not dropped in silence.

#[cfg(feature = "parquet")]
mod arrow;
mod bgeo;
mod gltf;
mod lammps;
mod mmpld;
mod npy;
mod ply;
mod prt;
mod rows;
mod snapshot;
mod table;
mod text;
mod usda;
mod vtp;
mod xyz;

use std::array::from_fn;
use std::io::{self, Seek, Write};
use std::path::Path;

use tyndall::{Error, Particles, Result};

pub(super) use self::npy::header as npy_header;
use self::snapshot::Snapshot;
use super::atomically;

/// What is written to: formats with an index come back to their header.
trait Out: Write + Seek + Send {}
impl<T: Write + Seek + Send> Out for T {}

/// Which of how many frames of a file is written, and what is to be said of it.
struct Place<'a> {
    frame: usize,
    count: usize,
    /// The least and the greatest coordinates of all frames so far.
    bounds: &'a [[f64; 3]; 2],
    notes: &'a mut Vec<String>,
}

impl Place<'_> {
    /// Says something once a file.
    fn note(&mut self, text: impl Into<String>) {
        let text = text.into();
        if !self.notes.contains(&text) {
            self.notes.push(text);
        }
    }
}

/// A format that can be written.
struct Format {
    /// Extensions of its files, without the dot.
    extensions: &'static [&'static str],
    /// Whether a file holds several frames.
    has_frames: bool,
    /// Appends a frame to a file, which begins with the first one.
    write: fn(&mut dyn Out, &Snapshot, &mut Place) -> io::Result<()>,
}

const FORMATS: &[Format] = &[
    Format { extensions: &["xyz", "extxyz"], has_frames: true, write: xyz::write },
    Format { extensions: &["dump", "lammpstrj"], has_frames: true, write: lammps::write },
    Format { extensions: &["csv"], has_frames: false, write: table::write_csv },
    Format { extensions: &["tsv"], has_frames: false, write: table::write_tsv },
    Format { extensions: &["ply"], has_frames: false, write: ply::write },
    Format { extensions: &["npy"], has_frames: false, write: npy::write_array },
    Format { extensions: &["npz"], has_frames: false, write: npy::write_archive },
    #[cfg(feature = "parquet")]
    Format { extensions: &["parquet"], has_frames: false, write: arrow::write_parquet },
    #[cfg(feature = "parquet")]
    Format { extensions: &["arrow", "feather"], has_frames: false, write: arrow::write_ipc },
    Format { extensions: &["vtp"], has_frames: false, write: vtp::write },
    Format { extensions: &["mmpld"], has_frames: true, write: mmpld::write },
    Format { extensions: &["prt"], has_frames: false, write: prt::write },
    Format { extensions: &["bgeo", "bhclassic"], has_frames: false, write: bgeo::write },
    Format { extensions: &["usda"], has_frames: false, write: usda::write },
    Format { extensions: &["glb"], has_frames: false, write: gltf::write },
];

/// The format of a file by its extension.
fn format(path: &Path) -> Result<&'static Format> {
    let extension = path.extension().and_then(|it| it.to_str()).unwrap_or_default().to_ascii_lowercase();
    FORMATS.iter().find(|it| it.extensions.contains(&extension.as_str())).ok_or_else(|| {
        let known: Vec<String> = FORMATS.iter().map(|it| format!(".{}", it.extensions[0])).collect();
        let missing = match extension.as_str() {
            "parquet" | "arrow" | "feather" => "; a build with the feature parquet also has .parquet .arrow",
            _ => "",
        };
        Error::setting(
            "-o",
            path.display(),
            format!(
                "the extension says what to write; known: {}{missing}, and .vdb for a density",
                known.join(" ")
            ),
        )
    })
}

/// Whether a file of this name holds several frames. Fails with [`Error::Setting`] if its extension is not known.
pub fn holds_frames(path: &Path) -> Result<bool> {
    Ok(format(path)?.has_frames)
}

/// Writes `count` frames, which `frame` gives in order, into one file: of a format that holds no more than one, one. `fields`
/// are the names of the attributes that are written, all if there are none. Replaces the file that is there. Gives what the format could not hold,
/// one line each.
///
/// Fails with [`Error::Setting`] on an unknown extension, on more frames than the format holds, and on a field that a frame has
/// not; with [`Error::Io`] if the system refuses; and as `frame` does.
pub fn particles(
    path: &Path,
    fields: Option<&[String]>,
    count: usize,
    mut frame: impl FnMut(usize) -> Result<Particles>,
) -> Result<Vec<String>> {
    let format = format(path)?;
    if count > 1 && !format.has_frames {
        let allowed = format!(
            "a file of this format holds one frame, not {count}: give a number in its name, such as NAME.%04d.EXT"
        );
        return Err(Error::setting("-o", path.display(), allowed));
    }
    let mut notes = Vec::new();
    let mut bounds: Option<[[f64; 3]; 2]> = None;
    let mut failed = None;
    let written = atomically(path, |out| {
        for k in 0..count {
            let whole = frame(k).and_then(|particles| {
                let snapshot = Snapshot::new(&particles, fields)?;
                let left_out = "bonds are left out: no format that is written has them".to_string();
                if !particles.bonds().is_empty() && !notes.contains(&left_out) {
                    notes.push(left_out);
                }
                if let Some([low, high]) = particles.world_bounds() {
                    let [least, greatest] = bounds.unwrap_or([low, high]);
                    bounds = Some([
                        from_fn(|axis| least[axis].min(low[axis])),
                        from_fn(|axis| greatest[axis].max(high[axis])),
                    ]);
                }
                let bounds = bounds.unwrap_or_default();
                let mut place = Place { frame: k, count, bounds: &bounds, notes: &mut notes };
                (format.write)(out, &snapshot, &mut place).map_err(|error| Error::io(path, error))
            });
            if let Err(error) = whole {
                failed = Some(error);
                // Its own error is told; this one only ends the writing.
                return Err(io::Error::other("a frame failed"));
            }
        }
        Ok(())
    });
    match failed {
        Some(error) => Err(error),
        None => written.map(|()| notes),
    }
}
