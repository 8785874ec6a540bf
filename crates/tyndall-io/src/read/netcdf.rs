//! The container NetCDF classic: dimensions, attributes and variables, in its three variants (32-bit, 64-bit offsets, 64-bit data).
//!
//! Takes the bytes, gives a directory: where the values of each variable stand. Variables whose first dimension is the record
//! stand interleaved, a record of all of them after the other. Numbers are big-endian. Invariant: no list in the header is longer
//! than the bytes that it fills. Source: NetCDF Classic Format Specification, Unidata.

use std::path::Path;

use tyndall::Result;

use super::cursor::Cursor;
use super::numbers::{Kind, Order};
use super::records::Source;

const HINT: &str = "check it with ncdump -h, and copy or write it again";

/// Whether the file is NetCDF classic.
pub(super) fn recognise(head: &[u8]) -> bool {
    head.starts_with(b"CDF") && matches!(head.get(3), Some(1 | 2 | 5))
}

/// A variable.
#[derive(Debug)]
pub(super) struct Variable {
    pub(super) name: String,
    /// The places of its dimensions in [`Directory::dimensions`].
    pub(super) dimensions: Vec<usize>,
    attributes: Vec<(String, Value)>,
    /// `None` for letters.
    pub(super) kind: Option<Kind>,
    start: u64,
    /// Bytes of a record, or of all values, rounded up to four.
    bytes: u64,
}

/// The value of an attribute.
#[derive(Debug)]
enum Value {
    Text(String),
    Numbers(Vec<f64>),
}

impl Variable {
    /// The text of an attribute.
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        text(&self.attributes, name)
    }

    /// The first number of an attribute.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.attributes.iter().find_map(|(known, value)| match value {
            Value::Numbers(numbers) if known == name => numbers.first().copied(),
            _ => None,
        })
    }
}

fn text<'a>(attributes: &'a [(String, Value)], name: &str) -> Option<&'a str> {
    attributes.iter().find_map(|(known, value)| match value {
        Value::Text(text) if known == name => Some(text.as_str()),
        _ => None,
    })
}

/// What the header says.
#[derive(Debug)]
pub(super) struct Directory {
    /// Name and length; that of the record is 0.
    pub(super) dimensions: Vec<(String, u64)>,
    attributes: Vec<(String, Value)>,
    pub(super) variables: Vec<Variable>,
    /// Records that the header promises; `None` if the writer did not know.
    pub(super) promised: Option<u64>,
    /// Whole records that are there.
    pub(super) records: u64,
    record_bytes: u64,
}

/// A header while it is read: counts and sizes have eight bytes in the variant 5, places also in 2.
struct Reader<'a> {
    cursor: Cursor<'a>,
    variant: u8,
}

impl Reader<'_> {
    fn count(&mut self, what: &str) -> Result<u64> {
        if self.variant == 5 {
            self.cursor.number(what)
        } else {
            self.cursor.number::<u32>(what).map(u64::from)
        }
    }

    fn name(&mut self) -> Result<String> {
        let length = self.count("the length of a name")?;
        let name = self.cursor.text(usize::try_from(length).unwrap_or(usize::MAX), "a name")?;
        self.cursor.skip(length.wrapping_neg() & 3, "the end of a name")?;
        Ok(name)
    }

    /// How many things of kind `tag` follow.
    fn list(&mut self, tag: u32, what: &str) -> Result<u64> {
        let found: u32 = self.cursor.number(what)?;
        let count = self.count(what)?;
        // Nothing has a tag of 0. Each entry takes eight bytes at least.
        if (found == tag || (found == 0 && count == 0)) && count <= self.cursor.left() as u64 / 8 {
            return Ok(count);
        }
        Err(self.cursor.fault(format!(
            "a list of {what} was wanted, one of kind {found} with {count} entries was found"
        )))
    }

    /// The type behind a number; `None` for letters.
    fn kind(&mut self) -> Result<Option<Kind>> {
        let code: u32 = self.cursor.number("a type")?;
        Ok(Some(match code {
            1 => Kind::I8,
            2 => return Ok(None),
            3 => Kind::I16,
            4 => Kind::I32,
            5 => Kind::F32,
            6 => Kind::F64,
            7 => Kind::U8,
            8 => Kind::U16,
            9 => Kind::U32,
            10 => Kind::I64,
            11 => Kind::U64,
            _ => return Err(self.cursor.fault(format!("types are 1 to 11, {code} was found"))),
        }))
    }

    fn attributes(&mut self) -> Result<Vec<(String, Value)>> {
        let count = self.list(12, "attributes")?;
        (0..count).map(|_| self.attribute()).collect()
    }

    fn attribute(&mut self) -> Result<(String, Value)> {
        let name = self.name()?;
        let kind = self.kind()?;
        let count = self.count("the length of an attribute")?;
        let size = kind.map_or(1, Kind::size) as u64;
        let length = count.saturating_mul(size);
        let bytes = self.cursor.take(usize::try_from(length).unwrap_or(usize::MAX), "an attribute")?;
        self.cursor.skip(length.wrapping_neg() & 3, "the end of an attribute")?;
        let value = match kind {
            None => Value::Text(String::from_utf8_lossy(bytes).trim_end_matches('\0').to_string()),
            Some(kind) => {
                let step = kind.size();
                let source = Source { bytes, kind, order: Order::Big, start: 0, stride: step, step };
                Value::Numbers((0..count as usize).map(|place| source.number(place)).collect())
            }
        };
        Ok((name, value))
    }

    fn variable(&mut self, dimensions: &[(String, u64)]) -> Result<Variable> {
        let name = self.name()?;
        let rank = self.count("the number of dimensions")?;
        if rank > self.cursor.left() as u64 / 4 {
            return Err(self.cursor.fault(format!("variable '{name}' has {rank} dimensions")));
        }
        let mut places = Vec::new();
        for _ in 0..rank {
            let place = self.count("a dimension")?;
            let known = usize::try_from(place).ok().filter(|&it| it < dimensions.len());
            places.push(
                known.ok_or_else(|| self.cursor.fault(format!("variable '{name}' has dimension {place}")))?,
            );
        }
        let attributes = self.attributes()?;
        let kind = self.kind()?;
        let _size = self.count("the size of a variable")?; // Too small a field for large ones: found again below.
        let start = match self.variant {
            1 => u64::from(self.cursor.number::<u32>("the place of a variable")?),
            _ => self.cursor.number("the place of a variable")?,
        };
        let lengths = places.iter().map(|&it| dimensions[it].1).enumerate();
        // The first dimension may be the record, which counts once.
        let values = lengths
            .map(|(place, length)| if place == 0 && length == 0 { 1 } else { length })
            .try_fold(1u64, u64::checked_mul)
            .and_then(|values| values.checked_mul(kind.map_or(1, Kind::size) as u64))
            .and_then(|bytes| bytes.checked_add(3));
        let bytes = values
            .ok_or_else(|| self.cursor.fault(format!("variable '{name}' is larger than any file")))?
            & !3;
        Ok(Variable { name, dimensions: places, attributes, kind, start, bytes })
    }
}

impl Directory {
    /// Reads the header.
    pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Self> {
        let mut cursor = Cursor::new(path, bytes, 0, Order::Big, HINT);
        let magic = cursor.take(4, "the magic word")?;
        let mut reader = Reader { variant: magic[3], cursor };
        let records = reader.count("the number of records")?;
        let unknown = if reader.variant == 5 { u64::MAX } else { u32::MAX.into() };
        let promised = (records != unknown).then_some(records);
        let count = reader.list(10, "dimensions")?;
        let dimensions: Vec<(String, u64)> = (0..count)
            .map(|_| Ok((reader.name()?, reader.count("the length of a dimension")?)))
            .collect::<Result<_>>()?;
        let attributes = reader.attributes()?;
        let count = reader.list(11, "variables")?;
        let variables: Vec<Variable> =
            (0..count).map(|_| reader.variable(&dimensions)).collect::<Result<_>>()?;

        let is_record = |it: &&Variable| it.dimensions.first().is_some_and(|&first| dimensions[first].1 == 0);
        let recorded: Vec<&Variable> = variables.iter().filter(is_record).collect();
        let record_bytes = match recorded[..] {
            // A single one is not rounded up.
            [only] => {
                only.dimensions[1..].iter().map(|&it| dimensions[it].1).product::<u64>()
                    * only.kind.map_or(1, Kind::size) as u64
            }
            _ => recorded.iter().map(|it| it.bytes).fold(0, u64::saturating_add),
        };
        let start = recorded.iter().map(|it| it.start).min().unwrap_or(0);
        let room = (bytes.len() as u64).saturating_sub(start);
        // The end of the last record may lack the bytes that round it up.
        let last = recorded
            .iter()
            .map(|it| (it.start - start).saturating_add(it.exact_bytes(&dimensions)))
            .max()
            .unwrap_or(0);
        let there = if record_bytes == 0 || room < last { 0 } else { (room - last) / record_bytes + 1 };
        let records = promised.map_or(there, |promised| promised.min(there));
        Ok(Self { dimensions, attributes, variables, promised, records, record_bytes })
    }

    /// The text of an attribute of the whole.
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        text(&self.attributes, name)
    }

    /// The variable of that name.
    pub(super) fn variable(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|it| it.name == name)
    }

    /// Whether a variable has other values in each record.
    pub(super) fn is_recorded(&self, variable: &Variable) -> bool {
        variable.dimensions.first().is_some_and(|&first| self.dimensions[first].1 == 0)
    }

    /// The lengths of a variable's dimensions but that of the record.
    pub(super) fn shape(&self, variable: &Variable) -> Vec<u64> {
        let skip = usize::from(self.is_recorded(variable));
        variable.dimensions.iter().skip(skip).map(|&it| self.dimensions[it].1).collect()
    }

    /// The values of a numeric variable in record `record`, as rows of so many numbers.
    pub(super) fn source<'a>(
        &self,
        bytes: &'a [u8],
        variable: &Variable,
        record: u64,
        row: usize,
    ) -> Option<Source<'a>> {
        let kind = variable.kind?;
        let offset = if self.is_recorded(variable) { record.checked_mul(self.record_bytes)? } else { 0 };
        let start = usize::try_from(variable.start.checked_add(offset)?).ok()?;
        let step = kind.size();
        Some(Source { bytes, kind, order: Order::Big, start, stride: step.checked_mul(row)?, step })
    }

    /// A few numbers of a variable, in record `record`; `None` if it has fewer.
    pub(super) fn numbers<const N: usize>(
        &self,
        bytes: &[u8],
        variable: &Variable,
        record: u64,
    ) -> Option<[f64; N]> {
        if self.shape(variable).iter().product::<u64>() < N as u64 {
            return None;
        }
        let source = self.source(bytes, variable, record, 1)?;
        let end = source.end(N, 1)?;
        (end <= bytes.len()).then(|| std::array::from_fn(|place| source.number(place)))
    }
}

impl Variable {
    /// Bytes of a record, not rounded up.
    fn exact_bytes(&self, dimensions: &[(String, u64)]) -> u64 {
        let rest = self.dimensions.iter().skip(1).map(|&it| dimensions[it].1).product::<u64>();
        rest * self.kind.map_or(1, Kind::size) as u64
    }
}
