//! Particles whose columns stand in several places: the types of a snapshot, which have quantities of their own, and the files
//! over which it is spread.
//!
//! A [`Section`] is a run of particles that have everything in one place; sections follow each other in the columns that
//! [`gather`] makes. A quantity that some sections lack is NaN there, so that its column holds floats.

use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;
use tyndall::particles::Columns;
use tyndall::scene::wanted::{Offered, Wanted};
use tyndall::{Error, Progress, Result};

use super::numbers::Kind;
use super::records::{Builder, CACHE_ROWS, JOB_ROWS, ORIGIN_COUNT, Source, truncated};

/// A quantity that at least one section has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) components: usize,
    pub(crate) unit: Option<String>,
}

impl Column {
    /// A column without a unit.
    pub(crate) fn new(name: impl Into<String>, components: usize) -> Self {
        Self { name: name.into(), components, unit: None }
    }
}

/// Which of the columns are wanted.
pub(crate) fn flags(columns: &[Column], wanted: Option<&Wanted>) -> Vec<bool> {
    fn offered(it: &Column) -> Offered<'_> {
        Offered { name: &it.name, components: it.components, is_measured: true }
    }
    match wanted {
        Some(wanted) => wanted.flags(&columns.iter().map(offered).collect::<Vec<_>>()),
        None => vec![true; columns.len()],
    }
}

/// The values whose flags are set.
pub(crate) fn flagged<T>(values: Vec<T>, flags: &[bool]) -> Vec<T> {
    values.into_iter().zip(flags).filter_map(|(value, flag)| flag.then_some(value)).collect()
}

/// What a section has of a column.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Value<'a> {
    /// A value for every particle.
    Each(Source<'a>),
    /// One number for all.
    All(f64),
    /// Nothing.
    Missing,
}

/// Particles that have everything in one place.
#[derive(Debug)]
pub(crate) struct Section<'a> {
    pub(crate) count: usize,
    /// The coordinates.
    pub(crate) axes: [Source<'a>; 3],
    /// For each column what stands here.
    pub(crate) values: Vec<Value<'a>>,
}

/// The narrowest kind whose column holds the numbers of both.
pub(crate) fn common(a: Kind, b: Kind) -> Kind {
    let is_wide = |kind| matches!(kind, Kind::U32 | Kind::I64 | Kind::U64);
    match (a, b) {
        _ if a == b => a,
        _ if a.is_float() && b.is_float() => {
            if a == Kind::F64 || b == Kind::F64 {
                Kind::F64
            } else {
                Kind::F32
            }
        }
        _ if a.is_float() || b.is_float() => Kind::F64,
        _ if is_wide(a) || is_wide(b) => Kind::I64,
        _ => Kind::I32,
    }
}

/// The kind of a column in which some particles have nothing: floats, because NaN says so.
pub(crate) fn with_gaps(kind: Kind) -> Kind {
    match kind {
        Kind::F16 | Kind::F32 | Kind::I8 | Kind::U8 | Kind::I16 | Kind::U16 => Kind::F32,
        Kind::F64 | Kind::I32 | Kind::U32 | Kind::I64 | Kind::U64 => Kind::F64,
    }
}

/// The kind of column `column`, which has `components`.
fn kind(column: usize, components: usize, sections: &[Section]) -> Kind {
    let mut found: Option<Kind> = None;
    let (mut constant, mut gaps) = (false, false);
    for section in sections {
        match section.values[column] {
            Value::Each(source) => {
                let exceeds = source.exceeds_i64(section.count, components);
                let kind = if exceeds { Kind::F64 } else { source.kind };
                found = Some(found.map_or(kind, |other| common(other, kind)));
            }
            Value::All(_) => constant = true,
            Value::Missing => gaps = true,
        }
    }
    let kind = match found {
        Some(kind) if constant => common(kind, Kind::F32),
        Some(kind) => kind,
        None => Kind::F64,
    };
    if gaps { with_gaps(kind) } else { kind }
}

/// Brings the sections into columns, one behind the other, parallel, and advances `progress` by `total_bytes` over it.
/// `middle`, the cell's, is the origin if it is known. Fails before it asks for memory if values are not in their bytes.
pub(crate) fn gather(
    path: &Path,
    columns: &[Column],
    sections: &[Section],
    middle: Option<DVec3>,
    total_bytes: u64,
    progress: &dyn Progress,
) -> Result<Columns> {
    for section in sections.iter().filter(|it| it.count > 0) {
        let values = section.values.iter().zip(columns).filter_map(|(value, column)| match value {
            Value::Each(source) => Some((source, column.components)),
            _ => None,
        });
        for (source, components) in section.axes.iter().map(|source| (source, 1)).chain(values) {
            if source.end(section.count, components).is_none_or(|end| end > source.bytes.len()) {
                return Err(truncated(path, section.count as u64, source.stride, source.bytes.len()));
            }
        }
    }
    let count = sections.iter().map(|it| it.count).sum::<usize>();
    let head: Vec<DVec3> = match middle.filter(|it| it.is_finite()) {
        Some(middle) => vec![middle],
        None => sections.iter().flat_map(positions).take(ORIGIN_COUNT).collect(),
    };
    let kinds = columns.iter().enumerate().map(|(place, column)| {
        let kind = kind(place, column.components, sections);
        (column.name.clone(), column.components, kind)
    });
    let mut builder = Builder::new(count, &head, kinds);

    let jobs = || {
        sections.iter().flat_map(|section| {
            let starts = (0..section.count).step_by(JOB_ROWS);
            starts.map(move |start| (section, start, JOB_ROWS.min(section.count - start)))
        })
    };
    let rows: Vec<usize> = jobs().map(|(_, _, rows)| rows).collect();
    let jobs: Vec<_> = jobs().zip(builder.split(&rows)).collect();
    jobs.into_par_iter().try_for_each(|((section, start, rows), mut slots)| {
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        let (axes, values) = slots.split_at_mut(3);
        for first in (0..rows).step_by(CACHE_ROWS) {
            let range = first..rows.min(first + CACHE_ROWS);
            for (slot, source) in axes.iter_mut().zip(&section.axes) {
                slot.fill(source, start, 1, range.clone());
            }
            for ((slot, value), column) in values.iter_mut().zip(&section.values).zip(columns) {
                match value {
                    Value::Each(source) => slot.fill(source, start, column.components, range.clone()),
                    Value::All(value) => slot.fill_constant(*value, column.components, range.clone()),
                    Value::Missing => slot.fill_constant(f64::NAN, column.components, range.clone()),
                }
            }
        }
        section.axes.iter().for_each(|source| source.let_go(start, rows, 1, progress));
        for (value, column) in section.values.iter().zip(columns) {
            if let Value::Each(source) = value {
                source.let_go(start, rows, column.components, progress);
            }
        }
        progress.advance((rows as u128 * u128::from(total_bytes) / count as u128) as u64);
        Ok(())
    })?;
    let mut gathered = builder.into_columns();
    for (attribute, column) in gathered.attributes.iter_mut().zip(columns) {
        attribute.unit.clone_from(&column.unit);
    }
    Ok(gathered)
}

/// The first positions of a section.
fn positions(section: &Section) -> impl Iterator<Item = DVec3> {
    let count = section.count.min(ORIGIN_COUNT);
    (0..count).map(|id| DVec3::from_array(section.axes.map(|axis| axis.number(id))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::numbers::Order;
    use tyndall::particles::Values;

    fn source(bytes: &[u8], kind: Kind) -> Source<'_> {
        Source { bytes, kind, order: Order::Little, start: 0, stride: kind.size(), step: 0 }
    }

    #[test]
    fn sections_follow_each_other_and_what_is_missing_is_nan() {
        let count = JOB_ROWS + 5;
        let wide: Vec<u8> = (0..count).flat_map(|id| (id as f64).to_le_bytes()).collect();
        let narrow: Vec<u8> = (0..3u8).collect();
        let many = Section {
            count,
            axes: [source(&wide, Kind::F64); 3],
            values: vec![Value::Each(source(&wide, Kind::F64)), Value::Missing, Value::All(2.5)],
        };
        let few = Section {
            count: 3,
            axes: [source(&narrow, Kind::U8); 3],
            values: vec![
                Value::Each(source(&narrow, Kind::U8)),
                Value::Each(source(&narrow, Kind::U8)),
                Value::All(7.0),
            ],
        };
        let columns = ["a", "b", "c"].map(|name| Column::new(name, 1));
        let path = Path::new("test");
        let gathered = gather(path, &columns, &[few, many], Some(DVec3::ONE), 1000, &()).unwrap();
        assert_eq!((gathered.positions.len(), gathered.positions.origin()), (count + 3, DVec3::ONE));
        assert_eq!(gathered.positions.world(2), DVec3::splat(2.0));
        assert_eq!(gathered.positions.world(count + 2), DVec3::splat(count as f64 - 1.0));
        assert_eq!(gathered.attributes[0].number(count + 2, 0), count as f64 - 1.0);
        let Values::F32(gaps) = &gathered.attributes[1].values else { panic!("a byte and gaps are floats") };
        assert!(gaps[..3] == [0.0, 1.0, 2.0] && gaps[3..].iter().all(|it| it.is_nan()));
        assert_eq!([2, 3].map(|id| gathered.attributes[2].number(id, 0)), [7.0, 2.5]);
    }

    #[test]
    fn a_column_holds_the_numbers_of_all_its_sections() {
        assert_eq!(common(Kind::F32, Kind::F64), Kind::F64);
        assert_eq!(common(Kind::I32, Kind::F32), Kind::F64);
        assert_eq!(common(Kind::U32, Kind::I32), Kind::I64);
        assert_eq!(common(Kind::U8, Kind::U16), Kind::I32);
        assert_eq!(with_gaps(Kind::U32), Kind::F64);
    }

    #[test]
    fn hostile_counts_are_refused() {
        let bytes = [0; 64];
        for count in [17, 1 << 40, usize::MAX] {
            let values = vec![];
            let section = Section { count, axes: [source(&bytes, Kind::F32); 3], values };
            assert!(gather(Path::new("test"), &[], &[section], None, 64, &()).is_err(), "{count}");
        }
    }
}
