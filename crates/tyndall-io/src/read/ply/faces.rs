//! The faces of a PLY file, with their corners: every value is walked over, as lists have any length.

use std::path::Path;

use glam::DVec3;
use tyndall::{Error, Result};

use super::header::{Element, Encoding, Header, Shape};
use super::{CUT_OFF, cut_off, split_property};
use crate::read::mesh::Faces;
use crate::read::numbers::{Kind, Order};
use crate::read::records::Source;

/// Names of the corners of a face.
const LISTS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Reads them. Without faces there are none; elements of other names are passed over.
pub(in crate::read) fn faces(path: &Path, bytes: &[u8]) -> Result<Faces> {
    let header = Header::read(path, bytes)?;
    let vertex = header.vertex(path)?;
    let mut values = Values { rest: &bytes[header.body..], encoding: header.encoding };
    let mut faces = Faces::default();
    let mut row = Row::default();
    for (place, element) in header.elements.iter().enumerate() {
        let (is_vertex, is_face) = (place == vertex, element.name.eq_ignore_ascii_case("face"));
        if is_vertex {
            let names: Vec<String> = element.properties.iter().map(|it| it.name.to_lowercase()).collect();
            if !["x", "y", "z"].iter().all(|axis| names.iter().any(|name| name == axis)) {
                let what = format!("the vertices need properties x, y, z; they have: {}", names.join(", "));
                return Err(Error::format(
                    path,
                    "header",
                    what,
                    "rename the properties that hold the positions",
                ));
            }
        }
        // Rows of nothing are nothing, however many.
        let rows = if element.properties.is_empty() { 0 } else { element.count };
        for number in 0..rows {
            values.row(element, &mut row).ok_or_else(|| cut_off(path, element, number, bytes.len()))?;
            if is_vertex {
                faces.corners.push(DVec3::from(row.point));
            } else if is_face {
                let polygon: Option<Vec<u32>> = row.corners.iter().map(|&place| whole(place)).collect();
                let polygon = polygon.ok_or_else(|| {
                    let what = format!("corners {:?} are no places of vertices", row.corners);
                    Error::format(path, format!("face {number}"), what, CUT_OFF)
                })?;
                faces.add(&polygon);
            }
        }
    }
    Ok(faces)
}

/// A number as a place.
fn whole(number: f64) -> Option<u32> {
    (number >= 0.0 && number <= f64::from(u32::MAX) && number.fract() == 0.0).then_some(number as u32)
}

/// What a mesh needs of a row.
#[derive(Default)]
struct Row {
    point: [f64; 3],
    corners: Vec<f64>,
}

/// The values behind the header.
struct Values<'a> {
    rest: &'a [u8],
    encoding: Encoding,
}

impl Values<'_> {
    /// Reads a row; none if it is not whole.
    fn row(&mut self, element: &Element, row: &mut Row) -> Option<()> {
        row.corners.clear();
        for property in &element.properties {
            let axis = ["x", "y", "z"].iter().position(|axis| property.name.eq_ignore_ascii_case(axis));
            let is_wanted = LISTS.iter().any(|name| property.name.eq_ignore_ascii_case(name));
            match (self.encoding, property.shape) {
                (Encoding::Text, Shape::Scalar(_)) => {
                    let number = self.word()?;
                    if let Some(axis) = axis {
                        row.point[axis] = number;
                    }
                }
                (Encoding::Text, Shape::List { .. }) => {
                    for _ in 0..whole(self.word()?)? {
                        let number = self.word()?;
                        if is_wanted {
                            row.corners.push(number);
                        }
                    }
                }
                (Encoding::Binary(order), shape) => {
                    let (value, rest) = split_property(property, self.rest, order)?;
                    self.rest = rest;
                    match (shape, axis) {
                        (Shape::Scalar(kind), Some(axis)) => row.point[axis] = number(value, kind, order),
                        (Shape::List { length, item }, _) if is_wanted => {
                            let items = value[length.size()..].chunks_exact(item.size());
                            row.corners.extend(items.map(|bytes| number(bytes, item, order)));
                        }
                        _ => {}
                    }
                }
            }
        }
        Some(())
    }

    /// The next word of a text as a number; what is none is NaN.
    fn word(&mut self) -> Option<f64> {
        let text = self.rest.trim_ascii_start();
        let length = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
        let (word, rest) = text.split_at(length);
        self.rest = rest;
        (!word.is_empty()).then(|| fast_float2::parse(word).unwrap_or(f64::NAN))
    }
}

fn number(bytes: &[u8], kind: Kind, order: Order) -> f64 {
    Source { bytes, kind, order, start: 0, stride: 0, step: 0 }.number(0)
}
