//! The rows of an array of positions, read where they stand in the file.

use std::path::Path;

use tyndall::{DVec3, Error, Result};

use super::header::{Element, Fault, Header, Scalar};
use super::is_archive;
use crate::read::map::Map;
use crate::read::numbers::{Kind, Order};
use crate::read::records::{Source, truncated};

/// A mapped array of shape (N, 3) in C order.
pub(crate) struct Rows {
    map: Map,
    scalar: (Kind, Order),
    start: usize,
    count: usize,
}

impl Rows {
    /// Over the array in a file; `None` if it is of another kind. Fails if the header is broken or promises more than is there.
    pub(crate) fn over(path: &Path, map: Map) -> Result<Option<Self>> {
        if is_archive(&map) {
            return Ok(None);
        }
        let header = Header::read(&map).map_err(|(what, hint): Fault| Error::format(path, "", what, hint))?;
        let (Element::Scalar(Scalar::Number(kind, order)), [count, 3], false) =
            (&header.element, &header.shape[..], header.fortran_order)
        else {
            return Ok(None);
        };
        let rows = Self { scalar: (*kind, *order), start: header.start, count: *count, map };
        match rows.axis(2).end(rows.count.max(1), 1) {
            _ if rows.count == 0 => Ok(Some(rows)),
            Some(end) if end <= rows.map.len() => Ok(Some(rows)),
            _ => {
                let available = rows.map.len() - rows.start.min(rows.map.len());
                Err(truncated(path, rows.count as u64, 3 * kind.size(), available))
            }
        }
    }

    /// How many there are.
    pub(crate) fn len(&self) -> u64 {
        self.count as u64
    }

    /// The position in row `id`.
    pub(crate) fn position(&self, id: u64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|axis| self.axis(axis).number(id as usize)))
    }

    fn axis(&self, axis: usize) -> Source<'_> {
        let (kind, order) = self.scalar;
        let step = kind.size();
        Source { bytes: &self.map, kind, order, start: self.start + axis * step, stride: 3 * step, step }
    }
}
