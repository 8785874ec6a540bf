//! Rows of data sets to columns: runs of particles, one behind the other, each with inputs of its own.

use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Condvar, Mutex, PoisonError};

use glam::DVec3;
use rayon::prelude::*;
use tyndall::particles::{Columns, Values};
use tyndall::{Error, Progress, Result};

use super::rows::{BATCH_ROWS, NATIVE, Native, Rows};
use crate::read::content::Content;
use crate::read::numbers::{Kind, Order};
use crate::read::records::{Builder, ORIGIN_COUNT, Source};
use crate::read::sections::{Column, common, with_gaps};

/// Bytes of chunks that all threads together unpack at a time; for large columns an eighth of these.
const UNPACKED_BYTES: usize = 32 << 20;

/// Where the values of a column come from.
pub(super) enum Input {
    /// The rows of a data set.
    Rows(Rows),
    /// Numbers that are no data set.
    Numbers(Numbers),
    /// For each component a sum, in double precision.
    Sums(Vec<Vec<Term>>),
    /// One number for all particles.
    All(f64),
    /// Nowhere.
    Missing,
}

/// A part of a component's sum.
pub(super) enum Term {
    /// The rows of a data set with a number each, times a factor.
    Rows(Rows, f64),
    /// Numbers that are no data set, one each, times a factor.
    Numbers(Numbers, f64),
    /// A number.
    All(f64),
}

/// Numbers beside the data sets, a row a particle. Invariant: the content has them all.
pub(super) struct Numbers {
    pub(super) content: Arc<Content>,
    pub(super) kind: Kind,
    pub(super) order: Order,
    /// Where they begin, and the bytes from one row to the next.
    pub(super) start: usize,
    pub(super) stride: usize,
    /// How many rows there are, and numbers in each.
    pub(super) count: usize,
    pub(super) width: usize,
}

impl Numbers {
    /// Those from a row on.
    fn source(&self, row: usize) -> Source<'_> {
        let Self { kind, order, stride, .. } = *self;
        let start = self.start + row * stride;
        Source { bytes: (*self.content).as_ref(), kind, order, start, stride, step: kind.size() }
    }
}

/// Particles that have their inputs in one place.
pub(super) struct Run {
    pub(super) count: usize,
    /// One to three coordinates; one that is missing is 0.
    pub(super) positions: Input,
    /// For each column where it comes from.
    pub(super) values: Vec<Input>,
}

impl Run {
    /// The data sets that it reads.
    fn rows(&self) -> Vec<&Rows> {
        std::iter::once(&self.positions).chain(&self.values).flat_map(Input::rows).collect()
    }
}

impl Input {
    /// The data sets that it reads.
    fn rows(&self) -> Vec<&Rows> {
        match self {
            Self::Rows(rows) => vec![rows],
            Self::Sums(sums) => {
                let terms = sums.iter().flatten();
                terms
                    .filter_map(|term| if let Term::Rows(rows, _) = term { Some(rows) } else { None })
                    .collect()
            }
            Self::Numbers(_) | Self::All(_) | Self::Missing => Vec::new(),
        }
    }

    /// The memory that a thread needs for its chunks.
    fn working_bytes(&self) -> usize {
        self.rows().iter().map(|it| it.working_bytes()).sum()
    }

    /// The kind and number of its components, where it has values for each particle.
    fn shape(&self) -> Option<(Kind, usize)> {
        match self {
            Self::Rows(rows) => Some((rows.kind, rows.width)),
            Self::Numbers(numbers) => Some((numbers.kind, numbers.width)),
            Self::Sums(sums) => Some((Kind::F64, sums.len())),
            Self::All(_) | Self::Missing => None,
        }
    }

    /// Some rows, a few at a time: gives them to `fill` with their places among all that are asked for.
    fn read_each(&self, rows: Range<usize>, mut fill: impl FnMut(Source, Range<usize>)) -> Result<()> {
        let Some((kind, width)) = self.shape() else { return Ok(()) };
        match self {
            Self::Rows(data) => {
                return data.read_each(rows, |bytes, rows| fill(source(&bytes, kind, width), rows));
            }
            Self::Numbers(numbers) => {
                fill(numbers.source(rows.start), 0..rows.len());
                return Ok(());
            }
            Self::Sums(_) | Self::All(_) | Self::Missing => {}
        }
        let step = batch_rows(&self.rows());
        for first in rows.clone().step_by(step) {
            let some = first..rows.end.min(first + step);
            let bytes = self.read(some.clone())?;
            fill(source(&bytes, kind, width), some.start - rows.start..some.end - rows.start);
        }
        Ok(())
    }

    /// Some rows, of [`Input::shape`].
    fn read(&self, rows: Range<usize>) -> Result<Native> {
        let sums = match self {
            Self::Rows(data) => return data.read(rows),
            Self::Sums(sums) => sums,
            Self::Numbers(_) | Self::All(_) | Self::Missing => return Ok(Native::of(Vec::<u8>::new())),
        };
        let mut values = vec![0.0; rows.len() * sums.len()];
        for (component, terms) in sums.iter().enumerate() {
            let mine = || (component..rows.len() * sums.len()).step_by(sums.len().max(1));
            for term in terms {
                match term {
                    Term::All(number) => mine().for_each(|place| values[place] += number),
                    Term::Numbers(numbers, factor) => {
                        let source = numbers.source(rows.start);
                        for (row, place) in mine().enumerate() {
                            values[place] += factor * source.number(row);
                        }
                    }
                    Term::Rows(data, factor) => {
                        let bytes = data.read(rows.clone())?;
                        let source = source(&bytes, data.kind, data.width);
                        for (row, place) in mine().enumerate() {
                            values[place] += factor * source.number(row);
                        }
                    }
                }
            }
        }
        Ok(Native::of(values))
    }
}

/// Memory that threads share: who wants more than is left waits for the others.
struct Room {
    most: usize,
    used: Mutex<usize>,
    given_back: Condvar,
}

/// What a thread has of it.
struct Held<'a>(&'a Room, usize);

impl Room {
    fn of(most: usize) -> Self {
        Self { most, used: Mutex::new(0), given_back: Condvar::new() }
    }

    /// Takes so many bytes, at once if nobody has any. Who holds some must not hold more, nor wait for other threads.
    fn hold(&self, bytes: usize) -> Held<'_> {
        let bytes = bytes.min(self.most);
        let used = self.used.lock().unwrap_or_else(PoisonError::into_inner);
        let is_full = |used: &mut usize| *used + bytes > self.most;
        let mut used = self.given_back.wait_while(used, is_full).unwrap_or_else(PoisonError::into_inner);
        *used += bytes;
        Held(self, bytes)
    }
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        *self.0.used.lock().unwrap_or_else(PoisonError::into_inner) -= self.1;
        self.0.given_back.notify_all();
    }
}

/// Rows that are read at a time of data sets beside each other.
fn batch_rows(all: &[&Rows]) -> usize {
    all.iter().map(|it| it.batch_rows()).max().unwrap_or(BATCH_ROWS)
}

fn source(bytes: &[u8], kind: Kind, width: usize) -> Source<'_> {
    Source { bytes, kind, order: NATIVE, start: 0, stride: width * kind.size(), step: kind.size() }
}

/// The kind of column `column`.
fn kind(column: usize, runs: &[Run]) -> Kind {
    let shapes = runs.iter().filter_map(|it| it.values[column].shape());
    let found = shapes.map(|(kind, _)| kind).reduce(common);
    let constant = runs.iter().any(|it| matches!(it.values[column], Input::All(_)));
    let gaps = runs.iter().any(|it| matches!(it.values[column], Input::Missing));
    let kind = match found {
        Some(kind) if constant => common(kind, Kind::F32),
        Some(kind) => kind,
        None => Kind::F64,
    };
    if gaps { with_gaps(kind) } else { kind }
}

/// Brings the runs into columns, for the file at `path`, and advances `progress` by `total_bytes` over it. `middle`, the cell's, is the origin if known.
pub(super) fn gather(
    path: &Path,
    columns: &[Column],
    runs: &[Run],
    middle: Option<DVec3>,
    total_bytes: u64,
    progress: &dyn Progress,
) -> Result<Columns> {
    for run in runs {
        for rows in run.rows() {
            if rows.count != run.count {
                let what = format!("{} rows stand beside {} positions", rows.count, run.count);
                return Err(Error::format(path, rows.path(), what, "was it written to its end?"));
            }
        }
        for (input, column) in run.values.iter().zip(columns) {
            if input.shape().is_some_and(|(_, width)| width != column.components) {
                let what =
                    format!("'{}' does not have {} components everywhere", column.name, column.components);
                return Err(Error::format(path, "", what, "was the file written by one program?"));
            }
        }
    }
    let count: usize = runs.iter().map(|it| it.count).sum();
    let head = match middle.filter(|it| it.is_finite()) {
        Some(middle) => vec![middle],
        None => head(runs)?,
    };
    let kinds: Vec<Kind> = (0..columns.len()).map(|column| kind(column, runs)).collect();
    let named = columns.iter().zip(&kinds).map(|(it, kind)| (it.name.clone(), it.components, *kind));
    let mut builder = Builder::new(count, &head, named);

    let mut batches = Vec::new();
    for run in runs {
        let batch = batch_rows(&run.rows());
        let starts = (0..run.count).step_by(batch);
        batches.extend(starts.map(|start| (run, start, batch.min(run.count - start))));
    }
    let rows: Vec<usize> = batches.iter().map(|it| it.2).collect();
    let row: usize = columns.iter().zip(&kinds).map(|(it, kind)| it.components * kind.size()).sum();
    let room = Room::of(UNPACKED_BYTES.max(count.saturating_mul(12 + row) / 8));
    let jobs: Vec<_> = batches.into_iter().zip(builder.split(&rows)).collect();
    jobs.into_par_iter().try_for_each(|((run, start, rows), mut slots)| {
        // Told column by column, so that the pages of what was read are given back early.
        let bytes = rows as u128 * u128::from(total_bytes) / count as u128;
        let share = |columns_read: usize| bytes * columns_read as u128 / (1 + columns.len()) as u128;
        let tell = |place: usize| progress.advance((share(place + 1) - share(place)) as u64);
        let (axes, values) = slots.split_at_mut(3);
        let width = run.positions.shape().map_or(0, |it| it.1);
        let held = room.hold(run.positions.working_bytes());
        run.positions.read_each(start..start + rows, |source, rows| {
            for (axis, slot) in axes.iter_mut().enumerate().take(width) {
                slot.fill_from(&source.component(axis), 0, 1, rows.clone());
            }
        })?;
        drop(held);
        axes.iter_mut().skip(width).for_each(|slot| slot.fill_constant(0.0, 1, 0..rows));
        tell(0);
        for (place, ((slot, input), column)) in values.iter_mut().zip(&run.values).zip(columns).enumerate() {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let _held = room.hold(input.working_bytes());
            match input {
                Input::All(number) => slot.fill_constant(*number, column.components, 0..rows),
                Input::Missing => slot.fill_constant(f64::NAN, column.components, 0..rows),
                input => input.read_each(start..start + rows, |source, rows| {
                    slot.fill_from(&source, 0, column.components, rows);
                })?,
            }
            tell(1 + place);
        }
        Ok(())
    })?;
    let mut gathered = builder.into_columns();
    for (place, (attribute, column)) in gathered.attributes.iter_mut().zip(columns).enumerate() {
        attribute.unit.clone_from(&column.unit);
        let unsigned = runs.iter().all(|it| it.values[place].shape().is_some_and(|it| it.0 == Kind::U64));
        if unsigned {
            widen_unsigned(&mut attribute.values);
        }
    }
    Ok(gathered)
}

/// Unsigned integers that were read as signed ones; if one is beyond those, all become floats.
fn widen_unsigned(values: &mut Values) {
    if let Values::I64(numbers) = values
        && numbers.par_iter().any(|&it| it < 0)
    {
        *values = Values::F64(numbers.par_iter().map(|&it| it as u64 as f64).collect());
    }
}

/// The first positions, which decide the origin.
fn head(runs: &[Run]) -> Result<Vec<DVec3>> {
    let Some(run) = runs.iter().find(|it| it.count > 0) else { return Ok(Vec::new()) };
    let rows = run.count.min(ORIGIN_COUNT);
    let (kind, width) = run.positions.shape().unwrap_or((Kind::F64, 0));
    let bytes = run.positions.read(0..rows)?;
    let source = match &run.positions {
        Input::Numbers(numbers) => numbers.source(0),
        _ => source(&bytes, kind, width),
    };
    let coordinate = |row, axis| if axis < width { source.component(axis).number(row) } else { 0.0 };
    Ok((0..rows).map(|row| DVec3::from_array(std::array::from_fn(|axis| coordinate(row, axis)))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_wants_more_room_than_is_left_waits() {
        use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
        let (room, now, most) = (Room::of(10), AtomicUsize::new(0), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for bytes in [6, 7, 1000] {
                        let held = room.hold(bytes);
                        most.fetch_max(1 + now.fetch_add(1, SeqCst), SeqCst);
                        std::thread::yield_now();
                        now.fetch_sub(1, SeqCst);
                        drop(held);
                    }
                });
            }
        });
        assert_eq!((most.into_inner(), *room.used.lock().unwrap()), (1, 0));
        let _two = [room.hold(5), room.hold(5)];
    }

    #[test]
    fn unsigned_numbers_beyond_the_signed_become_floats() {
        let mut values = Values::I64(vec![1, -1]);
        widen_unsigned(&mut values);
        assert_eq!(values, Values::F64(vec![1.0, u64::MAX as f64]));
        let mut values = Values::I64(vec![1, 2]);
        widen_unsigned(&mut values);
        assert_eq!(values, Values::I64(vec![1, 2]));
    }
}
