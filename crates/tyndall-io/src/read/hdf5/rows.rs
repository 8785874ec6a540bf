//! The rows of a data set, a particle each: read some at a time, by several threads at once.

use std::ops::{Deref, Range};
use std::path::PathBuf;
use std::sync::OnceLock;

use hdf5_reader::error::Error as ReadError;
use hdf5_reader::messages::datatype::Datatype;
use hdf5_reader::{Dataset, SliceInfo, SliceInfoElem};
use tyndall::{Error, Result};

use super::attributes::number_kind;
use super::chunks::{Chunks, Found};
use super::data::Data;
use super::forms::Form;
use super::tree::{fault, missing_filter, most_bytes};
use crate::read::numbers::{Kind, Order};
use crate::read::records::Source;

/// In which order this machine has the bytes of a number.
pub(super) const NATIVE: Order = if cfg!(target_endian = "big") { Order::Big } else { Order::Little };

/// Rows that a thread decodes at a time, if chunks do not make that more.
pub(super) const BATCH_ROWS: usize = 1 << 16;
/// The most that chunks make it which the crate unpacks.
const MOST_BATCH_ROWS: usize = 1 << 20;

/// More numbers than this are no quantity of a particle.
pub(super) const MOST_WIDTH: u64 = 1 << 12;

impl Data {
    /// Its rows as those of a quantity of particles, beside their positions; or why it is to be left out, where its rows are no quantity or
    /// need a filter that is not built in.
    pub(super) fn quantity(self, lead: &[u64]) -> Result<std::result::Result<Rows, String>> {
        let width: u64 =
            self.shape().iter().skip(lead.len() + 1).fold(1, |width, &it| width.saturating_mul(it));
        if width == 0 || width > MOST_WIDTH {
            return Ok(Err(format!("{width} numbers a row")));
        }
        let rows = self.rows(lead)?;
        if rows.chunks.is_some() {
            return Ok(Ok(rows));
        }
        let first = rows.decode(0..rows.count.min(1));
        Ok(match first.err().and_then(|error| missing_filter(&error)) {
            Some(filter) => Err(format!("it needs {filter}")),
            None => Ok(rows),
        })
    }

    /// Its rows, `lead` being indices of the dimensions before that of the particles. Fails if the file cannot hold them, or if
    /// what is in it are no numbers.
    pub(super) fn rows(self, lead: &[u64]) -> Result<Rows> {
        let fault = |what: String| {
            Error::format(&self.file, &self.path, what, "was the file copied to its end? h5dump may say more")
        };
        let (stored, order) =
            number_kind(self.dataset.dtype()).ok_or_else(|| fault("these are no numbers".into()))?;
        let form = self.form();
        let shape = self.dataset.shape();
        if shape.len() <= lead.len() || lead.iter().zip(shape).any(|(index, size)| index >= size) {
            return Err(fault(format!("an extent of {shape:?} has no place {lead:?}")));
        }
        let count = shape[lead.len()];
        let width = shape[lead.len() + 1..].iter().try_fold(1u64, |product, &size| product.checked_mul(size));
        let bytes = width.and_then(|it| it.checked_mul(count)?.checked_mul(stored.size() as u64));
        let fits = bytes.is_some_and(|bytes| bytes <= most_bytes(self.file_bytes));
        if width.is_some_and(|width| width == 0 || width > MOST_WIDTH) {
            return Err(fault(format!("an extent of {shape:?} is not 1 to {MOST_WIDTH} numbers a row")));
        }
        if !fits {
            let what =
                format!("an extent of {shape:?} is more than a file of {} bytes can hold", self.file_bytes);
            return Err(fault(what));
        }
        let width = width.expect("it fits") as usize;
        let chunk_rows =
            self.dataset.chunks().and_then(|it| it.get(lead.len()).copied()).map_or(0, |it| it as usize);
        let chunks = self.chunks.filter(|it| count > 0 && it.are_rows(lead.len())).and_then(|chunks| {
            // What is wrong with them, the crate says.
            let found = chunks.find(lead, 0..count as usize).ok().flatten()?;
            Some(Box::new((chunks, found)))
        });
        Ok(Rows {
            chunks,
            is_swapped: order != NATIVE,
            dataset: Box::new(self.dataset),
            path: self.path,
            file: self.file,
            lead: lead.to_vec(),
            kind: form.map_or(stored, |it| it.kind(stored)),
            stored,
            form,
            first: 0,
            count: count as usize,
            width,
            chunk_rows,
            whole: OnceLock::new(),
        })
    }
}

/// Numbers in this machine's order of bytes.
pub(super) struct Native(Box<dyn AsRef<[u8]> + Send>);

impl Native {
    pub(super) fn of<T: bytemuck::NoUninit + Send>(numbers: Vec<T>) -> Self {
        struct Owned<T>(Vec<T>);
        impl<T: bytemuck::NoUninit> AsRef<[u8]> for Owned<T> {
            fn as_ref(&self) -> &[u8] {
                bytemuck::cast_slice(&self.0)
            }
        }
        Self(Box::new(Owned(numbers)))
    }
}

impl Deref for Native {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        (*self.0).as_ref()
    }
}

/// The rows of a data set, a particle each.
pub(super) struct Rows {
    dataset: Box<Dataset>,
    path: String,
    file: PathBuf,
    lead: Vec<u64>,
    /// The type of the numbers.
    pub(super) kind: Kind,
    /// That in which they are stored, and where their bits are in it, if that is no machine's own.
    stored: Kind,
    form: Option<Form>,
    /// The place of the first row in the data set.
    first: usize,
    /// How many rows there are.
    pub(super) count: usize,
    /// Numbers in a row.
    pub(super) width: usize,
    /// Rows of a chunk; 0 if there are no chunks.
    pub(super) chunk_rows: usize,
    /// Its chunks, if they are large.
    chunks: Option<Box<(Chunks, Found)>>,
    /// Whether its numbers are stored in the other order of bytes.
    is_swapped: bool,
    /// All of it, where its type can only be read as a whole.
    whole: OnceLock<Vec<u8>>,
}

impl Rows {
    /// The data set's path in the file.
    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// Those of its rows, all of which must be there.
    pub(super) fn within(self, rows: Range<usize>) -> Option<Self> {
        let fits = rows.start <= rows.end && rows.end <= self.count;
        // Only rows of one frame are counted among those of others.
        let whole = rows == (0..self.count);
        (fits && (whole || self.lead.is_empty())).then(|| Self {
            first: self.first + rows.start,
            count: rows.len(),
            ..self
        })
    }

    /// Some of its rows.
    pub(super) fn read(&self, rows: Range<usize>) -> Result<Native> {
        if self.chunks.is_none() {
            return self.decode(rows).map_err(|error| fault(&self.file, &self.path, &error));
        }
        let mut all = Vec::with_capacity(rows.len() * self.width * self.kind.size());
        self.read_each(rows, |numbers, _| all.extend_from_slice(&numbers))?;
        Ok(Native::of(all))
    }

    /// Rows for which a thread has work: whole chunks, so that none is unpacked twice.
    pub(super) fn batch_rows(&self) -> usize {
        match self.chunk_rows {
            0 => BATCH_ROWS,
            rows if self.chunks.is_some() => rows.saturating_mul(BATCH_ROWS.div_ceil(rows)),
            rows => rows.saturating_mul(BATCH_ROWS.div_ceil(rows)).min(MOST_BATCH_ROWS),
        }
    }

    /// The memory that a thread needs for a chunk.
    pub(super) fn working_bytes(&self) -> usize {
        let row = self.width * self.stored.size();
        // The crate has a chunk with its bytes shuffled and not, and rows of it.
        if self.chunks.is_some() { self.chunk_rows * row } else { 3 * self.chunk_rows.saturating_mul(row) }
    }

    /// Gives some of its rows to `take`, in order and some at a time, with their places among `rows`.
    pub(super) fn read_each(
        &self,
        rows: Range<usize>,
        mut take: impl FnMut(Native, Range<usize>),
    ) -> Result<()> {
        let fault = |error: ReadError| fault(&self.file, &self.path, &error);
        let Some((chunks, found)) = self.chunks.as_deref() else {
            for first in rows.clone().step_by(self.batch_rows()) {
                let some = first..rows.end.min(first + self.batch_rows());
                let numbers = self.decode(some.clone()).map_err(fault)?;
                take(numbers, some.start - rows.start..some.end - rows.start);
            }
            return Ok(());
        };
        let stored = self.first + rows.start..self.first + rows.end;
        let each = chunks.read_each(found, stored, |mut numbers, rows| {
            if self.is_swapped {
                numbers.chunks_exact_mut(self.stored.size()).for_each(<[u8]>::reverse);
            }
            let numbers = match self.form {
                Some(form) => form.apply(&numbers, self.stored.size()),
                None => Native::of(numbers),
            };
            take(numbers, rows);
        });
        each.map_err(fault)
    }

    fn decode(&self, rows: Range<usize>) -> std::result::Result<Native, ReadError> {
        let stored = self.as_stored(self.first + rows.start..self.first + rows.end)?;
        Ok(match self.form {
            Some(form) => form.apply(&stored, self.stored.size()),
            None => stored,
        })
    }

    fn as_stored(&self, rows: Range<usize>) -> std::result::Result<Native, ReadError> {
        let is_plain =
            matches!(self.dataset.dtype(), Datatype::FixedPoint { .. } | Datatype::FloatingPoint { .. });
        match self.stored {
            _ if rows.is_empty() => Ok(Native::of(Vec::<u8>::new())),
            _ if !is_plain => self.cut(rows),
            Kind::F16 => self.cut(rows),
            Kind::I8 => self.slice::<i8>(rows),
            Kind::U8 => self.slice::<u8>(rows),
            Kind::I16 => self.slice::<i16>(rows),
            Kind::U16 => self.slice::<u16>(rows),
            Kind::I32 => self.slice::<i32>(rows),
            Kind::U32 => self.slice::<u32>(rows),
            Kind::I64 => self.slice::<i64>(rows),
            Kind::U64 => self.slice::<u64>(rows),
            Kind::F32 => self.slice::<f32>(rows),
            Kind::F64 => self.slice::<f64>(rows),
        }
    }

    fn slice<T: hdf5_reader::H5Type + bytemuck::NoUninit + Send>(
        &self,
        rows: Range<usize>,
    ) -> std::result::Result<Native, ReadError> {
        let mut selections: Vec<_> = self.lead.iter().map(|&index| SliceInfoElem::Index(index)).collect();
        selections.push(SliceInfoElem::Slice { start: rows.start as u64, end: rows.end as u64, step: 1 });
        let all = SliceInfoElem::Slice { start: 0, end: u64::MAX, step: 1 };
        selections.resize(self.dataset.ndim(), all);
        let array = self.dataset.read_slice::<T>(&SliceInfo { selections })?;
        if array.len() != rows.len() * self.width {
            return Err(ReadError::InvalidData("a selection has another size than its rows".into()));
        }
        if !array.is_standard_layout() {
            return Ok(Native::of(array.iter().copied().collect::<Vec<T>>()));
        }
        let count = array.len();
        let (mut numbers, first) = array.into_raw_vec_and_offset();
        numbers.drain(..first.unwrap_or(0));
        numbers.truncate(count);
        Ok(Native::of(numbers))
    }

    fn cut(&self, rows: Range<usize>) -> std::result::Result<Native, ReadError> {
        let whole = match self.whole.get() {
            Some(whole) => whole,
            None => {
                let bytes = self.dataset.read_native_bytes()?;
                self.whole.get_or_init(|| bytes)
            }
        };
        // Places before this frame's first row, the last dimension running fastest.
        let lead =
            self.lead.iter().zip(self.dataset.shape()).fold(0, |place, (&index, &size)| place * size + index);
        let row = self.width * self.stored.size();
        let first = lead as usize * self.count;
        let bytes = whole.get((first + rows.start) * row..(first + rows.end) * row);
        bytes
            .map(|it| Native::of(it.to_vec()))
            .ok_or_else(|| ReadError::InvalidData("a data set is shorter than its extent".into()))
    }

    /// Its numbers, for a small data set.
    pub(super) fn numbers(&self) -> Result<Vec<f64>> {
        let bytes = self.read(0..self.count)?;
        let size = self.kind.size();
        let source =
            Source { bytes: &bytes, kind: self.kind, order: NATIVE, start: 0, stride: size, step: 0 };
        Ok((0..bytes.len() / size).map(|place| source.number(place)).collect())
    }
}
