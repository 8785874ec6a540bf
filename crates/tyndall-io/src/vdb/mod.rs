//! OpenVDB's files (`.vdb`): sparse grids of voxels, read as a density or as they are, and written.
//!
//! Versions 218 to 224 are read: grids of floats, doubles (rounded to 32 bits) and vectors of floats, also as 16-bit floats; plain, zipped,
//! or packed by Blosc with LZ4; with or without their inactive values; instances. Written is version 224, zipped. Other grids are
//! listed ([`grids`]) and passed over. The file's identifier follows from its content, so that the same grids make the same bytes.
//!
//! A voxel's value belongs to its middle, which lies where its whole coordinates are transformed to. Source: OpenVDB's own reader
//! and writer, openvdb/io/Archive.cc; the parts name theirs.

mod as_density;
mod blosc;
mod file;
mod read;
#[cfg(test)]
mod tests;
mod transform;
mod tree;
mod values;
mod volume;
mod write;

use std::path::Path;

use tyndall::{Error, Progress, Result};

use self::file::{File, Header, Kind};
use crate::read::{self as readers, Described, Packing, absent};
pub use file::Class;
pub(crate) use file::recognise;
pub use transform::Transform;
pub use tree::{LEAF, LEAF_VOXELS, Leaf, Tile, Tree, Value, place_in_leaf};
pub use volume::{DENSITY, density, of_volume};
pub use write::{Precision, write};

/// A grid with its voxels.
#[derive(Clone, Debug)]
pub struct Grid {
    /// What it is called.
    pub name: String,
    /// What its values mean.
    pub class: Class,
    /// Where its voxels lie.
    pub transform: Transform,
    /// Its voxels.
    pub tree: Tree,
}

/// What a file says of a grid.
#[derive(Clone, Debug)]
pub struct About {
    /// What it is called; where several are called alike, with a number in brackets.
    pub name: String,
    /// The type of its values, as OpenVDB calls it.
    pub kind: String,
    /// Whether its numbers are 16-bit floats.
    pub is_half: bool,
    /// What its values mean.
    pub class: Class,
    /// Where its voxels lie; else what is said of that.
    pub transform: std::result::Result<Transform, String>,
    /// How many voxels are active, where that is said.
    pub voxel_count: Option<i64>,
    /// The least and the greatest coordinates of these, where that is said.
    pub voxel_box: Option<[[i32; 3]; 2]>,
}

/// Whether a file is one of OpenVDB's, packed or not.
pub fn is_vdb(path: &Path) -> Result<bool> {
    Ok(recognise(&readers::head(path)?.0))
}

/// The version of a file, and what it says of its grids.
///
/// Fails with [`Error::Format`] if it is damaged or not one of OpenVDB's.
pub fn grids(path: &Path, progress: &dyn Progress) -> Result<(u32, Vec<About>)> {
    with_bytes(path, progress, |bytes| {
        let file = File::open(path, bytes)?;
        let about = |header: Header| About {
            kind: header.kind.name().to_string(),
            name: header.name,
            is_half: header.is_half,
            class: header.class,
            transform: header.transform,
            voxel_count: header.voxel_count,
            voxel_box: match header.voxel_box {
                [Some(low), Some(high)] => Some([low, high]),
                _ => None,
            },
        };
        Ok((file.version, file.grids.into_iter().map(about).collect()))
    })
}

/// Reads the grids that are named, all that can be read if none are; says what was passed over.
///
/// Fails with [`Error::Setting`] if there is none of a name, and with [`Error::Format`] if the file is damaged, or a grid that is named
/// cannot be read.
pub fn read(
    path: &Path,
    names: Option<&[String]>,
    progress: &dyn Progress,
) -> Result<(Vec<Grid>, Vec<String>)> {
    with_bytes(path, progress, |bytes| {
        let file = File::open(path, bytes)?;
        let mut notes = Vec::new();
        let headers: Vec<&Header> = match names {
            Some(names) => names.iter().map(|name| named(&file, &[name])).collect::<Result<_>>()?,
            None => {
                let (read, others): (Vec<&Header>, Vec<&Header>) =
                    file.grids.iter().partition(|it| it.kind.value().is_some() && it.transform.is_ok());
                notes.extend(
                    others.iter().map(|it| format!("grid '{}' ({}) is left out", it.name, it.kind.name())),
                );
                if read.is_empty() {
                    return Err(nothing_to_read(&file));
                }
                read
            }
        };
        let grid = |header: &&Header| {
            Ok(Grid {
                name: header.name.clone(),
                class: header.class,
                transform: transform_of(&file, header)?,
                tree: read::tree(&file, header, progress)?,
            })
        };
        Ok((headers.iter().map(grid).collect::<Result<_>>()?, notes))
    })
}

/// Reads a scalar grid as a density: the first of `names` that is there; without names `density`, else the first. `scale` is the density of a value of 1.
pub(crate) fn described(
    path: &Path,
    names: &[&str],
    scale: f64,
    progress: &dyn Progress,
) -> Result<Described> {
    with_bytes(path, progress, |bytes| {
        let file = File::open(path, bytes)?;
        let mut scalars = file.grids.iter().filter(|it| it.kind.value().is_some_and(|it| it.0 == 1));
        let header = match names {
            [_, ..] => named(&file, names)?,
            [] => scalars
                .clone()
                .find(|it| it.name.eq_ignore_ascii_case("density"))
                .or_else(|| scalars.next())
                .ok_or_else(|| nothing_to_read(&file))?,
        };
        if header.kind.value().is_some_and(|(components, _)| components > 1) {
            let what = format!("grid '{}' is of vectors, which are no density", header.name);
            return Err(Error::format(
                path,
                "",
                what,
                format!("name another; the file has: {}", list(&file)),
            ));
        }
        let transform = transform_of(&file, header)?;
        let mut conventions = vec![format!("density: grid '{}' of {}", header.name, list(&file))];
        if header.kind == Kind::Double {
            conventions.push("double precision is rounded to 32 bits".into());
        }
        let tree = read::tree(&file, header, progress)?;
        let grid = as_density::grid(path, (&tree, &transform, header.class), scale, &mut conventions)?;
        Ok(Described { grid, name: header.name.clone(), conventions })
    })
}

/// Why there are no particles in a file.
pub(crate) fn no_particles(path: &Path) -> Error {
    let has_points = |bytes: &[u8]| {
        let file = File::open(path, bytes)?;
        Ok(file.grids.iter().any(|it| it.kind == Kind::Points).then(|| nothing_to_read(&file)))
    };
    match with_bytes(path, &(), has_points) {
        Ok(points) => points.unwrap_or_else(|| readers::no_particles(path, "OpenVDB")),
        Err(error) => error,
    }
}

/// The content of a file, mapped or unpacked.
fn with_bytes<T>(path: &Path, progress: &dyn Progress, act: impl FnOnce(&[u8]) -> Result<T>) -> Result<T> {
    let (head, packing) = readers::head(path)?;
    if !recognise(&head) {
        return Err(Error::format(path, "", "this is not a file of OpenVDB", "its first bytes are ' BDV'"));
    }
    match packing {
        Packing::Plain => act(&readers::map(path)?),
        _ => act(&readers::unpacked(path, packing, progress)?),
    }
}

/// The grids' names and types.
fn list(file: &File) -> String {
    let names = file.grids.iter().map(|it| format!("{} ({})", it.name, it.kind.name()));
    names.collect::<Vec<_>>().join(", ")
}

/// The grid of the first of `names` that one has, exactly or but for capitals.
fn named<'a>(file: &'a File, names: &[&str]) -> Result<&'a Header> {
    let named = |name: &&str| {
        let exactly = file.grids.iter().find(|it| it.name == *name);
        exactly.or_else(|| file.grids.iter().find(|it| it.name.eq_ignore_ascii_case(name)))
    };
    let found = names.iter().find_map(named);
    found.ok_or_else(|| absent(names, &format!("the file has: {}", list(file))))
}

fn transform_of(file: &File, header: &Header) -> Result<Transform> {
    header.transform.clone().map_err(|what| {
        let what = format!("grid '{}' is {what}, voxels along the axes are wanted", header.name);
        Error::format(file.path, "", what, "resample it to a grid along the axes before it is saved")
    })
}

fn nothing_to_read(file: &File) -> Error {
    let fault = |what: String, hint: &str| Error::format(file.path, "", what, hint);
    if file.grids.iter().any(|it| it.kind == Kind::Points) {
        let hint = "save them as PLY, or as classic .bgeo: in Houdini by Convert VDB Points, then File";
        return fault(format!("the file holds points, not voxels: {}", list(file)), hint);
    }
    match file.grids[..] {
        [] => fault("the file has no grids".into(), "was it written to its end?"),
        _ => fault(format!("none of its grids is a density: {}", list(file)), "save one as a grid of floats"),
    }
}
