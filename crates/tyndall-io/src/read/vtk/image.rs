//! Image data: samples at equal distances.

use std::path::Path;

use rayon::prelude::*;
use tyndall::{Error, Result};

use super::data::Array;
use super::xml::Document;
use super::{legacy, source};
use crate::read::lattice::{self, Samples};

/// An image, whose blocks lie side by side.
#[derive(Debug)]
pub(super) struct Image<'a> {
    /// The numbers of its first and its last points along x, y, z.
    pub(super) extent: [[i64; 2]; 3],
    /// Where point 0 0 0 lies.
    pub(super) origin: [f64; 3],
    pub(super) spacing: [f64; 3],
    pub(super) blocks: Vec<Block<'a>>,
}

/// A part of an image.
#[derive(Debug)]
pub(super) struct Block<'a> {
    pub(super) extent: [[i64; 2]; 3],
    /// Values at its points, and in the cells between them.
    pub(super) points: Vec<Array<'a>>,
    pub(super) cells: Vec<Array<'a>>,
}

/// Reads the scalars of the first of `names` that is there, or the first ones, of points if there are such, else of cells; and their name.
pub(crate) fn image(path: &Path, bytes: &[u8], names: &[&str]) -> Result<(Samples, String)> {
    if legacy::recognise(bytes) {
        return legacy::image(path, bytes)?.samples(path, names);
    }
    Document::read(path, bytes)?.image()?.samples(path, names)
}

/// A file without samples at equal distances.
pub(super) fn no_image(path: &Path, kind: &str) -> Error {
    let what = format!("this is no image of samples at equal distances, but '{kind}'");
    Error::format(path, "", what, "save it in ParaView as .vti (filter Resample To Image)")
}

/// How many samples lie along x, y, z; `None` if that is no size.
fn size_of(extent: [[i64; 2]; 3], of_cells: bool) -> Option<[usize; 3]> {
    let mut size = [0; 3];
    for (size, [first, last]) in size.iter_mut().zip(extent) {
        let points = usize::try_from(last.checked_sub(first)?.checked_add(1)?).ok()?;
        // What is flat has one layer of cells.
        *size = if of_cells && points > 1 { points - 1 } else { points };
    }
    Some(size)
}

impl Image<'_> {
    fn samples(&self, path: &Path, wanted: &[&str]) -> Result<(Samples, String)> {
        let fault = |what: String, hint: &str| Error::format(path, "", what, hint);
        let first =
            self.blocks.first().ok_or_else(|| fault("the image has no samples".into(), "save it again"))?;
        let all = first.points.iter().map(|it| (it, false)).chain(first.cells.iter().map(|it| (it, true)));
        let scalars = all.filter(|(it, _)| it.components == 1);
        let names: Vec<&str> = scalars.clone().map(|(it, _)| it.name.as_str()).collect();
        let named = |name: &&str| scalars.clone().find(|(it, _)| it.name == *name);
        let chosen =
            wanted.iter().find_map(named).or_else(|| scalars.clone().next().filter(|_| wanted.is_empty()));
        let (chosen, of_cells) = chosen.ok_or_else(|| match wanted {
            [] => fault("the image has no scalars".into(), "a density is an array of one component"),
            _ => lattice::absent(wanted, &format!("scalars of the file: {}", names.join(", "))),
        })?;
        let is_some = |size: &[usize; 3]| Samples::count(*size).is_some_and(|it| it > 0);
        let size = size_of(self.extent, of_cells).filter(is_some);
        let size =
            size.ok_or_else(|| fault(format!("{:?} is no size of an image", self.extent), "save it again"))?;

        let mut decoded = Vec::new();
        for block in &self.blocks {
            let arrays = if of_cells { &block.cells } else { &block.points };
            let array = arrays.iter().find(|it| it.name == chosen.name && it.components == 1);
            let array = array
                .ok_or_else(|| fault(format!("not all pieces have '{}'", chosen.name), "save it again"))?;
            let place = |axis: usize| {
                let first = block.extent[axis][0].checked_sub(self.extent[axis][0])?;
                usize::try_from(first).ok()
            };
            let from = place(0).zip(place(1)).zip(place(2)).map(|((x, y), z)| [x, y, z]);
            let inside = |(from, part): &([usize; 3], [usize; 3])| {
                (0..3).all(|axis| from[axis].checked_add(part[axis]).is_some_and(|end| end <= size[axis]))
            };
            let part = from.zip(size_of(block.extent, of_cells).filter(is_some)).filter(inside);
            let (from, part) = part.ok_or_else(|| {
                fault(format!("a piece {:?} is not within the image", block.extent), "save it again")
            })?;
            let (bytes, order) = array.decode(path, part.iter().product())?;
            decoded.push((array, from, part, bytes, order));
        }
        // All blocks have their bytes; those that together fill the image are as many as it has samples.
        let found: usize = decoded.iter().map(|it| it.2.iter().product::<usize>()).sum();
        let count: usize = size.iter().product();
        if found < count {
            return Err(fault(
                format!("the image has {count} samples, its pieces have {found}"),
                "save it as one piece",
            ));
        }
        let mut values = vec![0.0; count];
        for (array, from, part, bytes, order) in &decoded {
            let source = source(array, bytes, *order);
            let planes = values.par_chunks_mut(size[0] * size[1]).skip(from[2]).take(part[2]).enumerate();
            planes.for_each(|(z, plane)| {
                let rows = plane.chunks_mut(size[0]).skip(from[1]).take(part[1]).enumerate();
                for (y, row) in rows {
                    for (x, value) in row[from[0]..][..part[0]].iter_mut().enumerate() {
                        *value = source.number((z * part[1] + y) * part[0] + x) as f32;
                    }
                }
            });
        }
        let half = if of_cells { 0.5 } else { 0.0 };
        let origin = std::array::from_fn(|axis| {
            let layers = self.extent[axis][1] > self.extent[axis][0];
            let offset = self.extent[axis][0] as f64 + if layers { half } else { 0.0 };
            self.origin[axis] + offset * self.spacing[axis]
        });
        Ok((Samples { size, origin, spacing: self.spacing, values }, chosen.name.clone()))
    }
}
