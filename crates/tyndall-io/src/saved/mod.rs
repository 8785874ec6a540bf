//! Particles and their structure in one file, `.tyn`, which is mapped and opens at once.
//!
//! `container` is the file: a header, named sections, a table of them; `about` is what it says about itself, in JSON; `contents` makes
//! particles of sections; `write` makes a file, [`Saved`] opens one. `docs/tyn.md` has the layout.

mod about;
mod container;
mod contents;
#[cfg(test)]
mod tests;
mod write;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use memmap2::Mmap;
use tyndall::particles::{Attribute, Columns, Positions, Values};
use tyndall::scene::guesses::Guesses;
use tyndall::scene::wanted::Wanted;
use tyndall::structure::{Kind, Structure};
use tyndall::{Error, Particles, Progress, Result};

use self::container::Table;
use self::contents::Contents;
use crate::read;
use crate::sequence::given::{self, Told};
use crate::sequence::{Frame, Options};
pub use write::{Recipe, Written, build};

/// Whether a file begins like one of these.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(&container::MAGIC)
}

/// An open file. Opening looks at the header, the table of sections, what the file says about itself, and the pointers of treelets;
/// all else is loaded page by page when somebody looks at it.
pub struct Saved {
    /// Its particles, in their order and with all that the file they came from said. Their radii are those of the structure.
    pub particles: Particles,
    /// Their structure.
    pub structure: Structure,
    /// What was guessed when they were read, one line each.
    pub conventions: Vec<String>,
    /// What the caller said in place of the file, one line each.
    pub given: Vec<String>,
    /// What the user should know, one line each.
    pub warnings: Vec<String>,
    /// What was guessed by looking at all of them.
    pub guesses: Guesses,
    kind: Kind,
    path: PathBuf,
    table: Table,
    map: Arc<Mmap>,
}

impl Saved {
    /// Opens a file.
    ///
    /// Fails with [`Error::Format`] where it is not whole, none of these, of a later version, or where what is looked at is damaged.
    pub fn open(path: &Path) -> Result<Self> {
        let map = Arc::new(read::map_in_pieces(path)?);
        let table = Table::parse(path, &map)?;
        let contents = Contents::mapped(path, &table, map.clone());
        let about = contents.about()?;
        let particles = contents.particles(&about, &about.all())?;
        let guesses = about.guesses(path, contents.array::<[f32; 4]>("sample")?.to_vec())?;
        let facts = about.facts(path)?;
        let kind = facts.kind;
        let mut array = |name: &'static str| contents.region(&format!("structure.{name}"));
        let (origin, places) = (particles.positions().origin(), contents.places()?);
        let structure = Structure::restore(facts, origin, places, &mut array)
            .map_err(|(name, what)| fault(path, format!("structure.{name}"), what))?;
        let (conventions, path) = (about.conventions, path.to_path_buf());
        let [given, warnings] = [(); 2].map(|()| Vec::new());
        Ok(Self { particles, structure, conventions, given, warnings, guesses, kind, path, table, map })
    }

    /// The same with particles that are as `options` have them.
    pub(crate) fn told(self, options: &Options) -> Result<Self> {
        let Told { particles, given, warnings } = given::told(self.particles, options)?;
        Ok(Self { particles, given, warnings: [self.warnings, warnings].concat(), ..self })
    }

    /// How the structure was built.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The program that wrote the file, and its version.
    pub fn writer(&self) -> &str {
        &self.table.writer
    }

    /// Whether all sections are as they were written. Stage "check", in bytes.
    ///
    /// Fails with [`Error::Format`] about the first one that is not.
    pub fn check(&self, progress: &dyn Progress) -> Result<()> {
        self.table.check(&self.path, &self.map, progress)
    }

    /// Some of the particles, evenly spread over all, with a radius each.
    pub fn sample(&self) -> Result<Particles> {
        let column = |axis: usize| self.guesses.sample.iter().map(|it| it[axis]).collect::<Vec<f32>>();
        let origin = self.particles.positions().origin();
        Particles::new(Columns {
            positions: Positions::from_offsets(origin, [column(0), column(1), column(2)]),
            attributes: vec![Attribute::new("radius", 1, Values::F32(column(3)))],
            ..Columns::default()
        })
    }
}

/// Which structure a file has, if it is one of these and opens.
pub fn kind_of(path: &Path) -> Option<Kind> {
    let map = read::map_in_pieces(path).ok().filter(|map| recognise(map))?;
    let table = Table::parse(path, &map).ok()?;
    let about = Contents::copied(path, &table, &map).about().ok()?;
    about.facts(path).ok().map(|facts| facts.kind)
}

/// Reads the particles as those of any other format: into memory of their own, with every section that is read checked. Attributes that
/// are not wanted are left where they are, but for that of the radii.
pub(crate) fn read(
    path: &Path,
    bytes: &[u8],
    wanted: Option<&Wanted>,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let table = Table::parse(path, bytes)?;
    let contents = Contents::copied(path, &table, bytes);
    let about = contents.about()?;
    let places = wanted.map_or_else(|| about.all(), |it| about.wanted(it));
    let particles = contents.particles(&about, &places)?;
    contents.check_values(&about, &places, &particles)?;
    progress.advance(bytes.len() as u64);
    Ok(Frame { particles, conventions: about.conventions, given: Vec::new(), warnings: Vec::new() })
}

/// An error about a section.
fn fault(path: &Path, place: impl Into<String>, what: impl Into<String>) -> Error {
    Error::format(path, place, what, "build the file anew from its source")
}
