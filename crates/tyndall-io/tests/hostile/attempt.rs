//! Opening a file that nobody trusts, as a user would: what the tests of this folder and the fuzz target have in common.
//!
//! Takes a path, gives what was read or the errors. Whatever the content, it must end soon, without a panic, in memory that its
//! size bounds; the caller watches over these. What can be judged here is: every error names a file of the folder.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;

use tyndall::particles::{Particles, View};
use tyndall::{Error, Result};
use tyndall_io::{Frame, Options, Sequence, read, vdb};

/// What was read of one frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Seen {
    /// How many particles it has, with those that were dropped.
    pub(crate) particles: u64,
    /// Of everything that it holds.
    pub(crate) hash: u64,
    /// What the user is told.
    pub(crate) warnings: Vec<String>,
}

/// Reads all frames of `path`, as the format of that name or as the one that is recognised, then tries it as a density, as a sky and as grids.
///
/// # Panics
/// Where an error does not say which file it is about.
pub(crate) fn attempt(path: &Path, format: Option<&str>) -> std::result::Result<Vec<Seen>, String> {
    let options = Options { format: format.map(str::to_string), ..Options::default() };
    let frames = frames(path, &options);
    if let Ok((format, _)) = &frames
        && ["PDB", "CIF", "MMTF"].iter().any(|it| format.contains(it))
        && std::fs::metadata(path).is_ok_and(|it| it.len() < 1 << 16)
    {
        // All copies of all atoms are as many as the file asks for: of large ones that is no measure.
        let whole = Options { assembly: Some("all".to_string()), ..options };
        drop(self::frames(path, &whole));
    }
    if let Err(error) = read::described_density(path, &[], 1.0, &()) {
        judge(path, &error);
    }
    if let Err(error) = read::sky(path, [1.0; 3]) {
        judge(path, &error);
    }
    if vdb::is_vdb(path).unwrap_or(false)
        && let Err(error) = vdb::read(path, None, &())
    {
        judge(path, &error);
    }
    match frames {
        Ok((_, frames)) => Ok(frames),
        Err(error) => Err(judge(path, &error)),
    }
}

/// What the error says, if it says which file it is about, or which setting.
fn judge(path: &Path, error: &Error) -> String {
    let message = error.to_string();
    let folder = path.parent().expect("files are in folders").to_string_lossy();
    let is_about = match error {
        // Files that a list names may be elsewhere.
        Error::Format { path, .. } | Error::Io { path, .. } => message.contains(&*path.to_string_lossy()),
        Error::Setting { .. } => true,
        _ => message.contains(&*folder),
    };
    assert!(is_about, "the error names no file: {message}");
    assert!(message.len() < 4096 && !message.contains('\0'), "the message is not for people: {message:?}");
    message
}

fn frames(path: &Path, options: &Options) -> Result<(String, Vec<Seen>)> {
    let sequence = Sequence::open(&[path.to_path_buf()], options, &())?;
    let seen = |frame| sequence.frame(frame, &()).map(seen);
    Ok((sequence.format().to_string(), (0..sequence.len()).map(seen).collect::<Result<_>>()?))
}

fn seen(frame: Frame) -> Seen {
    let particles = &frame.particles;
    let mut hash = DefaultHasher::new();
    let dropped = particles.dropped().total();
    for id in 0..particles.len() {
        particles.positions().world(id).to_array().map(|it| it.to_bits()).hash(&mut hash);
    }
    particles.time().map(f64::to_bits).hash(&mut hash);
    attributes(particles, &mut hash);
    Seen { particles: particles.len() as u64 + dropped, hash: hash.finish(), warnings: frame.warnings }
}

fn attributes(particles: &Particles, hash: &mut DefaultHasher) {
    for attribute in particles.attributes() {
        (&attribute.name, attribute.components, &attribute.unit).hash(hash);
        match attribute.values.view() {
            View::F32(values) => values.iter().for_each(|it| it.to_bits().hash(hash)),
            View::F64(values) => values.iter().for_each(|it| it.to_bits().hash(hash)),
            View::I32(values) => values.hash(hash),
            View::I64(values) => values.hash(hash),
            View::U8(values) => values.hash(hash),
            View::Text { codes, names } => (codes, names).hash(hash),
        }
    }
}
