//! STL: triangles without common corners.

use std::path::Path;

use glam::Vec3;
use tyndall::{Error, Result};

use super::{Faces, lines, point};

/// A comment and the count of triangles.
const HEAD_BYTES: usize = 84;
/// A normal, three corners, and two bytes for what nobody agreed on.
const TRIANGLE_BYTES: usize = 50;

/// Whether it has just the size that a binary file says.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    let count = bytes.get(80..HEAD_BYTES).and_then(|count| count.try_into().ok()).map(u32::from_le_bytes);
    count.is_some_and(|count| {
        (count as u64).checked_mul(TRIANGLE_BYTES as u64) == Some((bytes.len() - HEAD_BYTES) as u64)
    })
}

/// Whether it begins like a text.
pub(super) fn is_text(bytes: &[u8]) -> bool {
    let begin = bytes.trim_ascii_start();
    begin.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
}

/// Reads a binary file.
pub(super) fn read_binary(bytes: &[u8]) -> Faces {
    let mut faces = Faces::default();
    for triangle in bytes[HEAD_BYTES..].chunks_exact(TRIANGLE_BYTES) {
        let first = faces.corners.len() as u32;
        let corners = triangle[12..48].chunks_exact(12).map(|corner| {
            let mut numbers = [0.0; 3];
            for (number, bytes) in numbers.iter_mut().zip(corner.as_chunks().0) {
                *number = f32::from_le_bytes(*bytes);
            }
            Vec3::from(numbers).as_dvec3()
        });
        faces.corners.extend(corners);
        faces.triangles.push([first, first + 1, first + 2]);
    }
    faces
}

/// Reads a text: what counts are the lines `vertex X Y Z`, three a loop.
pub(super) fn read_text(path: &Path, bytes: &[u8]) -> Result<Faces> {
    let mut faces = Faces::default();
    let mut in_loop = 0;
    for (number, line) in lines(bytes) {
        let wrong = |what: String| {
            let hint = "the file is cut off or damaged: copy it again or write it again";
            Error::format(path, format!("line {number}"), what, hint)
        };
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some(word) if word.eq_ignore_ascii_case("vertex") => {
                let corner = point(words)
                    .ok_or_else(|| wrong(format!("'vertex X Y Z' was wanted, '{line}' was found")))?;
                faces.corners.push(corner);
                in_loop += 1;
            }
            Some(word) if word.eq_ignore_ascii_case("endloop") => {
                if in_loop < 3 {
                    return Err(wrong(format!("three corners were wanted, {in_loop} were found")));
                }
                let end = faces.corners.len() as u32;
                let polygon: Vec<u32> = (end - in_loop..end).collect();
                faces.add(&polygon);
                in_loop = 0;
            }
            _ => {}
        }
    }
    match in_loop {
        0 => Ok(faces),
        _ => {
            let hint = "the file is cut off: copy it again or write it again";
            Err(Error::format(path, "", "the file ends within a triangle", hint))
        }
    }
}
