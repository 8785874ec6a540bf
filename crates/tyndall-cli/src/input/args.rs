//! Which files are read, and how, as the command line says it.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use tyndall::scene::center::Center;
use tyndall::scene::type_elements::TypeElements;
use tyndall::scene::units::Units;

/// Files, and how to read them.
#[derive(Args)]
#[command(next_help_heading = "Reading")]
pub(crate) struct Input {
    /// Files, as one sequence in this order; in quotes also patterns: 'run.*.dump', or 'spray.####.prt', %04d and $F4, whose numbers
    /// are then those of --frame and --frames; 'dump.%' for the pieces of frames that LAMMPS wrote with several processors, also
    /// 'dump.*.%'; or synthetic:NAME?n=COUNT. A file with names before files that have coordinates
    /// only (XTC, TRR, DCD, AMBER NetCDF) names their particles: topol.gro traj.xtc. To render also a scene file (.toml), which says what is not
    /// said here: see docs/scenes.md
    #[arg(required = true, value_name = "FILE", help_heading = None)]
    pub(crate) files: Vec<PathBuf>,
    /// The numbers of the files, if a pattern with a number named them: see [`crate::names`].
    #[arg(skip)]
    pub(crate) numbers: Option<Vec<usize>>,
    // The help names what the readers know.
    #[arg(long, value_name = "NAME", help = format!("Format, instead of recognising it: {}", tyndall_io::read::format_names().join(" ")))]
    pub(crate) format: Option<String>,
    /// Names of the columns of a table, in order: id,type,x,y,z
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) columns: Option<Vec<String>>,
    /// Whether a LAMMPS dump's coordinates are fractions of its cell [default: as its columns are called]
    #[arg(long, value_name = "KIND")]
    pub(crate) coords: Option<Coords>,
    /// Element of each type, where the file has types alone: symbols in the order of the types 1, 2, ..., Cu,Zr, as of LAMMPS' dump_modify
    /// element (of HOOMD's typeid, which counts from 0, in the order of 0, 1, ...), or pairs by number or name: 1=Cu,4=Zr or A=Cu. It counts before elements
    /// that the file says; types that are not named keep these, or have none
    #[arg(long, value_name = "SYMBOLS")]
    pub(crate) elements: Option<TypeElements>,
    /// Units of a file that does not say them: a unit of length (Å or A, nm, pm, um, mm, cm, m, km, Bohr, au, pc, kpc, Mpc, ckpc/h) or a style of LAMMPS (lj real metal si
    /// cgs electron micro nano), which tells those of times and velocities, too. It counts before what the file says; numbers stay as they are
    #[arg(long, value_name = "NAME")]
    pub(crate) units: Option<Units>,
    /// GROMACS index file for a trajectory that holds some of the particles of the file with names before it: conf.gro traj.xtc --index protein.ndx, or protein.ndx:GROUP for the
    /// group of that name or number from 0 [default: the only group, else the one that has as many]
    #[arg(long, value_name = "FILE")]
    pub(crate) index: Option<PathBuf>,
    /// Biological assembly to make of a PDB, mmCIF, BinaryCIF or MMTF file: its number, or all [default: the atoms of the file]
    #[arg(long, value_name = "NUMBER")]
    pub(crate) assembly: Option<String>,
    /// Types of particles to read from a snapshot (Gadget, TIPSY, HDF5), by name or number: gas,star or 0,4 [default: all]
    #[arg(long = "type", value_name = "TYPES", value_delimiter = ',')]
    pub(crate) types: Option<Vec<String>>,
    /// Data set of an HDF5 file that has the positions, group of particles of an H5MD file, or grid of an OpenVDB file, where there are several
    #[arg(long, value_name = "PATH")]
    pub(crate) dataset: Option<String>,
    /// Where particles of a periodic box are put
    #[arg(long, value_name = "WHAT", default_value = "none")]
    pub(crate) wrap: Wrap,
    /// Puts particles where they came to, by the file's image flags (ix iy iz)
    #[arg(long, conflicts_with = "wrap")]
    pub(crate) unwrap: bool,
    /// Measures coordinates from there, in every frame: X,Y,Z, densest (the densest place), or the middle of what a condition is true for, such as
    /// 'id == 12' or "element == Fe". Periodic boxes are put around it, and the camera looks at it; --clip, --select, --eye and others mean these coordinates
    #[arg(long, value_name = "WHERE", allow_hyphen_values = true)]
    pub(crate) center: Option<Center>,
    /// Fails on a truncated file, instead of reading its whole frames
    #[arg(long)]
    pub(crate) strict: bool,
    /// Looks for the frames of a long text anew, and does not keep where they are; else that is kept in the cache folder, until the file changes
    #[arg(long)]
    pub(crate) no_index: bool,
    /// What to do with particles that cannot be drawn (NaN positions, negative radii)
    #[arg(long, value_name = "WHAT", default_value = "drop")]
    pub(crate) on_bad: OnBad,
}

/// What the coordinates of a dump are.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Coords {
    /// Positions as they are
    Real,
    /// Fractions of the cell
    Scaled,
}

/// Where particles of a periodic box are put.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Wrap {
    /// Where the file says
    #[default]
    None,
    /// Each into the cell
    Atoms,
    /// Molecules whole (by mol, else residues and chains of them), their middle in the cell
    Molecules,
}

/// What to do with bad particles.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum OnBad {
    /// Leave them out and say how many
    Drop,
    /// Stop
    Error,
}
