//! Frames, opened lazily: many files, or many frames in a file.
//!
//! Opening recognises each file and finds its frames: mapped text is scanned, compressed text is unpacked once and passed
//! over, unless an earlier run has kept its index ([`Options::index_folder`]). Kept are offsets only, and the unpacked content of a single compressed file where that is small. Reading a frame
//! maps the file anew; in a compressed file it goes on from where the last frame ended, or unpacks from the start again to
//! go back, so that a long trajectory is never held as a whole. Frames may also be spread over files (`pieces.rs`).

mod file;
pub(crate) mod given;
mod pieces;

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use tyndall::scene::type_elements::TypeElements;
use tyndall::scene::units::Units;
use tyndall::scene::wanted::Wanted;
use tyndall::{Error, Particles, Progress, Result};

use crate::groups::{self, Groups};
use crate::parts::Parts;
use crate::read::{Feature, Open, Packing};
use crate::saved::Saved;
use crate::topology::Topology;
use file::{Asked, FileSource, file_bytes, file_name};
use given::Told;
use pieces::Pieces;
pub use pieces::has_place as is_in_pieces;

/// What the caller knows better than the file.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Names of the columns of a table, in order, instead of its header.
    pub columns: Option<Vec<String>>,
    /// The format's name, instead of recognition by content.
    pub format: Option<String>,
    /// Whether a truncated file is an error; else its whole frames are read, with a warning.
    pub strict: bool,
    /// Whether the coordinates of a LAMMPS dump are fractions of its cell, whatever their columns are called.
    pub scaled: bool,
    /// The biological assembly to make of a PDB or mmCIF file, by its name, or `all`; none leaves the atoms as they stand in the file.
    pub assembly: Option<String>,
    /// Names or numbers of the types of particles to read from a snapshot (Gadget, TIPSY, HDF5); all if `None`.
    pub types: Option<Vec<String>>,
    /// Which data set of an HDF5 file has the positions, or which group of an H5MD file the particles, where there are several.
    pub dataset: Option<String>,
    /// Which element each type is, in place of what the file says of elements.
    pub elements: Option<TypeElements>,
    /// The units of the file, in place of those that it says or that its format has.
    pub units: Option<Units>,
    /// An index file of GROMACS, `FILE` or `FILE:GROUP`, for trajectories that hold a group of the particles of a file with names: the group of that name or
    /// number; else the only one, or that which has as many.
    pub index: Option<PathBuf>,
    /// A folder in which indexes of the frames of long texts are kept, so that these are passed over once; none are kept if `None`.
    pub index_folder: Option<PathBuf>,
    /// What the attributes are for: others are left out, where the format lets a reader pass over them. All are read if `None`.
    pub wanted: Option<Wanted>,
}

/// One frame of a sequence.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Its particles.
    pub particles: Particles,
    /// What was guessed while reading, one line each.
    pub conventions: Vec<String>,
    /// What the caller said in place of the file ([`Options::elements`], [`Options::units`]), one line each.
    pub given: Vec<String>,
    /// What the user should know, one line each. What concerns the whole file is said with each of its frames.
    pub warnings: Vec<String>,
}

/// A list of frames. Only what was asked for is read.
pub struct Sequence {
    paths: Vec<PathBuf>,
    sources: Vec<Source>,
    /// For each source the number of frames before it.
    first: Vec<usize>,
    frame_count: usize,
    options: Options,
    format: String,
    /// What the first file gives to the others, if these have coordinates only: it is no frame then.
    topology: Option<Topology>,
}

/// Where frames come from.
enum Source {
    /// A generator, by its specification.
    Synthetic(String),
    /// A file.
    File(Box<FileSource>),
    /// Files over which each frame is spread.
    Pieces(Box<Pieces>),
}

impl Sequence {
    /// Opens files, in the given order, as one sequence. A path that begins with `synthetic:` names a procedural source.
    ///
    /// Where all files but the first have coordinates only (XTC, TRR, DCD, AMBER NetCDF), and the first has names, it is no frame: its
    /// attributes are given to the frames of the others, which must have as many particles, or as many as a group of them ([`Options::index`]).
    ///
    /// A name that is no file, with a `%` that is not one of `%d` or `%04d`, stands for the pieces 0, 1, … of frames that LAMMPS wrote with
    /// several processors (`dump.%.lammpstrj`): they are put together frame by frame. A piece that is missing between others, or is of another
    /// step, or has other columns or another box, is an [`Error::Format`].
    ///
    /// Stage "open" of `progress`, in bytes of the files as they are on disk: of compressed ones, which are unpacked to find
    /// their frames, those that were taken.
    pub fn open(paths: &[PathBuf], options: &Options, progress: &dyn Progress) -> Result<Self> {
        if paths.is_empty() {
            return Err(Error::setting("input", "", "give at least one file"));
        }
        let named = |name: &PathBuf| match synthetic(name) {
            Some(_) => Ok((name.clone(), None)),
            None => Ok((name.clone(), pieces::files(name)?)),
        };
        let named: Vec<(PathBuf, Option<Vec<PathBuf>>)> = paths.iter().map(named).collect::<Result<_>>()?;
        let options = &given::with_wanted(options);
        let paths: Vec<PathBuf> = named
            .iter()
            .flat_map(|(name, pieces)| pieces.clone().unwrap_or_else(|| vec![name.clone()]))
            .collect();
        progress.begin("open", Some(paths.iter().map(|path| file_bytes(path)).sum()), "B");
        let keep = paths.len() == 1;
        let open = |(name, pieces): &(PathBuf, Option<Vec<PathBuf>>)| match pieces {
            _ if progress.cancelled() => Err(Error::Interrupted),
            Some(files) => Ok(Source::Pieces(Box::new(Pieces::open(name, files, options, progress)?))),
            None => Source::open(name, options, keep, progress),
        };
        let sources: Vec<Source> = named.par_iter().map(open).collect::<Result<_>>()?;
        let mut sources = without_repeated_snapshots(sources);
        pieces::compare(&mut sources);
        if let Some(assembly) = &options.assembly
            && !sources.iter().any(|it| it.has(Feature::Assemblies))
        {
            let allowed =
                format!("only {} files have assemblies: leave it out", Feature::Assemblies.formats());
            return Err(Error::setting("assembly", assembly, allowed));
        }
        let mut format = sources[0].title();
        let mut topology = None;
        if let [names, others @ ..] = &sources[..]
            && let Some(path) = names.path().filter(|_| !names.has(Feature::CoordinatesOnly))
            && !others.is_empty()
            && others.iter().all(|it| it.has(Feature::CoordinatesOnly))
        {
            let frame = names.frame(0, options, None, progress)?;
            let all = Topology::new(path, &frame.particles)?;
            let count = || {
                let particles = others[0].frame(0, options, None, progress)?.particles;
                Ok(particles.len() + particles.dropped().total() as usize)
            };
            topology = Some(match &options.index {
                Some(named) => all.of_group(Groups::open(named)?, count)?,
                None => all,
            });
            format = format!("{}, names from {format}", others[0].title());
            sources.remove(0);
        }
        if let Some(named) = options.index.as_ref().filter(|_| topology.is_none()) {
            let allowed = "left out: it is for a file with names before a trajectory of some of its particles, in this order: conf.gro traj.xtc — \
                           --select shows some of the particles of any file";
            return Err(Error::setting(groups::SETTING, named.display(), allowed));
        }
        let mut first = Vec::with_capacity(sources.len());
        let mut frame_count = 0;
        for source in &sources {
            first.push(frame_count);
            frame_count += source.frame_count();
        }
        let options = options.clone();
        Ok(Self { paths, sources, first, frame_count, options, format, topology })
    }

    /// How many frames there are.
    #[expect(clippy::len_without_is_empty, reason = "a sequence has a frame, or it does not open")]
    pub fn len(&self) -> usize {
        self.frame_count
    }

    /// The format's name, as printed to people: that of the first file.
    pub fn format(&self) -> &str {
        &self.format
    }

    /// The files, in order.
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    /// A name for frame `frame`: its file's, and its number therein, counted from 0, where there are more.
    pub fn name(&self, frame: usize) -> String {
        let (source, within) = self.place(frame);
        let name = match &self.sources[source] {
            Source::Synthetic(spec) => return spec.clone(),
            Source::File(file) => file_name(&file.path),
            Source::Pieces(pieces) => file_name(&pieces.name),
        };
        if self.sources[source].frame_count() > 1 { format!("{name}[{within}]") } else { name }
    }

    /// Reads frame `frame`, counted from 0.
    pub fn frame(&self, frame: usize, progress: &dyn Progress) -> Result<Frame> {
        if frame >= self.frame_count {
            return Err(Error::setting("frame", frame, format!("0 to {}", self.frame_count - 1)));
        }
        let (source, within) = self.place(frame);
        let mut frame =
            self.sources[source].frame(within, &self.options, self.topology.as_ref(), progress)?;
        frame.warnings.extend(dropped(&frame.particles));
        let Told { particles, given, warnings } = given::told(frame.particles, &self.options)?;
        frame.warnings.extend(warnings);
        Ok(Frame { particles, given, ..frame })
    }

    /// Frame `frame` as a source of parts, for when it does not fit the memory; `None` where its format has to be read as a whole, or
    /// types are to have elements.
    pub fn parts(&self, frame: usize) -> Result<Option<Parts>> {
        if self.options.elements.is_some() {
            return Ok(None);
        }
        let (source, _) = self.place(frame);
        let parts = match &self.sources[source] {
            Source::Synthetic(spec) => Parts::of_synthetic(spec).map(Some),
            Source::File(file) if file.format.has(Feature::Parts) && file.packing == Packing::Plain => {
                Parts::of_npy(&file.path, self.options.wanted.clone())
            }
            Source::File(_) | Source::Pieces(_) => Ok(None),
        };
        Ok(parts?.map(|parts| parts.in_units(self.options.units.clone())))
    }

    /// Frame `frame` with its structure, if it is that of a file which has one.
    pub fn saved(&self, frame: usize) -> Result<Option<Saved>> {
        let (source, _) = self.place(frame);
        match &self.sources[source] {
            Source::File(file) if file.format.has(Feature::Structure) && file.packing == Packing::Plain => {
                let mut saved = Saved::open(&file.path)?;
                saved.warnings.extend(dropped(&saved.particles));
                saved.told(&self.options).map(Some)
            }
            _ => Ok(None),
        }
    }

    /// The source of a frame, and the frame's number therein.
    fn place(&self, frame: usize) -> (usize, usize) {
        let source = self.first.partition_point(|&first| first <= frame) - 1;
        (source, frame - self.first[source])
    }
}

/// The sources, of which each file of a snapshot that is spread over several would be the whole: only the first of them stays.
fn without_repeated_snapshots(sources: Vec<Source>) -> Vec<Source> {
    let mut seen: Vec<Vec<PathBuf>> = Vec::new();
    let is_new = |source: &Source| {
        let Source::File(file) = source else { return true };
        let files = &file.index.files;
        let is_new = files.len() < 2 || !seen.contains(files);
        if files.len() > 1 && is_new {
            seen.push(files.clone());
        }
        is_new
    };
    sources.into_iter().filter(is_new).collect()
}

/// Makes the particles of a procedural source.
fn synthetic_frame(spec: &str, progress: &dyn Progress) -> Result<Frame> {
    let particles = tyndall::synthetic::generate(spec, progress)?;
    Ok(Frame { particles, conventions: Vec::new(), given: Vec::new(), warnings: Vec::new() })
}

/// The warning about particles that were left out on entry.
fn dropped(particles: &Particles) -> Option<String> {
    let dropped = particles.dropped();
    let all = particles.len() as u64 + dropped.total();
    let reasons = [(dropped.position, "NaN positions"), (dropped.radius, "radius < 0")];
    let reasons: Vec<String> = reasons
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{} {what}", grouped(*count)))
        .collect();
    let counts = format!("dropped {} of {} particles", grouped(dropped.total()), grouped(all));
    (dropped.total() > 0).then(|| format!("{counts} ({})", reasons.join(", ")))
}

/// A count with commas between the thousands.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

impl Source {
    /// Opens a file; `keep` says whether its content may be kept unpacked.
    fn open(path: &Path, options: &Options, keep: bool, progress: &dyn Progress) -> Result<Self> {
        match synthetic(path) {
            Some(spec) => Ok(Self::Synthetic(spec.to_string())),
            None => Ok(Self::File(Box::new(FileSource::open(path, options, keep, progress)?))),
        }
    }

    fn frame_count(&self) -> usize {
        match self {
            Self::Synthetic(_) => 1,
            Self::File(file) => file.index.frames.len(),
            Self::Pieces(pieces) => pieces.frame_count,
        }
    }

    fn has(&self, feature: Feature) -> bool {
        self.file().is_some_and(|file| file.format.has(feature))
    }

    /// The file, or the first one of pieces.
    fn file(&self) -> Option<&FileSource> {
        match self {
            Self::Synthetic(_) => None,
            Self::File(file) => Some(file),
            Self::Pieces(pieces) => pieces.files.first(),
        }
    }

    /// Its name, if it is no generator.
    fn path(&self) -> Option<&Path> {
        match self {
            Self::Synthetic(_) => None,
            Self::File(file) => Some(&file.path),
            Self::Pieces(pieces) => Some(&pieces.name),
        }
    }

    fn frame(
        &self,
        frame: usize,
        options: &Options,
        topology: Option<&Topology>,
        progress: &dyn Progress,
    ) -> Result<Frame> {
        match self {
            Self::Synthetic(spec) => synthetic_frame(spec, progress),
            Self::File(file) => file.frame(frame, Asked { options, topology, others: &() }, progress),
            Self::Pieces(pieces) => pieces.frame(frame, options, topology, progress),
        }
    }

    fn title(&self) -> String {
        let Some(file) = self.file() else { return "synthetic".to_string() };
        let text = matches!(file.format.open, Open::Text { .. }).then_some("text");
        let notes: Vec<&str> = text.into_iter().chain(file.packing.name()).collect();
        let mut title = file.index.title.as_deref().unwrap_or(file.format.title).to_string();
        if let Self::Pieces(pieces) = self {
            title += &format!(", {} pieces", pieces.files.len());
        }
        if notes.is_empty() { title } else { format!("{title} ({})", notes.join(", ")) }
    }
}

/// The specification of a procedural source, if that is what is named.
fn synthetic(name: &Path) -> Option<&str> {
    name.to_str()?.strip_prefix("synthetic:")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_grouped() {
        assert_eq!([0, 999, 1204, 8_000_000].map(grouped), ["0", "999", "1,204", "8,000,000"]);
    }

    #[test]
    fn synthetic_sources_are_one_frame() {
        let sequence = Sequence::open(&["synthetic:nozzle?n=10".into()], &Options::default(), &()).unwrap();
        assert_eq!(
            (sequence.len(), sequence.format(), sequence.name(0)),
            (1, "synthetic", "nozzle?n=10".to_string())
        );
        assert!(sequence.frame(1, &()).is_err());
    }

    #[test]
    fn no_file_and_a_missing_file_are_errors() {
        assert!(Sequence::open(&[], &Options::default(), &()).is_err());
        let missing = Sequence::open(&["no such file.xyz".into()], &Options::default(), &());
        assert!(matches!(missing.err(), Some(Error::Io { .. })));
    }
}
