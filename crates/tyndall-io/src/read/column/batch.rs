//! Columns of rows whose fields were found: read column by column, many numbers at once.
//!
//! Invariant: fast readers decide nothing about meaning. Where a group of numbers has one that is not of every day, the group is read one
//! by one as rows are.

use fearless_simd::Simd;

use super::{Column, Rest, Separator, double, single};
use crate::read::decimal;
use crate::read::decimal::group::{GROUP, Group};

/// So many groups of a column are tried together in vain before the others are read one by one: numbers of a column look alike.
const PATIENCE: u8 = 4;

/// What reads the fields of many rows.
pub(crate) struct Reader {
    group: Box<Group>,
    /// How many groups of each field were last tried in vain.
    misses: Vec<u8>,
}

impl Reader {
    /// For rows of so many fields.
    pub(crate) fn new(fields: usize) -> Self {
        Self { group: Group::new(), misses: vec![0; fields] }
    }

    /// Begins another text of such rows.
    pub(crate) fn restart(&mut self) {
        self.misses.fill(0);
    }
}

/// Rows of text.
#[derive(Clone, Copy)]
pub(crate) struct Batch<'a> {
    /// The text that they stand in, and what follows.
    pub(crate) text: &'a [u8],
    /// Where the fields begin, row by row.
    pub(crate) starts: &'a [u16],
    /// How many fields a row has, at least one, and what stands between them.
    pub(crate) fields: usize,
    pub(crate) separator: Separator,
}

impl<'a> Batch<'a> {
    /// How many rows there are.
    pub(crate) fn rows(self) -> usize {
        self.starts.len() / self.fields
    }

    /// What begins with a field of each row.
    #[inline(always)]
    fn rests(self, field: usize) -> impl Iterator<Item = Rest<'a>> {
        self.each(field).map(move |start| Rest(&self.text[usize::from(start)..]))
    }

    /// Where a field of each row begins.
    #[inline(always)]
    fn each(self, field: usize) -> impl Iterator<Item = u16> {
        self.starts.chunks_exact(self.fields).map(move |row| row[field])
    }

    /// The rows, some at a time.
    #[inline(always)]
    fn groups(self) -> impl Iterator<Item = Self> {
        self.starts.chunks(GROUP * self.fields).map(move |starts| Self { starts, ..self })
    }

    /// A field of each row of a group, if all are everyday numbers, or integers.
    #[inline(always)]
    fn read<S: Simd>(
        self,
        simd: S,
        group: &mut Group,
        field: usize,
        integers: bool,
    ) -> Option<&[f64; GROUP]> {
        let (mut starts, mut count) = ([0; GROUP], 0);
        for (to, start) in starts.iter_mut().zip(self.each(field)) {
            *to = start;
            count += 1;
        }
        group.read(simd, self.text, &starts[..count], self.separator.byte.unwrap_or(b' '), integers)
    }

    /// The same of numbers, if there is hope.
    #[inline(always)]
    fn numbers<S: Simd>(self, simd: S, reader: &mut Reader, field: usize) -> Option<&[f64; GROUP]> {
        let misses = &mut reader.misses[field];
        if *misses == PATIENCE {
            return None;
        }
        let found = self.read(simd, &mut reader.group, field, false);
        *misses = if found.is_some() { 0 } else { *misses + 1 };
        found
    }

    /// Reads a field of each row into `values`; `None` if one of them is no number.
    #[inline(always)]
    pub(crate) fn doubles<S: Simd>(
        self,
        simd: S,
        reader: &mut Reader,
        field: usize,
        values: &mut [f64],
    ) -> Option<()> {
        for (rows, values) in self.groups().zip(values.chunks_mut(GROUP)) {
            if let Some(found) = rows.numbers(simd, reader, field) {
                values.copy_from_slice(&found[..values.len()]);
                continue;
            }
            for (value, rest) in values.iter_mut().zip(rows.rests(field)) {
                *value = double(simd, rest, self.separator)?.0;
            }
        }
        Some(())
    }

    /// The same in single precision, of several fields whose values stand beside each other.
    #[inline(always)]
    fn singles<S: Simd>(
        self,
        simd: S,
        reader: &mut Reader,
        fields: &[usize],
        values: &mut [f32],
    ) -> Option<()> {
        for (component, &field) in fields.iter().enumerate() {
            for (rows, values) in self.groups().zip(values.chunks_mut(GROUP * fields.len())) {
                let (mut singles, mut are_rounded) = ([0.0; GROUP], false);
                if let Some(found) = rows.numbers(simd, reader, field) {
                    are_rounded = true;
                    for (single, &value) in singles.iter_mut().zip(found) {
                        *single = value as f32;
                        are_rounded &= !decimal::is_halfway(value);
                    }
                }
                if !are_rounded {
                    for (value, rest) in singles.iter_mut().zip(rows.rests(field)) {
                        *value = single(simd, rest, self.separator)?.0;
                    }
                }
                for (values, single) in values.chunks_exact_mut(fields.len()).zip(&singles) {
                    values[component] = *single;
                }
            }
        }
        Some(())
    }

    /// Appends a field of each row to `values`, up to the first group that has others than everyday integers of 32 bits.
    #[inline(always)]
    fn integers<S: Simd>(self, simd: S, group: &mut Group, field: usize, values: &mut Vec<i32>) {
        for rows in self.groups() {
            let Some(found) = rows.read(simd, group, field, true) else { return };
            let mut fit = true;
            let integers = found.map(|value| {
                // The lowest bits of a sum near 2^52 are those of the integer.
                let integer = (value + 1.5 * 2f64.powi(52)).to_bits() as i32;
                fit &= f64::from(integer) == value;
                integer
            });
            if !fit {
                return;
            }
            values.extend_from_slice(&integers[..rows.rows()]);
        }
    }
}

impl Column {
    /// Appends some fields of each row; `None` if one of them does not fit the column.
    #[inline(always)]
    pub(crate) fn extend<S: Simd>(
        &mut self,
        simd: S,
        reader: &mut Reader,
        rows: Batch,
        fields: &[usize],
    ) -> Option<()> {
        let mut done = 0;
        match (&mut *self, fields) {
            (Self::Float(column), _) => {
                let first = column.len();
                column.resize(first + rows.rows() * fields.len(), 0.0);
                return rows.singles(simd, reader, fields, &mut column[first..]);
            }
            (Self::Int(column), &[field]) => {
                let first = column.len();
                rows.integers(simd, &mut reader.group, field, column);
                done = column.len() - first;
            }
            (Self::Text(words), &[field]) if rows.separator.byte.is_none() => {
                rows.rests(field).for_each(|Rest(text)| words.push_front(text));
                return Some(());
            }
            _ => {}
        }
        for row in rows.starts.chunks_exact(rows.fields).skip(done) {
            for &field in fields {
                self.push(simd, Rest(&rows.text[usize::from(row[field])..]), rows.separator)?;
            }
        }
        Some(())
    }
}
