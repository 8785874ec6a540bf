//! Meshes of triangles: STL (binary and text), OBJ, and the faces of PLY.
//!
//! Takes a file, which may be compressed, gives its triangles; polygons are cut into fans. What it is, is decided by its content. Colors, normals and
//! textures are passed over. Sources: 3D Systems, "StereoLithography Interface Specification", 1989; Wavefront, "Object Files (.obj)", 1992. Binary
//! STL files may begin with the word of text ones, so that their size decides.

mod obj;
mod stl;
#[cfg(test)]
mod tests;

use std::path::Path;

use glam::DVec3;
use tyndall::structure::shapes::Mesh;
use tyndall::{Error, Result};

use super::content::content;
use super::ply;

/// Corners, and faces by the places of their corners.
#[derive(Default)]
pub(super) struct Faces {
    pub(super) corners: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Faces {
    /// Adds a polygon as a fan around its first corner; what has less than three corners has no area.
    pub(super) fn add(&mut self, polygon: &[u32]) {
        if let [first, rest @ ..] = polygon {
            self.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        }
    }
}

/// Reads the triangles of a file, which is asked for by `setting`, as errors call it.
///
/// Fails with [`Error::Io`] if it cannot be read, with [`Error::Format`] or [`Error::Setting`] if it is no mesh, has no faces, names corners that are
/// not there, or has corners that are not finite.
pub fn mesh(setting: &str, path: &Path) -> Result<Mesh> {
    mesh_of(setting, path, content(path)?.as_ref())
}

/// The same from the content of a file.
fn mesh_of(setting: &str, path: &Path, bytes: &[u8]) -> Result<Mesh> {
    let faces = if ply::recognise(bytes) {
        ply::faces(path, bytes)?
    } else if stl::is_binary(bytes) {
        stl::read_binary(bytes)
    } else if stl::is_text(bytes) {
        stl::read_text(path, bytes)?
    } else if obj::recognise(bytes) {
        obj::read(path, bytes)?
    } else {
        let hint = "give an STL, OBJ or PLY file that is whole; other formats can be converted, as by MeshLab or Blender";
        return Err(Error::format(path, "", "this is no mesh that is known", hint));
    };
    let name = format!("{setting} {}", path.display());
    Mesh::new(&name, faces.corners, faces.triangles)
}

/// Lines of a text with their numbers, counted from 1, as far as they are text.
fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, &str)> {
    let lines = bytes.split(|&byte| byte == b'\n');
    (1..).zip(lines.map(|line| str::from_utf8(line).unwrap_or("\u{fffd}").trim()))
}

/// Three numbers.
fn point<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<DVec3> {
    let mut next = || fast_float2::parse(words.next()?).ok();
    Some(DVec3::new(next()?, next()?, next()?))
}
