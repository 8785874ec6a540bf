//! The readers, one file a format, behind one recognition by content.
//!
//! A file's first bytes, unpacked if it is compressed, decide its format; its name only breaks ties between tables. Text
//! formats read a `Feed` frame by frame; the others take the whole content at once.

mod amber;
#[cfg(feature = "parquet")]
pub(crate) mod arrow;
mod assembly;
mod atom_site;
mod bcif;
mod bgeo;
mod cfg;
mod cif;
mod column;
mod connections;
mod content;
pub(crate) mod cursor;
mod dcd;
mod decimal;
mod density;
mod e57;
mod feed;
mod gadget;
mod geo;
mod gro;
mod gsd;
mod guard;
#[cfg(feature = "hdf5")]
mod hdf5;
mod imd;
mod imd_binary;
mod lammps;
mod lammps_binary;
mod lammps_data;
mod las;
mod lattice;
mod lines;
mod lzf;
mod map;
mod mesh;
mod message;
mod mmpld;
mod mmtf;
mod molecules;
mod netcdf;
pub(crate) mod npy;
pub(crate) mod numbers;
mod pcd;
mod pda;
mod pdb;
mod picture;
mod ply;
mod poscar;
mod pqr;
mod prt;
mod ptc;
mod pts;
mod ptx;
#[cfg(test)]
pub(crate) mod real_data;
mod records;
mod rows;
mod sections;
mod sky;
mod snapshot;
mod table;
mod tipsy;
mod trr;
mod unpack;
mod unreadable;
mod usda;
mod vtk;
mod xtc;
mod xyz;

use std::io::Read;
use std::path::{Path, PathBuf};

use tyndall::scene::wanted::Wanted;
use tyndall::{Columns, Error, Particles, Progress, Result};

use crate::saved;
use crate::sequence::{Frame, Options};
use crate::topology::Topology;
use crate::vdb;
pub use density::{RawGrid, Sample, density};
pub(crate) use feed::Feed;
pub(crate) use lattice::no_particles;
pub use lattice::{Described, absent, described_density, is_absent};
pub(crate) use map::{map, map_in_pieces, open};
pub use mesh::mesh;
pub use picture::picture_texts;
pub(crate) use rows::open_end;
pub use sky::sky;
pub(crate) use unpack::Packing;
pub use usda::camera::{TimeCode, UsdCamera, usd_cameras};

/// How much of a file decides its format.
const HEAD: u64 = 64 << 10;
/// How much is unpacked between two looks at the progress.
const UNPACK_STEP: usize = 4 << 20;

/// A format that can be read.
pub(crate) struct Format {
    /// Its name in [`Options::format`], and other words for it.
    pub(crate) names: &'static [&'static str],
    /// Its name, as printed to people.
    pub(crate) title: &'static str,
    /// Whether a file that begins with `head` has this format. `path` only breaks ties.
    pub(crate) recognise: fn(head: &[u8], path: &Path) -> bool,
    /// What it has that others do not have.
    pub(crate) features: &'static [Feature],
    /// How it is read.
    pub(crate) open: Open,
}

/// What only some formats have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Feature {
    /// Types of particles, of which [`Options::types`] chooses some.
    Types,
    /// Biological assemblies, which [`Options::assembly`] names.
    Assemblies,
    /// Data sets, of which [`Options::dataset`] names that of the positions.
    Datasets,
    /// Where particles are, but not what they are.
    CoordinatesOnly,
    /// A structure over the particles.
    Structure,
    /// Arrays of positions that can be read in parts.
    Parts,
    /// Frames that may be spread over files, the others of which are [`Request::others`].
    Pieces,
}

impl Format {
    pub(crate) fn has(&self, feature: Feature) -> bool {
        self.features.contains(&feature)
    }
}

impl Feature {
    /// The formats that have it, for messages.
    pub(crate) fn formats(self) -> String {
        let titles: Vec<&str> = FORMATS.iter().filter(|it| it.has(self)).map(|it| it.title).collect();
        match titles.split_last() {
            Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
            _ => titles.concat(),
        }
    }
}

/// Reads the frame at `span` of content that lies in memory as a whole.
type ReadFrame =
    fn(path: &Path, bytes: &[u8], span: Span, request: &Request, progress: &dyn Progress) -> Result<Frame>;

/// Reads content that lies in memory as a whole: the attributes that are wanted, all if nothing is said.
type ReadWhole =
    fn(path: &Path, bytes: &[u8], wanted: Option<&Wanted>, progress: &dyn Progress) -> Result<Frame>;

/// How a format is read.
pub(crate) enum Open {
    /// The whole content at once, one frame.
    Whole(ReadWhole),
    /// The whole content lies in memory, mapped or unpacked, and has frames.
    Binary {
        /// Finds the frames.
        index: fn(path: &Path, bytes: &[u8], options: &Options) -> Result<Index>,
        /// Reads the frame at `span`.
        frame: ReadFrame,
    },
    /// Text, frame by frame.
    Text {
        /// Finds the frames.
        index: fn(feed: &mut Feed) -> Result<Index>,
        /// Reads the frame at which `feed` stands.
        frame: fn(feed: &mut Feed, request: &Request, progress: &dyn Progress) -> Result<Frame>,
    },
}

/// The frames of a file.
#[derive(Debug, Default)]
pub(crate) struct Index {
    /// Where the whole frames are.
    pub(crate) frames: Vec<Span>,
    /// Whether one more begins that is not whole.
    pub(crate) cut: bool,
    /// Why nobody can tell whether the last one is whole.
    pub(crate) doubt: Option<String>,
    /// What the first frame says for all: the unit system.
    pub(crate) units: Option<String>,
    /// What the format is called in this file, where that says more than [`Format::title`].
    pub(crate) title: Option<String>,
    /// All files that are one with this one, where a frame is spread over several.
    pub(crate) files: Vec<PathBuf>,
}

/// Where a frame is in the unpacked content.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    /// Its first byte.
    pub(crate) offset: u64,
    /// The number of its first line, counted from 1; of a binary file, that of the frame.
    pub(crate) line: u64,
    /// Its size, where it is known.
    pub(crate) bytes: Option<u64>,
}

/// What a format's reader is told besides the content.
pub(crate) struct Request<'a> {
    /// What the caller knows better.
    pub(crate) options: &'a Options,
    /// The frame's size, where it is known.
    pub(crate) bytes: Option<u64>,
    /// [`Index::units`].
    pub(crate) units: Option<&'a str>,
    /// Where the particles' names are, if their own format has coordinates only.
    pub(crate) topology: Option<&'a Topology>,
    /// The other files over which the frame is spread, where it is.
    pub(crate) others: &'a dyn Others,
}

/// Reads a piece of a frame, at which the feed stands.
pub(crate) type TakePiece<'a> = dyn FnMut(&mut Feed, &Request, &dyn Progress) -> Result<()> + 'a;

/// The files behind the first one over which a frame is spread, in order.
pub(crate) trait Others {
    /// Each file, and where the frame's piece is in it.
    fn places(&self) -> Vec<(&Path, Span)>;

    /// Lets `take` read the piece of each, which is text.
    fn texts(&self, take: &mut TakePiece, progress: &dyn Progress) -> Result<()>;
}

/// None: the frame lies in one file.
impl Others for () {
    fn places(&self) -> Vec<(&Path, Span)> {
        Vec::new()
    }

    fn texts(&self, _: &mut TakePiece, _: &dyn Progress) -> Result<()> {
        Ok(())
    }
}

impl Request<'_> {
    /// The size of the frame in all its files, where it is known.
    fn bytes_of_all(&self) -> Option<u64> {
        let others: Option<u64> = self.others.places().iter().map(|(_, span)| span.bytes).sum();
        Some(self.bytes? + others?)
    }

    /// Gives the particles of a frame the attributes that another file has for them; says so.
    fn complete(
        &self,
        columns: &mut Columns,
        path: &Path,
        span: Span,
        conventions: &mut Vec<String>,
    ) -> Result<()> {
        if let Some(topology) = self.topology {
            conventions.push(topology.complete(columns, path, span.line - 1)?);
        }
        Ok(())
    }
}

/// All formats, the surest to recognise first.
pub(crate) const FORMATS: &[Format] = &[
    Format {
        names: &["tyn"],
        title: "Tyndall",
        recognise: |head, _| saved::recognise(head),
        features: &[Feature::Structure],
        open: Open::Whole(saved::read),
    },
    Format {
        names: &["lammps", "dump", "lammpstrj"],
        title: "LAMMPS dump",
        recognise: |head, _| lammps::recognise(head),
        features: &[Feature::Pieces],
        open: Open::Text { index: lammps::index, frame: lammps::frame },
    },
    Format {
        names: &["lammps-binary"],
        title: "LAMMPS binary dump",
        recognise: |head, _| lammps_binary::recognise(head),
        features: &[Feature::Pieces],
        open: Open::Binary { index: lammps_binary::index, frame: lammps_binary::frame },
    },
    Format {
        names: &["lammps-data"],
        title: "LAMMPS data",
        recognise: |head, _| lammps_data::recognise(head),
        features: &[],
        open: Open::Text { index: lammps_data::index, frame: lammps_data::frame },
    },
    Format {
        names: &["poscar", "vasp", "contcar", "xdatcar"],
        title: "VASP POSCAR",
        recognise: |head, _| poscar::recognise(head),
        features: &[],
        open: Open::Binary { index: poscar::index, frame: poscar::frame },
    },
    Format {
        names: &["cfg", "atomeye"],
        title: "AtomEye CFG",
        recognise: |head, _| cfg::recognise(head),
        features: &[],
        open: Open::Binary { index: cfg::index, frame: cfg::frame },
    },
    Format {
        names: &["imd"],
        title: "IMD",
        recognise: |head, _| imd::recognise(head),
        features: &[],
        open: Open::Text { index: imd::index, frame: imd::frame },
    },
    Format {
        names: &["imd-binary"],
        title: "IMD (binary)",
        recognise: |head, _| imd_binary::recognise(head),
        features: &[],
        open: Open::Binary { index: imd_binary::index, frame: imd_binary::frame },
    },
    Format {
        names: &["ptx"],
        title: "PTX",
        recognise: |head, _| ptx::recognise(head),
        features: &[],
        open: Open::Text { index: ptx::index, frame: ptx::frame },
    },
    Format {
        names: &["xyz", "extxyz"],
        title: "XYZ",
        recognise: |head, _| xyz::recognise(head),
        features: &[],
        open: Open::Text { index: xyz::index, frame: xyz::frame },
    },
    Format {
        names: &["gro"],
        title: "GROMACS GRO",
        recognise: |head, _| gro::recognise(head),
        features: &[],
        open: Open::Text { index: gro::index, frame: gro::frame },
    },
    Format {
        names: &["xtc"],
        title: "GROMACS XTC",
        recognise: |head, _| xtc::recognise(head),
        features: &[Feature::CoordinatesOnly],
        open: Open::Binary { index: xtc::index, frame: xtc::frame },
    },
    Format {
        names: &["trr"],
        title: "GROMACS TRR",
        recognise: |head, _| trr::recognise(head),
        features: &[Feature::CoordinatesOnly],
        open: Open::Binary { index: trr::index, frame: trr::frame },
    },
    Format {
        names: &["dcd"],
        title: "DCD",
        recognise: |head, _| dcd::recognise(head),
        features: &[Feature::CoordinatesOnly],
        open: Open::Binary { index: dcd::index, frame: dcd::frame },
    },
    Format {
        names: &["amber", "netcdf", "nc"],
        title: "AMBER NetCDF",
        recognise: |head, _| amber::recognise(head),
        features: &[Feature::CoordinatesOnly],
        open: Open::Binary { index: amber::index, frame: amber::frame },
    },
    Format {
        names: &["pqr"],
        title: "PQR",
        recognise: pqr::recognise,
        features: &[],
        open: Open::Binary { index: pqr::index, frame: pqr::frame },
    },
    Format {
        names: &["pdb"],
        title: "PDB",
        recognise: |head, _| pdb::recognise(head),
        features: &[Feature::Assemblies],
        open: Open::Binary { index: pdb::index, frame: pdb::frame },
    },
    Format {
        names: &["cif", "mmcif"],
        title: "mmCIF",
        recognise: |head, _| cif::recognise(head),
        features: &[Feature::Assemblies],
        open: Open::Binary { index: cif::index, frame: cif::frame },
    },
    Format {
        names: &["bcif"],
        title: "BinaryCIF",
        recognise: |head, _| bcif::recognise(head),
        features: &[Feature::Assemblies],
        open: Open::Binary { index: bcif::index, frame: bcif::frame },
    },
    Format {
        names: &["mmtf"],
        title: "MMTF",
        recognise: |head, _| mmtf::recognise(head),
        features: &[Feature::Assemblies],
        open: Open::Binary { index: mmtf::index, frame: mmtf::frame },
    },
    Format {
        names: &["gsd"],
        title: "GSD",
        recognise: |head, _| gsd::recognise(head),
        features: &[],
        open: Open::Binary { index: gsd::index, frame: gsd::frame },
    },
    #[cfg(feature = "parquet")]
    Format {
        names: &["parquet"],
        title: "Parquet",
        recognise: |head, _| arrow::parquet::recognise(head),
        features: &[],
        open: Open::Binary { index: arrow::parquet::index, frame: arrow::parquet::frame },
    },
    #[cfg(feature = "parquet")]
    Format {
        names: &["arrow", "feather", "ipc"],
        title: "Arrow",
        recognise: |head, _| arrow::ipc::recognise(head),
        features: &[],
        open: Open::Binary { index: arrow::ipc::index, frame: arrow::ipc::frame },
    },
    Format {
        names: &["ply"],
        title: "PLY",
        recognise: |head, _| ply::recognise(head),
        features: &[],
        open: Open::Whole(ply::read),
    },
    Format {
        names: &["npy", "npz", "numpy"],
        title: "NumPy",
        recognise: |head, _| npy::recognise(head),
        features: &[Feature::Parts],
        open: Open::Whole(npy::read),
    },
    Format {
        names: &["bgeo"],
        title: "BGEO (classic)",
        recognise: |head, _| bgeo::recognise(head),
        features: &[],
        open: Open::Whole(bgeo::read),
    },
    Format {
        names: &["geo"],
        title: "Houdini GEO",
        recognise: |head, _| geo::recognise(head),
        features: &[],
        open: Open::Whole(geo::read),
    },
    Format {
        names: &["prt"],
        title: "Krakatoa PRT",
        recognise: |head, _| prt::recognise(head),
        features: &[],
        open: Open::Binary { index: prt::index, frame: prt::frame },
    },
    Format {
        names: &["ptc"],
        title: "PTC",
        recognise: |head, _| ptc::recognise(head),
        features: &[],
        open: Open::Whole(ptc::read),
    },
    Format {
        names: &["pda"],
        title: "Maya PDA",
        recognise: |head, _| pda::recognise(head),
        features: &[],
        open: Open::Text { index: pda::index, frame: pda::frame },
    },
    Format {
        names: &["usda", "usd"],
        title: "USD (text)",
        recognise: |head, _| usda::recognise(head),
        features: &[],
        open: Open::Binary { index: usda::index, frame: usda::frame },
    },
    Format {
        names: &["mmpld"],
        title: "MegaMol MMPLD",
        recognise: |head, _| mmpld::recognise(head),
        features: &[],
        open: Open::Binary { index: mmpld::index, frame: mmpld::frame },
    },
    Format {
        names: &["vtk", "vtp", "vtu", "pvtp", "pvtu", "pvd", "series"],
        title: "VTK",
        recognise: |head, _| vtk::recognise(head),
        features: &[],
        open: Open::Binary { index: vtk::index, frame: vtk::frame },
    },
    Format {
        names: &["gadget", "gadget1", "gadget2"],
        title: "Gadget",
        recognise: |head, _| gadget::recognise(head),
        features: &[Feature::Types],
        open: Open::Binary { index: gadget::index, frame: gadget::frame },
    },
    Format {
        names: &["tipsy"],
        title: "TIPSY",
        recognise: |head, _| tipsy::recognise(head),
        features: &[Feature::Types],
        open: Open::Binary { index: tipsy::index, frame: tipsy::frame },
    },
    #[cfg(feature = "hdf5")]
    Format {
        names: &["hdf5", "h5", "h5md", "openpmd"],
        title: "HDF5",
        recognise: |head, _| hdf5::recognise(head),
        features: &[Feature::Types, Feature::Datasets],
        open: Open::Binary { index: hdf5::index, frame: hdf5::frame },
    },
    #[cfg(feature = "hdf5")]
    Format {
        names: &["xdmf", "xmf"],
        title: "XDMF",
        recognise: |head, _| hdf5::xdmf::recognise(head),
        features: &[],
        open: Open::Binary { index: hdf5::xdmf::index, frame: hdf5::xdmf::frame },
    },
    Format {
        names: &["las", "laz"],
        title: "LAS",
        recognise: |head, _| las::recognise(head),
        features: &[],
        open: Open::Whole(las::read),
    },
    Format {
        names: &["e57"],
        title: "E57",
        recognise: |head, _| e57::recognise(head),
        features: &[],
        open: Open::Whole(e57::read),
    },
    Format {
        names: &["pcd"],
        title: "PCD",
        recognise: |head, _| pcd::recognise(head),
        features: &[],
        open: Open::Whole(pcd::read),
    },
    Format {
        names: &["pts"],
        title: "PTS",
        recognise: |head, _| pts::recognise(head),
        features: &[],
        open: Open::Text { index: pts::index, frame: pts::frame },
    },
    Format {
        names: &["csv", "tsv", "table", "txt"],
        title: "table",
        recognise: table::recognise,
        features: &[],
        open: Open::Text { index: table::index, frame: table::frame },
    },
];

/// The names of all formats that are read, each of which may be [`Options::format`].
pub fn format_names() -> Vec<&'static str> {
    FORMATS.iter().map(|it| it.names[0]).collect()
}

/// The format of `path`, and how the file is compressed.
pub(crate) fn recognise(path: &Path, options: &Options) -> Result<(&'static Format, Packing)> {
    let (head, packing) = head(path)?;
    if head.trim_ascii().is_empty() {
        let what = if head.is_empty() { "the file is empty" } else { "the file has nothing but blanks" };
        return Err(Error::format(path, "", what, "was it written to its end?"));
    }
    if let Some(name) = &options.format {
        let known = FORMATS.iter().find(|it| it.names.iter().any(|known| name.eq_ignore_ascii_case(known)));
        let allowed = || format!("one of {}", format_names().join(", "));
        let format = known.ok_or_else(|| Error::setting("format", name, allowed()))?;
        return Ok((format, packing));
    }
    if let Some(format) = FORMATS.iter().find(|it| (it.recognise)(&head, path)) {
        return Ok((format, packing));
    }
    if lattice::is_dx(&head) {
        return Err(lattice::no_particles(path, "OpenDX"));
    }
    if vdb::recognise(&head) {
        return Err(vdb::no_particles(path));
    }
    if let Some(error) = unreadable::explain(path, &head) {
        return Err(error);
    }
    if options.columns.is_some() && is_text(&head) {
        let table = FORMATS.iter().find(|it| it.names[0] == "csv").expect("tables are in the list");
        return Ok((table, packing));
    }
    if let Some(error) = unreadable::explain_likely(path, &head) {
        return Err(error);
    }
    Err(table::unknown(path, &head))
}

/// The first bytes of the unpacked content.
pub(crate) fn head(path: &Path) -> Result<(Vec<u8>, Packing)> {
    let io = |source| Error::io(path, source);
    let mut file = open(path)?;
    let mut magic = Vec::new();
    (&mut file).take(unpack::MAGIC_BYTES as u64).read_to_end(&mut magic).map_err(io)?;
    let packing = Packing::of(&magic);
    let file = open(path)?;
    let mut head = Vec::new();
    let read = packing.stream(file).take(HEAD).read_to_end(&mut head);
    match read {
        // What came before the fault is enough to recognise the format; its reader will say what is wrong.
        Err(error) if head.is_empty() && packing != Packing::Plain => {
            let name = packing.name().unwrap_or_default();
            let what = format!("the {name} data cannot be unpacked: {error}");
            Err(Error::format(path, "", what, "was the file copied to its end?"))
        }
        Err(error) if packing == Packing::Plain => Err(io(error)),
        _ => Ok((head, packing)),
    }
}

/// The whole content of a compressed file. Stage "unpack", in bytes of the file.
pub(crate) fn unpacked(path: &Path, packing: Packing, progress: &dyn Progress) -> Result<Vec<u8>> {
    let file_bytes = std::fs::metadata(path).map_err(|source| Error::io(path, source))?.len();
    progress.begin("unpack", Some(file_bytes), "B");
    unpack(path, packing, progress)
}

/// The same, within a stage that counts bytes of files.
pub(crate) fn unpack(path: &Path, packing: Packing, progress: &dyn Progress) -> Result<Vec<u8>> {
    let file = open(path)?;
    let mut stream = packing.stream(file);
    let mut bytes = Vec::new();
    let mut told = 0;
    loop {
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        // Room grows with what was really there, so that a small file which claims to be huge fails late and kindly.
        bytes.try_reserve(UNPACK_STEP).map_err(|_| Error::Memory {
            what: format!("the unpacked content of {}", path.display()),
            needed_bytes: (bytes.len() + UNPACK_STEP) as u64,
            available_bytes: bytes.len() as u64,
            hint: "unpack the file on disk: it is then mapped".to_string(),
        })?;
        let read = (&mut stream).take(UNPACK_STEP as u64).read_to_end(&mut bytes);
        let count = read.map_err(|error| {
            let what = format!("the compressed data end early or are damaged: {error}");
            Error::format(path, "", what, "was the file copied to its end?")
        })?;
        progress.advance(stream.taken() - told);
        told = stream.taken();
        if count < UNPACK_STEP {
            return Ok(bytes);
        }
    }
}

/// Checks the columns on entry.
pub(crate) fn finish(columns: Columns, conventions: Vec<String>, warnings: Vec<String>) -> Result<Frame> {
    Ok(Frame { particles: Particles::new(columns)?, conventions, given: Vec::new(), warnings })
}

/// Whether these bytes are text in an encoding that has ASCII in it.
pub(crate) fn is_text(head: &[u8]) -> bool {
    let control = |byte: &&u8| **byte < 32 && !matches!(**byte, b'\t' | b'\n' | b'\r' | 0x0c);
    !head.is_empty() && head.iter().filter(control).count() == 0
}

/// The lines of `head` that are there in full; all of them if the content is no longer.
pub(crate) fn whole_lines(head: &[u8]) -> impl Iterator<Item = &[u8]> {
    let whole = if (head.len() as u64) < HEAD {
        head.len()
    } else {
        memchr::memrchr(b'\n', head).unwrap_or(head.len())
    };
    head[..whole].split(|&byte| byte == b'\n').map(|line| line.trim_ascii_end())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    /// A file that is gone when it is dropped.
    struct Temporary(PathBuf);

    impl Temporary {
        fn new(name: &str, bytes: &[u8]) -> Self {
            let path = std::env::temp_dir().join(format!("tyndall-read-{}-{name}", std::process::id()));
            std::fs::write(&path, bytes).unwrap();
            Self(path)
        }
    }

    impl Drop for Temporary {
        fn drop(&mut self) {
            std::fs::remove_file(&self.0).unwrap();
        }
    }

    fn title(name: &str, bytes: &[u8]) -> std::result::Result<&'static str, String> {
        let file = Temporary::new(name, bytes);
        recognise(&file.0, &Options::default()).map(|it| it.0.title).map_err(|error| error.to_string())
    }

    #[test]
    fn content_decides_and_not_the_name() {
        assert_eq!(title("a.png", b"2\ncomment\nO 0 0 0\nH 0 0 1\n"), Ok("XYZ"));
        assert_eq!(title("b.xyz", b"ITEM: TIMESTEP\n0\n"), Ok("LAMMPS dump"));
        assert_eq!(title("c.dat", b"x,y,z\n1,2,3\n"), Ok("table"));
    }

    #[test]
    fn every_format_has_a_sample_for_the_tests_that_damage_files() {
        let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
        let files = ["samples", "hdf5"].map(|it| std::fs::read_dir(data.join(it)).unwrap());
        let known = files.into_iter().flatten().filter_map(|it| {
            recognise(&it.unwrap().path(), &Options::default()).ok().map(|(format, _)| format.title)
        });
        let known: Vec<&str> = known.collect();
        let without = FORMATS.iter().map(|it| it.title).filter(|it| !known.contains(it));
        assert_eq!(without.collect::<Vec<_>>(), [""; 0], "add a small file to tests/data/samples");
    }

    #[test]
    fn the_empty_and_the_unknown_say_so() {
        assert!(title("d.xyz", b"").unwrap_err().starts_with("the file is empty"));
        assert!(title("e.xyz", b"\n \n").unwrap_err().contains("nothing but blanks"));
        let garbage: Vec<u8> = (0..999u32).map(|k| (k.wrapping_mul(2654435761) >> 13) as u8).collect();
        assert!(title("f.dat", &garbage).unwrap_err().contains("cannot tell the format"));
        let seven = title("foo.dat", b"1 2 3 4 5 6 7\n1 2 3 4 5 6 7\n").unwrap_err();
        assert!(seven.contains("foo.dat' (text, 7 columns, no header)"), "{seven}");
        let words = title("atoms.dat", b"O 0 0 0\nH 0 0 1\n").unwrap_err();
        assert!(words.contains("try: --columns element,x,y,z"), "{words}");
        assert!(seven.contains("try: --columns id,type,x,y,z,vx,vy or --format csv"), "{seven}");
    }

    #[test]
    fn an_unknown_format_name_lists_the_known_ones() {
        let file = Temporary::new("g.xyz", b"0\n\n");
        let options = Options { format: Some("doc".to_string()), ..Options::default() };
        let error = recognise(&file.0, &options).err().unwrap().to_string();
        assert!(error.contains("format cannot be 'doc'") && error.contains("xyz"), "{error}");
    }

    #[test]
    fn compressed_content_is_unpacked_whole_or_not_at_all() {
        let bytes: Vec<u8> = (0..3_000_000u32).map(|k| (k.wrapping_mul(2654435761) >> 20) as u8).collect();
        let packed =
            ruzstd::encoding::compress_to_vec(&bytes[..], ruzstd::encoding::CompressionLevel::Fastest);
        let file = Temporary::new("whole.zst", &packed);
        assert!(unpacked(&file.0, Packing::Zstd, &()).unwrap() == bytes);
        let cut = Temporary::new("cut.zst", &packed[..packed.len() / 2]);
        assert!(unpacked(&cut.0, Packing::Zstd, &()).unwrap_err().to_string().contains("end early"));
    }
}
