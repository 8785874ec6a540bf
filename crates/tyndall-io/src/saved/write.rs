//! Building a file: the particles' sections are written before the structure takes their memory, so that nothing is held twice.

use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

use tyndall::particles::View;
use tyndall::scene::guesses::Guesses;
use tyndall::structure::{Kind, PackingError, Spheres, Structure};
use tyndall::{Error, Particles, Progress, Radii, Result};

use super::about::About;
use super::container::Writer;
use crate::write::atomically;

/// How a file is built.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// The structure; not brute force.
    pub kind: Kind,
    /// How the radii were found, in one line.
    pub radii_text: String,
    /// What was guessed when the particles were read, one line each.
    pub conventions: Vec<String>,
    /// The files that they came from.
    pub sources: Vec<String>,
    /// The program that writes, and its version; what is beyond 64 bytes is left out.
    pub writer: String,
}

/// What was built.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The size of the file.
    pub file_bytes: u64,
    /// What centers, radii and nodes of the structure take.
    pub structure_bytes: u64,
    /// What packing cost, where centers are packed.
    pub packing_error: Option<PackingError>,
}

/// Writes particles and the structure over them, with their own radii, to `path`, whole or not at all. Stages "write", in bytes, "build", and "write" again.
///
/// Fails with [`Error::Setting`] for brute force and without radii, with [`Error::Io`] if the system refuses, and when interrupted.
pub fn build(path: &Path, particles: Particles, recipe: Recipe, progress: &dyn Progress) -> Result<Written> {
    if recipe.kind == Kind::Brute {
        let allowed = "bvh, pkd or treelets: brute force has nothing to save";
        return Err(Error::setting("--structure", "brute", allowed));
    }
    let Some(radii) = particles.radii().cloned() else {
        return Err(Error::setting("radii", "none", "those of the structure: give the particles some"));
    };
    let mut failed = None;
    let mut written = None;
    let filled = atomically(path, |out| match write(out, path, (particles, &radii), recipe, progress) {
        Ok(done) => {
            written = Some(done);
            Ok(())
        }
        Err(error) => {
            failed = Some(error);
            // Its own error is told; this one only ends the writing.
            Err(io::Error::other("it was not built"))
        }
    });
    match (failed, written) {
        (Some(error), _) => Err(error),
        (None, Some(written)) => filled.map(|()| written),
        (None, None) => filled.and(Err(Error::io(path, io::Error::other("nothing was written")))),
    }
}

fn write<W: Write + Seek>(
    out: &mut BufWriter<W>,
    path: &Path,
    (particles, radii): (Particles, &Radii),
    recipe: Recipe,
    progress: &dyn Progress,
) -> Result<Written> {
    let io = |error: io::Error| match progress.cancelled() {
        true => Error::Interrupted,
        false => Error::io(path, error),
    };
    let Recipe { kind, radii_text, conventions, sources, writer: program } = recipe;
    let spheres = Spheres { particles: &particles, radii, radius_scale: 1.0 };
    let guesses = Guesses::of(spheres, radii_text);
    let about = About::of(&particles, radii, &guesses, sources, conventions);

    progress.begin("write", Some(particles.bytes()), "B");
    let mut writer = Writer::new(out, progress).map_err(io)?;
    for (axis, column) in ["x", "y", "z"].iter().zip(particles.positions().offsets()) {
        writer.section(&format!("position.{axis}"), "f32", bytemuck::cast_slice(column)).map_err(io)?;
    }
    for (place, attribute) in particles.attributes().iter().enumerate() {
        let (kind, bytes) = memory(attribute.values.view());
        writer.section(&format!("attribute.{place}"), kind, bytes).map_err(io)?;
    }
    if let Some(places) = particles.places() {
        writer.section("places", "u64", bytemuck::cast_slice(places)).map_err(io)?;
    }
    if !particles.bonds().is_empty() {
        writer.section("bonds", "u32", bytemuck::cast_slice(particles.bonds())).map_err(io)?;
    }
    writer.section("sample", "f32", bytemuck::cast_slice(&guesses.sample)).map_err(io)?;

    let structure = Structure::build(kind, particles, radii, 1.0, progress)?;
    let (facts, arrays) = structure.saved().expect("it is not brute force, and radii are as they were built");
    let bytes = arrays.iter().map(|(_, bytes)| bytes.len() as u64).sum();
    progress.begin("write", Some(bytes), "B");
    for (name, bytes) in arrays {
        let kind = match name {
            "ids" => "u32",
            "x" | "y" | "z" => "f32",
            "axes" => "u8",
            _ => "record",
        };
        writer.section(&format!("structure.{name}"), kind, bytes).map_err(io)?;
    }
    let text = about.with_structure(&facts).text();
    // What JSON cannot hold is refused now, not when the file is opened.
    About::parse(path, &text)?;
    writer.section("about", "json", &text).map_err(io)?;
    Ok(Written {
        file_bytes: writer.finish(&program).map_err(io)?,
        structure_bytes: structure.bytes(),
        packing_error: structure.packing_error().copied(),
    })
}

/// The kind of some values, and their memory.
fn memory(values: View<'_>) -> (&'static str, &[u8]) {
    match values {
        View::F32(column) => ("f32", bytemuck::cast_slice(column)),
        View::F64(column) => ("f64", bytemuck::cast_slice(column)),
        View::I32(column) => ("i32", bytemuck::cast_slice(column)),
        View::I64(column) => ("i64", bytemuck::cast_slice(column)),
        View::U8(column) => ("u8", column),
        View::Text { codes, .. } => ("u32", bytemuck::cast_slice(codes)),
    }
}
