//! OBJ: corners (`v`) and faces (`f`), whose corners are counted from 1, or back from the last one.

use std::path::Path;

use tyndall::{Error, Result};

use super::{Faces, lines, point};

/// Whether the first of its lines that say something say what OBJ files say.
pub(super) fn recognise(bytes: &[u8]) -> bool {
    const WORDS: [&str; 12] = ["v", "vn", "vt", "vp", "f", "o", "g", "s", "l", "p", "mtllib", "usemtl"];
    let head = &bytes[..bytes.len().min(1 << 16)];
    let mut said =
        lines(head).map(|(_, line)| line).filter(|line| !line.is_empty() && !line.starts_with('#'));
    said.next()
        .and_then(|line| line.split_ascii_whitespace().next())
        .is_some_and(|word| WORDS.contains(&word))
}

/// Reads it.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Faces> {
    let mut faces = Faces::default();
    let mut polygon = Vec::new();
    for (number, line) in lines(bytes) {
        let wrong = |what: String, hint: &str| Error::format(path, format!("line {number}"), what, hint);
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => faces.corners.push(point(words).ok_or_else(|| {
                wrong(
                    format!("'v X Y Z' was wanted, '{line}' was found"),
                    "correct the line or write the file again",
                )
            })?),
            Some("f") => {
                polygon.clear();
                for word in words.take_while(|word| !word.starts_with('#')) {
                    // What stands behind a slash are textures and normals.
                    let place = word.split('/').next().and_then(|place| place.parse().ok());
                    polygon.push(place.and_then(|place| corner(place, faces.corners.len())).ok_or_else(
                        || {
                            let count = faces.corners.len();
                            let what = format!("'{word}' is none of the {count} corners before it");
                            wrong(what, "corners count from 1, or from the last one back: -1")
                        },
                    )?);
                }
                faces.add(&polygon);
            }
            _ => {}
        }
    }
    Ok(faces)
}

/// The place from 0 of a corner that is counted from 1 or back from the last of `count`, if it is one.
fn corner(number: i64, count: usize) -> Option<u32> {
    let count = count as i64;
    let place = if number < 0 { count + number } else { number - 1 };
    u32::try_from(place).ok().filter(|_| place < count)
}
