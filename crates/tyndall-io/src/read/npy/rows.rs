//! The rows of an array of particles, read where they stand in the file.

use std::ops::Range;
use std::path::{Path, PathBuf};

use tyndall::scene::wanted::Wanted;
use tyndall::{DVec3, Error, Particles, Result};

use super::header::{Element, Fault, Header};
use super::quantity::Array;
use super::{Notes, assemble, is_archive, take_positions};
use crate::read::map::Map;
use crate::read::numbers::{Kind, Order};
use crate::read::records::{Source, truncated};

/// A mapped array in C order, a particle a row: numbers of shape (N, 2) or more, or structures of shape (N).
pub(crate) struct Rows {
    path: PathBuf,
    map: Map,
    header: Header,
    row_bytes: usize,
    /// Where the coordinates of a row stand; what is not there is 0.
    axes: [Option<Axis>; 3],
}

/// A coordinate in a row.
#[derive(Clone, Copy)]
struct Axis {
    kind: Kind,
    order: Order,
    start: usize,
}

impl Rows {
    /// Over the array in a file; `None` if it is of another kind. Fails if the header is broken or promises more than is there.
    pub(crate) fn over(path: &Path, map: Map) -> Result<Option<Self>> {
        if is_archive(&map) {
            return Ok(None);
        }
        let header = Header::read(&map).map_err(|(what, hint): Fault| Error::format(path, "", what, hint))?;
        let columns = match (&header.element, &header.shape[..]) {
            (Element::Record(..), [_]) => 1,
            // Three rows may be coordinates.
            (Element::Scalar(_), [3, columns]) if *columns > 4 => return Ok(None),
            (Element::Scalar(_), [_, columns]) if *columns > 1 && !header.fortran_order => *columns,
            _ => return Ok(None),
        };
        let (count, size) = (header.shape[0], header.element.size());
        let available = map.len() - header.start.min(map.len());
        let Some(row_bytes) = columns.checked_mul(size).filter(|it| *it > 0) else { return Ok(None) };
        if row_bytes.checked_mul(count).is_none_or(|needed| needed > available) {
            return Err(truncated(path, count as u64, row_bytes, available));
        }
        let nowhere = Self { path: path.into(), map, header, row_bytes, axes: [None; 3] };
        if count == 0 {
            return Ok(Some(nowhere));
        }
        // What is no array of particles is said by whoever reads it as a whole.
        let first = nowhere.bytes(0..1).to_vec();
        let Ok(axes) = nowhere.axes_of(&first) else { return Ok(None) };
        Ok(Some(Self { axes, ..nowhere }))
    }

    /// How many there are.
    pub(crate) fn len(&self) -> u64 {
        self.header.shape[0] as u64
    }

    /// The position in row `id`.
    pub(crate) fn position(&self, id: u64) -> DVec3 {
        let row = self.header.start + id as usize * self.row_bytes;
        let number = |axis: Axis| {
            let Axis { kind, order, start } = axis;
            Source { bytes: &self.map, kind, order, start: row + start, stride: 0, step: 0 }.number(0)
        };
        DVec3::from_array(self.axes.map(|axis| axis.map_or(0.0, number)))
    }

    /// The particles of some rows, with what of their attributes is wanted, as if these were all.
    pub(crate) fn particles(&self, ids: Range<u64>, wanted: Option<&Wanted>) -> Result<Particles> {
        self.of_rows(self.bytes(ids), wanted)
    }

    /// The same of every `step`th row.
    pub(crate) fn every(&self, step: usize, wanted: Option<&Wanted>) -> Result<Particles> {
        let rows: Vec<u8> =
            (0..self.len()).step_by(step).flat_map(|id| self.bytes(id..id + 1)).copied().collect();
        self.of_rows(&rows, wanted)
    }

    fn bytes(&self, ids: Range<u64>) -> &[u8] {
        let place = |id: u64| self.header.start + id as usize * self.row_bytes;
        &self.map[place(ids.start)..place(ids.end)]
    }

    /// A header for rows that stand alone.
    fn header_of(&self, rows: &[u8]) -> Header {
        let mut shape = self.header.shape.clone();
        shape[0] = rows.len() / self.row_bytes;
        Header { element: self.header.element.clone(), fortran_order: false, shape, start: 0 }
    }

    fn of_rows(&self, rows: &[u8], wanted: Option<&Wanted>) -> Result<Particles> {
        if self.header.shape.len() > 1 && rows.len() == 3 * self.row_bytes {
            // Three rows may be coordinates: a fourth one says that they are not.
            let four = self.of_rows(&[rows, &rows[..self.row_bytes]].concat(), wanted)?;
            let flags: Vec<bool> = (0..four.len()).map(|id| four.place(id) < 3).collect();
            return Ok(four.retained(&flags));
        }
        let (header, mut notes) = (self.header_of(rows), Notes::default());
        let array = Array { name: "", entry: 0, header: &header, bytes: Some(rows) };
        let quantities = array.quantities(&self.path, &mut notes.warnings)?;
        Ok(assemble(&self.path, quantities, wanted, notes, (0, &()))?.particles)
    }

    /// Where the coordinates of a row stand.
    fn axes_of(&self, rows: &[u8]) -> Result<[Option<Axis>; 3]> {
        let (header, mut notes) = (self.header_of(rows), Notes::default());
        let array = Array { name: "", entry: 0, header: &header, bytes: Some(rows) };
        let mut quantities = array.quantities(&self.path, &mut notes.warnings)?;
        let (_, axes) = take_positions(&self.path, &mut quantities, &mut notes)?;
        let axis = |it: Source| Axis { kind: it.kind, order: it.order, start: it.start };
        Ok(axes.map(|it| it.map(axis)))
    }
}
