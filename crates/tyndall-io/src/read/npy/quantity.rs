//! A quantity of a file: an array, or a member of an array of structures, with a row for each particle.
//!
//! Takes headers and bytes, gives quantities. Invariant: all values of a quantity stand within its bytes, if these were read.

use std::collections::HashMap;
use std::path::Path;

use tyndall::particles::{Attribute, Values};
use tyndall::{Error, Result};

use super::header::{Element, Header, Scalar};
use crate::read::numbers::{Kind, Order};
use crate::read::records::{self, Source};

/// More columns than this are not taken for attributes of particles.
const COLUMNS_MAX: usize = 4096;

/// `rows` times `components` values.
#[derive(Clone)]
pub(super) struct Quantity<'a> {
    pub(super) name: String,
    /// The entry of the archive in which it is.
    pub(super) entry: usize,
    pub(super) rows: usize,
    pub(super) components: usize,
    /// Whether it is an array of two axes, which can be transposed.
    pub(super) is_pair: bool,
    /// Whether it is a single value, without axes.
    pub(super) is_single: bool,
    pub(super) data: Data<'a>,
}

/// Where the values stand.
#[derive(Clone, Copy)]
pub(super) enum Data<'a> {
    Numbers(Source<'a>),
    Words(Words<'a>),
}

impl<'a> Quantity<'a> {
    /// Whether the array, or the member of a structure, has this name, ignoring case.
    pub(super) fn is_named(&self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name)
    }

    /// Itself, or itself transposed, if it can be positions.
    pub(super) fn vector(&self) -> Option<Self> {
        match (&self.data, self.rows, self.components) {
            (Data::Numbers(_), _, 2..=4) if !self.is_single => Some(self.clone()),
            (Data::Numbers(_), 3, 5..) if self.is_pair => Some(self.clone().turned()),
            _ => None,
        }
    }

    /// Whether it is an array of two axes with more columns than positions need.
    pub(super) fn is_table(&self) -> bool {
        matches!(self.data, Data::Numbers(_)) && self.is_pair && (5..COLUMNS_MAX).contains(&self.components)
    }

    /// Whether it is an array of two axes with numbers of `count` particles in each row.
    pub(super) fn is_table_of(&self, count: usize) -> bool {
        matches!(self.data, Data::Numbers(_)) && self.is_pair && self.components == count && self.rows > 0
    }

    /// Itself with a row for each of `count` particles, transposed if need be; if it is none of theirs it is the error.
    pub(super) fn of_particles(self, count: usize) -> std::result::Result<Self, Self> {
        match self.rows == count && !self.is_single {
            true => Ok(self),
            false if self.is_table_of(count) => Ok(self.turned()),
            false => Err(self),
        }
    }

    /// Whether it is a single number.
    pub(super) fn is_number(&self) -> bool {
        matches!(self.data, Data::Numbers(_)) && self.rows == 1 && self.components == 1
    }

    /// Whether it may hold numbers that are not whole.
    pub(super) fn is_measured(&self) -> bool {
        matches!(self.data, Data::Numbers(source) if source.kind.is_float())
    }

    /// Its numbers, if it has one a row.
    pub(super) fn scalar(&self) -> Option<Source<'a>> {
        match self.data {
            Data::Numbers(source) if self.components == 1 && !self.is_single => Some(source),
            _ => None,
        }
    }

    /// Its value, if it has only one.
    pub(super) fn single(&self) -> Option<f64> {
        match self.data {
            Data::Numbers(source) if self.is_number() => Some(source.number(0)),
            _ => None,
        }
    }

    /// Rows for columns.
    pub(super) fn turned(self) -> Self {
        let data = match self.data {
            Data::Numbers(source) => {
                Data::Numbers(Source { stride: source.step, step: source.stride, ..source })
            }
            words => words,
        };
        Self { rows: self.components, components: self.rows, data, ..self }
    }

    /// Its name and shape.
    pub(super) fn describe(&self) -> String {
        match self.components {
            _ if self.is_single => format!("'{}' ()", self.name),
            1 => format!("'{}' ({},)", self.name, self.rows),
            components => format!("'{}' ({}, {components})", self.name, self.rows),
        }
    }
}

/// Text of fixed width.
#[derive(Clone, Copy)]
pub(super) struct Words<'a> {
    bytes: &'a [u8],
    start: usize,
    stride: usize,
    size: usize,
    /// The order of the bytes of a letter of 4 bytes; `None` for letters of one.
    letters: Option<Order>,
}

impl Words<'_> {
    /// The words of all particles.
    pub(super) fn attribute(&self, name: String, count: usize) -> Attribute {
        let mut places = HashMap::new();
        let mut names = Vec::new();
        let code = |id: usize| {
            let word = &self.bytes[self.start + id * self.stride..][..self.size];
            *places.entry(word).or_insert_with(|| {
                names.push(self.decode(word));
                names.len() as u32 - 1
            })
        };
        let codes = (0..count).map(code).collect();
        Attribute::new(name, 1, Values::Text { codes, names })
    }

    fn decode(&self, word: &[u8]) -> String {
        let text: String = match self.letters {
            None => String::from_utf8_lossy(word).into_owned(),
            Some(order) => word
                .as_chunks::<4>()
                .0
                .iter()
                .map(|letter| match order {
                    Order::Little => u32::from_le_bytes(*letter),
                    Order::Big => u32::from_be_bytes(*letter),
                })
                .map(|letter| char::from_u32(letter).unwrap_or(char::REPLACEMENT_CHARACTER))
                .collect(),
        };
        text.trim_end_matches('\0').into()
    }
}

/// An array.
pub(super) struct Array<'h, 'a> {
    pub(super) name: &'h str,
    /// The entry of the archive in which it is.
    pub(super) entry: usize,
    pub(super) header: &'h Header,
    /// Its header and its values; `None` if they were not read, so that nobody may look at a value.
    pub(super) bytes: Option<&'a [u8]>,
}

impl<'a> Array<'_, 'a> {
    /// Its quantities.
    pub(super) fn quantities(&self, path: &Path, warnings: &mut Vec<String>) -> Result<Vec<Quantity<'a>>> {
        let Self { name, entry, header, bytes } = *self;
        let size = header.element.size();
        let rows = header.shape.first().copied().unwrap_or(1);
        let values = bytes.map_or(&[][..], |bytes| &bytes[header.start..]);
        let components =
            header.shape.iter().skip(1).try_fold(1usize, |count, length| count.checked_mul(*length));
        let row_bytes = components.and_then(|components| components.checked_mul(size));
        let (Some(components), Some(row_bytes)) = (components, row_bytes) else {
            return Err(records::truncated(path, rows as u64, usize::MAX, values.len()));
        };
        if bytes.is_some() && header.values_bytes().is_none_or(|needed| needed > values.len()) {
            return Err(records::truncated(path, rows as u64, row_bytes, values.len()));
        }
        let place = if name.is_empty() { String::new() } else { format!("array '{name}'") };
        if components == 0 || size == 0 {
            warnings
                .push(format!("left out: array '{name}' of shape {:?} has rows of no bytes", header.shape));
            return Ok(vec![]);
        }
        let long_axes = header.shape.iter().skip(1).filter(|length| **length > 1).count();
        if header.fortran_order && long_axes > 1 {
            let what = format!("an array of shape {:?} in Fortran order cannot be read", header.shape);
            return Err(Error::format(path, place, what, "write numpy.ascontiguousarray(array)"));
        }
        let (stride, step) = if header.fortran_order { (size, size * rows) } else { (row_bytes, size) };
        let source = Source { bytes: values, kind: Kind::U8, order: Order::Little, start: 0, stride, step };
        let quantity = Quantity {
            name: name.into(),
            entry,
            rows,
            components,
            is_pair: header.shape.len() == 2,
            is_single: header.shape.is_empty(),
            data: Data::Numbers(source),
        };
        match &header.element {
            Element::Scalar(scalar) => {
                let data = data(*scalar, source, components);
                if data.is_none() {
                    warnings.push(format!("left out: array '{name}': its type cannot be shown"));
                }
                Ok(data.map(|data| Quantity { data, ..quantity }).into_iter().collect())
            }
            Element::Record(members, _) => {
                if components != 1 {
                    let what = format!("structures in an array of shape {:?} cannot be read", header.shape);
                    return Err(Error::format(path, place, what, "write numpy.ravel(array)"));
                }
                let mut quantities = Vec::new();
                for member in members.iter().filter(|it| !it.name.is_empty()) {
                    let prefix = if name.is_empty() { String::new() } else { format!("{name}.") };
                    let name = format!("{prefix}{}", member.name);
                    let place = Source { start: member.offset, step: member.step, ..source };
                    let data = data(member.scalar, place, member.components);
                    match data {
                        Some(data) => quantities.push(Quantity {
                            name,
                            components: member.components,
                            is_pair: false,
                            data,
                            ..quantity
                        }),
                        None => warnings.push(format!("left out: field '{name}': its type cannot be shown")),
                    }
                }
                Ok(quantities)
            }
        }
    }
}

/// The values at `place` as what they are; `None` if they are of a type that cannot be shown.
fn data(scalar: Scalar, place: Source<'_>, components: usize) -> Option<Data<'_>> {
    let Source { bytes, start, stride, .. } = place;
    let words = |size, letters| {
        (components == 1).then_some(Data::Words(Words { bytes, start, stride, size, letters }))
    };
    match scalar {
        Scalar::Number(kind, order) if components > 0 => Some(Data::Numbers(Source { kind, order, ..place })),
        Scalar::Bytes(size) => words(size, None),
        Scalar::Letters(size, order) => words(size, Some(order)),
        Scalar::Number(..) | Scalar::Other(_) => None,
    }
}
