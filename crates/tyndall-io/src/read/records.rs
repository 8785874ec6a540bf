//! Records of fixed size in bytes to columns: what PLY, NPY and BGEO have in common.
//!
//! A [`Layout`] says where each value of each particle stands; [`Layout::gather`] brings them into columns in one parallel pass
//! over the bytes. A [`Builder`] holds the columns while they are filled, also by readers of text. Invariant: memory is only
//! asked for after [`Layout::check`] has shown that the bytes for all particles are there.

use std::ops::Range;
use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;
use tyndall::particles::{Attribute, Columns, Positions, Values};
use tyndall::scene::wanted::{Offered, Wanted};
use tyndall::{Error, Particles, Progress, Result};

use super::numbers::{Half, Kind, Number, Order};
use crate::sequence::Frame;

/// So many positions, the first ones, decide the origin.
pub(crate) const ORIGIN_COUNT: usize = 4096;

/// Rows that one thread takes at a time.
pub(super) const JOB_ROWS: usize = 1 << 16;

/// Rows that are brought into all columns before the next ones: their bytes stay in the cache meanwhile.
pub(super) const CACHE_ROWS: usize = 1 << 11;

/// Where the values of one quantity stand: component `c` of particle `id` at byte `start + id * stride + c * step`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source<'a> {
    pub(crate) bytes: &'a [u8],
    pub(crate) kind: Kind,
    pub(crate) order: Order,
    pub(crate) start: usize,
    pub(crate) stride: usize,
    pub(crate) step: usize,
}

impl Source<'_> {
    /// The same, from component `component` on.
    pub(crate) fn component(self, component: usize) -> Self {
        Self { start: self.start + component * self.step, ..self }
    }

    /// The number at `id` as f64.
    pub(crate) fn number(&self, id: usize) -> f64 {
        let mut value = [0.0];
        self.convert_all(&mut value, id, 1, |number| number);
        value[0]
    }

    /// The byte behind the last one needed; `None` if there is no such number.
    pub(crate) fn end(&self, count: usize, components: usize) -> Option<usize> {
        let last =
            (count - 1).checked_mul(self.stride)?.checked_add((components - 1).checked_mul(self.step)?)?;
        self.start.checked_add(last)?.checked_add(self.kind.size())
    }

    /// Tells `progress` that the bytes of particles `first..first + rows` are read.
    pub(super) fn let_go(&self, first: usize, rows: usize, components: usize, progress: &dyn Progress) {
        // Components lie in their row, or each in an array of its own.
        let are_apart = self.step > self.stride;
        let (arrays, within) = if are_apart { (components, 1) } else { (1, components) };
        for array in 0..arrays {
            let start = self.start + first * self.stride + array * self.step;
            let length = rows.saturating_sub(1) * self.stride + (within - 1) * self.step + self.kind.size();
            if let Some(bytes) = self.bytes.get(start..start + length) {
                progress.let_go(bytes);
            }
        }
    }

    fn fill<T: Number, O>(&self, out: &mut [O], first: usize, components: usize, convert: impl Fn(T) -> O) {
        match self.order {
            Order::Little => self.fill_in_order::<T, O, false>(out, first, components, convert),
            Order::Big => self.fill_in_order::<T, O, true>(out, first, components, convert),
        }
    }

    fn fill_in_order<T: Number, O, const BIG: bool>(
        &self,
        out: &mut [O],
        first: usize,
        components: usize,
        convert: impl Fn(T) -> O,
    ) {
        let bytes = self.bytes.get(self.start + first * self.stride..).unwrap_or_default();
        // Most columns are of single values, and lie in rows or side by side; for those the compiler needs no checks.
        if components == 1 && self.stride == T::SIZE {
            for (value, bytes) in out.iter_mut().zip(bytes.chunks_exact(T::SIZE)) {
                *value = convert(T::from_bytes::<BIG>(bytes));
            }
        } else if components == 1 && self.stride > T::SIZE {
            for (value, row) in out.iter_mut().zip(bytes.chunks(self.stride)) {
                *value = convert(T::from_bytes::<BIG>(&row[..T::SIZE]));
            }
        } else {
            for (row, values) in out.chunks_exact_mut(components).enumerate() {
                let mut at = row * self.stride;
                for value in values {
                    *value = convert(T::from_bytes::<BIG>(&bytes[at..at + T::SIZE]));
                    at += self.step;
                }
            }
        }
    }

    /// Fills `out` with particles `first..` as f64, converted.
    pub(super) fn convert_all<O>(
        &self,
        out: &mut [O],
        first: usize,
        components: usize,
        convert: impl Fn(f64) -> O,
    ) {
        match self.kind {
            Kind::I8 => self.fill(out, first, components, |value: i8| convert(value.into())),
            Kind::U8 => self.fill(out, first, components, |value: u8| convert(value.into())),
            Kind::I16 => self.fill(out, first, components, |value: i16| convert(value.into())),
            Kind::U16 => self.fill(out, first, components, |value: u16| convert(value.into())),
            Kind::I32 => self.fill(out, first, components, |value: i32| convert(value.into())),
            Kind::U32 => self.fill(out, first, components, |value: u32| convert(value.into())),
            Kind::I64 => self.fill(out, first, components, |value: i64| convert(value as f64)),
            Kind::U64 => self.fill(out, first, components, |value: u64| convert(value as f64)),
            Kind::F16 => self.fill(out, first, components, |value: Half| convert(value.0.into())),
            Kind::F32 => self.fill(out, first, components, |value: f32| convert(value.into())),
            Kind::F64 => self.fill(out, first, components, convert),
        }
    }

    /// Whether a value is too large for a column of signed 64-bit integers.
    pub(super) fn exceeds_i64(&self, count: usize, components: usize) -> bool {
        let high = match self.order {
            Order::Little => 7,
            Order::Big => 0,
        };
        let place =
            |id: usize, component: usize| self.start + id * self.stride + component * self.step + high;
        let exceeds = |id: usize| (0..components).any(|component| self.bytes[place(id, component)] >= 0x80);
        self.kind == Kind::U64 && (0..count).into_par_iter().any(exceeds)
    }
}

/// A named quantity and where it stands.
#[derive(Clone, Debug)]
pub(crate) struct Field<'a> {
    pub(crate) name: String,
    pub(crate) components: usize,
    pub(crate) source: Source<'a>,
}

/// Those of the fields that are wanted, all if nothing is said.
pub(crate) fn wanted_fields<'a>(fields: Vec<Field<'a>>, wanted: Option<&Wanted>) -> Vec<Field<'a>> {
    let Some(wanted) = wanted else { return fields };
    fn offered<'b>(it: &'b Field) -> Offered<'b> {
        Offered { name: &it.name, components: it.components, is_measured: it.source.kind.is_float() }
    }
    let flags = wanted.flags(&fields.iter().map(offered).collect::<Vec<_>>());
    fields.into_iter().zip(flags).filter_map(|(field, flag)| flag.then_some(field)).collect()
}

/// Where everything stands.
#[derive(Debug)]
pub(crate) struct Layout<'a> {
    pub(crate) count: usize,
    /// The coordinates; one that is missing is 0 everywhere.
    pub(crate) axes: [Option<Source<'a>>; 3],
    pub(crate) fields: Vec<Field<'a>>,
}

impl Layout<'_> {
    /// Fails unless all values stand within their bytes.
    fn check(&self, path: &Path) -> Result<()> {
        if self.count == 0 {
            return Ok(());
        }
        let axes = self.axes.iter().flatten().map(|source| (source, 1));
        for (source, components) in axes.chain(self.fields.iter().map(|it| (&it.source, it.components))) {
            if source.end(self.count, components).is_none_or(|end| end > source.bytes.len()) {
                return Err(truncated(path, self.count as u64, source.stride, source.bytes.len()));
            }
        }
        Ok(())
    }

    /// The bytes of particles `start..start + rows` are read.
    fn let_go(&self, start: usize, rows: usize, progress: &dyn Progress) {
        let axes = self.axes.iter().flatten().map(|source| (source, 1));
        for (source, components) in axes.chain(self.fields.iter().map(|it| (&it.source, it.components))) {
            source.let_go(start, rows, components, progress);
        }
    }

    /// Brings all values into columns, parallel, and advances `progress` by `total_bytes` over it.
    pub(crate) fn gather(&self, path: &Path, total_bytes: usize, progress: &dyn Progress) -> Result<Builder> {
        join(path, std::slice::from_ref(self), total_bytes, progress)
    }

    /// Fills rows `rows` of the slots, which begin at particle `start`.
    fn fill(&self, slots: &mut [Slot], start: usize, rows: Range<usize>) {
        let (axes, values) = slots.split_at_mut(3);
        for (slot, source) in axes.iter_mut().zip(&self.axes) {
            if let Some(source) = source {
                slot.fill(source, start, 1, rows.clone());
            }
        }
        for (slot, field) in values.iter_mut().zip(&self.fields) {
            slot.fill(&field.source, start, field.components, rows.clone());
        }
    }
}

/// Brings the values of pieces that follow each other into columns, parallel, and advances `progress` by `total_bytes` over it. All
/// pieces have the first one's fields; where kinds differ the column is of 64-bit floats.
pub(crate) fn join(
    path: &Path,
    pieces: &[Layout],
    total_bytes: usize,
    progress: &dyn Progress,
) -> Result<Builder> {
    join_around(path, pieces, None, (total_bytes, progress))
}

/// The same around an origin that is known.
fn join_around(
    path: &Path,
    pieces: &[Layout],
    origin: Option<DVec3>,
    (total_bytes, progress): (usize, &dyn Progress),
) -> Result<Builder> {
    for piece in pieces {
        piece.check(path)?;
    }
    let Some(model) = pieces.first() else { return Ok(Builder::new(0, &[], [])) };
    let count = pieces.iter().map(|it| it.count).sum();
    let position =
        |axes: &[Option<Source>; 3], id| axes.map(|axis| axis.map_or(0.0, |source| source.number(id)));
    let rows = pieces.iter().flat_map(|it| (0..it.count).map(|id| DVec3::from_array(position(&it.axes, id))));
    let head: Vec<DVec3> = origin.map_or_else(|| rows.take(ORIGIN_COUNT).collect(), |origin| vec![origin]);
    let columns = model.fields.iter().enumerate().map(|(place, field)| {
        let kind = field.source.kind;
        let narrow = |piece: &Layout| {
            let Field { components, source, .. } = &piece.fields[place];
            source.kind == kind && !source.exceeds_i64(piece.count, *components)
        };
        let kind = if pieces.iter().all(narrow) { kind } else { Kind::F64 };
        (field.name.clone(), field.components, kind)
    });
    let mut builder = Builder::new(count, &head, columns);

    let jobs = pieces.iter().flat_map(|piece| {
        (0..piece.count).step_by(JOB_ROWS).map(move |start| (piece, start, JOB_ROWS.min(piece.count - start)))
    });
    let rows: Vec<usize> = jobs.clone().map(|(_, _, rows)| rows).collect();
    let jobs: Vec<_> = jobs.zip(builder.split(&rows)).collect();
    let share = |rows: usize| (rows as u128 * total_bytes as u128 / count as u128) as u64;
    let before: Vec<usize> = rows
        .iter()
        .scan(0, |before, rows| {
            *before += rows;
            Some(*before - rows)
        })
        .collect();
    let jobs = jobs.into_par_iter().zip(before);
    jobs.try_for_each(|(((piece, start, rows), mut slots), before)| {
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        for first in (0..rows).step_by(CACHE_ROWS) {
            piece.fill(&mut slots, start, first..rows.min(first + CACHE_ROWS));
        }
        piece.let_go(start, rows, progress);
        progress.advance(share(before + rows) - share(before));
        Ok(())
    })?;
    Ok(builder)
}

/// Positions that a function tells, around `origin`, or around the middle of the first of them.
pub(crate) fn positions(
    count: usize,
    origin: Option<DVec3>,
    position: impl Fn(usize) -> DVec3 + Sync,
) -> Positions {
    let origin = origin.filter(|it| it.is_finite()).unwrap_or_else(|| {
        let head: Vec<DVec3> = (0..count.min(ORIGIN_COUNT)).map(&position).collect();
        let mut positions = Positions::new();
        positions.extend(&head);
        positions.origin()
    });
    let mut offsets: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; count]);
    let [x, y, z] = offsets.each_mut().map(|column| column.par_chunks_mut(JOB_ROWS));
    x.zip(y).zip(z).enumerate().for_each(|(job, ((x, y), z))| {
        for (row, ((x, y), z)) in x.iter_mut().zip(y).zip(z).enumerate() {
            let offset = position(job * JOB_ROWS + row) - origin;
            [*x, *y, *z] = offset.to_array().map(|it| it as f32);
        }
    });
    Positions::from_offsets(origin, offsets)
}

/// Multiplies the values of an attribute by `factor`, then adds `offset`, in double precision. Integers become floats.
pub(crate) fn scale(attribute: &mut Attribute, factor: f64, offset: f64) {
    match &mut attribute.values {
        Values::F32(values) => {
            values.iter_mut().for_each(|it| *it = (f64::from(*it) * factor + offset) as f32);
        }
        Values::F64(values) => values.iter_mut().for_each(|it| *it = *it * factor + offset),
        values => {
            let scaled = |place: usize| factor * values.number(place) + offset;
            *values = Values::F64((0..values.len()).map(scaled).collect());
        }
    }
}

/// The columns while they are filled.
#[derive(Debug)]
pub(crate) struct Builder {
    origin: DVec3,
    offsets: [Vec<f32>; 3],
    pub(crate) attributes: Vec<Attribute>,
}

impl Builder {
    /// Columns of zeros for `count` particles, the first of which stand at `head`. Columns are name, components, kind.
    pub(crate) fn new(
        count: usize,
        head: &[DVec3],
        columns: impl IntoIterator<Item = (String, usize, Kind)>,
    ) -> Self {
        let mut positions = Positions::new();
        positions.extend(head);
        let columns = columns.into_iter();
        Self {
            origin: positions.origin(),
            offsets: std::array::from_fn(|_| vec![0.0; count]),
            attributes: columns
                .map(|(name, components, kind)| {
                    Attribute::new(name, components, kind.zeros(count * components))
                })
                .collect(),
        }
    }

    /// Cuts the columns into pieces of so many rows: for each piece the three axes, then the attributes.
    pub(crate) fn split(&mut self, rows: &[usize]) -> Vec<Vec<Slot<'_>>> {
        let mut pieces: Vec<Vec<Slot>> =
            rows.iter().map(|_| Vec::with_capacity(3 + self.attributes.len())).collect();
        for (axis, offsets) in self.offsets.iter_mut().enumerate() {
            let origin = self.origin[axis];
            deal(offsets, 1, rows, &mut pieces, |out| Slot::Offset { origin, out });
        }
        for attribute in &mut self.attributes {
            let components = attribute.components;
            match &mut attribute.values {
                Values::F32(values) => deal(values, components, rows, &mut pieces, Slot::F32),
                Values::F64(values) => deal(values, components, rows, &mut pieces, Slot::F64),
                Values::I32(values) => deal(values, components, rows, &mut pieces, Slot::I32),
                Values::I64(values) => deal(values, components, rows, &mut pieces, Slot::I64),
                Values::U8(values) => deal(values, components, rows, &mut pieces, Slot::U8),
                Values::Text { .. } | Values::Frozen(_) => {
                    unreachable!("Kind::zeros makes columns of numbers")
                }
            }
        }
        pieces
    }

    /// What was filled, as particles' columns.
    pub(crate) fn into_columns(self) -> Columns {
        Columns {
            positions: Positions::from_offsets(self.origin, self.offsets),
            attributes: self.attributes,
            ..Columns::default()
        }
    }
}

/// Columns that grow by batches of rows, all around the origin of the first.
#[derive(Debug, Default)]
pub(crate) struct Growing {
    origin: Option<DVec3>,
    offsets: [Vec<f32>; 3],
    attributes: Vec<Attribute>,
}

impl Growing {
    /// How many rows there are.
    pub(crate) fn len(&self) -> usize {
        self.offsets[0].len()
    }

    /// Appends rows, of `most` in the end. Room is made for as many as are there, once more; never for more than `most`.
    pub(crate) fn add(
        &mut self,
        path: &Path,
        rows: &Layout,
        most: usize,
        progress: &dyn Progress,
    ) -> Result<()> {
        let batch = join_around(path, std::slice::from_ref(rows), self.origin, (0, progress))?;
        let room = (2 * self.len()).max(self.len() + rows.count).min(most.max(self.len() + rows.count));
        self.origin.get_or_insert(batch.origin);
        for (column, more) in self.offsets.iter_mut().zip(&batch.offsets) {
            extend(column, more, room);
        }
        if self.attributes.is_empty() {
            self.attributes = batch.attributes;
            return Ok(());
        }
        let pairs = self.attributes.par_iter_mut().zip(batch.attributes);
        pairs.for_each(|(attribute, more)| {
            append(&mut attribute.values, more.values, room * attribute.components)
        });
        Ok(())
    }

    /// All rows, as particles' columns.
    pub(crate) fn into_columns(self) -> Columns {
        Columns {
            positions: Positions::from_offsets(self.origin.unwrap_or(DVec3::ZERO), self.offsets),
            attributes: self.attributes,
            ..Columns::default()
        }
    }
}

/// Appends values to a column that has room for `room` then.
fn extend<T: Copy>(column: &mut Vec<T>, more: &[T], room: usize) {
    column.reserve_exact(room.saturating_sub(column.len()));
    column.extend_from_slice(more);
}

/// Appends values that may be of another type: integers that are too large for the type before are floats.
fn append(column: &mut Values, more: Values, room: usize) {
    let doubles = |values: &Values| (0..values.len()).map(|place| values.number(place)).collect::<Vec<f64>>();
    match (&mut *column, &more) {
        (Values::F32(column), Values::F32(more)) => extend(column, more, room),
        (Values::F64(column), Values::F64(more)) => extend(column, more, room),
        (Values::I32(column), Values::I32(more)) => extend(column, more, room),
        (Values::I64(column), Values::I64(more)) => extend(column, more, room),
        (Values::U8(column), Values::U8(more)) => extend(column, more, room),
        (column, more) => {
            let mut wide = doubles(column);
            extend(&mut wide, &doubles(more), room);
            *column = Values::F64(wide);
        }
    }
}

/// Hands each piece its share of a column.
fn deal<'a, T>(
    mut values: &'a mut [T],
    components: usize,
    rows: &[usize],
    pieces: &mut [Vec<Slot<'a>>],
    slot: impl Fn(&'a mut [T]) -> Slot<'a>,
) {
    for (piece, rows) in pieces.iter_mut().zip(rows) {
        let (mine, rest) = values.split_at_mut(rows * components);
        piece.push(slot(mine));
        values = rest;
    }
}

/// A piece of a column, to be filled by one thread.
pub(crate) enum Slot<'a> {
    /// A coordinate, stored as its offset from the origin.
    Offset {
        /// The origin's coordinate.
        origin: f64,
        /// The offsets.
        out: &'a mut [f32],
    },
    F32(&'a mut [f32]),
    F64(&'a mut [f64]),
    I32(&'a mut [i32]),
    I64(&'a mut [i64]),
    U8(&'a mut [u8]),
}

impl Slot<'_> {
    /// Fills the slot's rows `rows` from a source in which the slot's first row is particle `start`. A number of another type
    /// than the slot's becomes the nearest one that the slot can hold.
    pub(super) fn fill(&mut self, source: &Source, start: usize, components: usize, rows: Range<usize>) {
        self.fill_from(source, start + rows.start, components, rows);
    }

    /// The same from a source in which the first of the rows is particle `first`.
    pub(super) fn fill_from(&mut self, source: &Source, first: usize, components: usize, rows: Range<usize>) {
        let range = rows.start * components..rows.end * components;
        match (self, source.kind) {
            (Self::Offset { origin, out }, _) => {
                source.convert_all(&mut out[range], first, 1, |value| (value - *origin) as f32)
            }
            (Self::F64(out), _) => source.convert_all(&mut out[range], first, components, |value| value),
            (Self::F32(out), Kind::F16) => source.fill(&mut out[range], first, components, |it: Half| it.0),
            (Self::F32(out), Kind::F32) => source.fill(&mut out[range], first, components, |it: f32| it),
            (Self::F32(out), _) => source.convert_all(&mut out[range], first, components, |it| it as f32),
            (Self::I32(out), Kind::I8) => source.fill(&mut out[range], first, components, |it: i8| it.into()),
            (Self::I32(out), Kind::I16) => {
                source.fill(&mut out[range], first, components, |it: i16| it.into())
            }
            (Self::I32(out), Kind::U16) => {
                source.fill(&mut out[range], first, components, |it: u16| it.into())
            }
            (Self::I32(out), Kind::I32) => source.fill(&mut out[range], first, components, |it: i32| it),
            (Self::I32(out), _) => source.convert_all(&mut out[range], first, components, |it| it as i32),
            (Self::I64(out), Kind::U32) => {
                source.fill(&mut out[range], first, components, |it: u32| it.into())
            }
            (Self::I64(out), Kind::I64 | Kind::U64) => {
                source.fill(&mut out[range], first, components, |it: i64| it)
            }
            (Self::I64(out), _) => source.convert_all(&mut out[range], first, components, |it| it as i64),
            (Self::U8(out), Kind::U8) => source.fill(&mut out[range], first, components, |it: u8| it),
            (Self::U8(out), _) => source.convert_all(&mut out[range], first, components, |it| it as u8),
        }
    }

    /// Fills the slot's rows `rows` with one number.
    pub(super) fn fill_constant(&mut self, value: f64, components: usize, rows: Range<usize>) {
        let range = rows.start * components..rows.end * components;
        match self {
            Self::Offset { origin, out } => out[range].fill((value - *origin) as f32),
            Self::F32(out) => out[range].fill(value as f32),
            Self::F64(out) => out[range].fill(value),
            Self::I32(out) => out[range].fill(value as i32),
            Self::I64(out) => out[range].fill(value as i64),
            Self::U8(out) => out[range].fill(value as u8),
        }
    }
}

/// Colors named `r`, `g`, `b` get their long names: an attribute `r` alone would be taken for a radius.
pub(crate) fn spell_out_colors(attributes: &mut [Attribute], conventions: &mut Vec<String>) {
    const COLORS: [(&str, &str); 3] = [("r", "red"), ("g", "green"), ("b", "blue")];
    let place = |name: &str| attributes.iter().position(|it| it.components == 1 && it.name == name);
    let places = COLORS.map(|(short, _)| place(short));
    if let [Some(red), Some(green), Some(blue)] = places {
        for (place, (_, long)) in [red, green, blue].into_iter().zip(COLORS) {
            attributes[place].name = long.into();
        }
        conventions.push("r, g, b are taken as a color and named red, green, blue".into());
    }
}

/// The columns as a frame, checked.
pub(crate) fn frame(columns: Columns, conventions: Vec<String>, warnings: Vec<String>) -> Result<Frame> {
    Ok(Frame { particles: Particles::new(columns)?, conventions, given: Vec::new(), warnings })
}

/// The file promises more than it holds.
pub(crate) fn truncated(path: &Path, promised: u64, row_bytes: usize, available: usize) -> Error {
    let what = format!(
        "the header promises {promised} particles of {row_bytes} bytes, {available} bytes are there: \
         enough for {}",
        available as u64 / row_bytes.max(1) as u64
    );
    Error::format(
        path,
        "",
        what,
        "the file is cut off or its header is wrong: copy it again or write it again",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_rows_than_one_job_are_gathered_in_order() {
        let count = 3 * JOB_ROWS + 17;
        let bytes: Vec<u8> =
            (0..count as u32).flat_map(|id| [id.to_le_bytes(), (2 * id).to_le_bytes()]).flatten().collect();
        let source = |start| Source {
            bytes: &bytes,
            kind: Kind::U32,
            order: Order::Little,
            start,
            stride: 8,
            step: 4,
        };
        let field = Field { name: "both".into(), components: 2, source: source(0) };
        let layout = Layout { count, axes: [Some(source(4)), None, Some(source(0))], fields: vec![field] };
        let columns = layout.gather(Path::new("test"), bytes.len(), &()).unwrap().into_columns();
        for id in 0..count {
            assert_eq!(columns.positions.world(id), DVec3::new(2.0 * id as f64, 0.0, id as f64));
            let both = [0, 1].map(|component| columns.attributes[0].number(id, component));
            assert_eq!(both, [id as f64, 2.0 * id as f64]);
        }
    }

    #[test]
    fn shares_in_several_places_follow_each_other() {
        let bytes: Vec<u8> = (0..3 * JOB_ROWS as u32).flat_map(u32::to_le_bytes).collect();
        let source =
            |bytes| Source { bytes, kind: Kind::U32, order: Order::Little, start: 0, stride: 4, step: 0 };
        let layout = |first: usize, count: usize| {
            let source = source(&bytes[4 * first..]);
            let fields = vec![Field { name: "id".into(), components: 1, source }];
            Layout { count, axes: [Some(source), None, None], fields }
        };
        let layouts = [layout(5, 0), layout(7, JOB_ROWS + 1), layout(0, 3)];
        let columns = join(Path::new("test"), &layouts, 100, &()).unwrap().into_columns();
        let wanted: Vec<i64> = (7..JOB_ROWS as i64 + 8).chain(0..3).collect();
        assert_eq!(columns.positions.world(JOB_ROWS + 1).x, 0.0);
        assert_eq!(columns.positions.world(JOB_ROWS).x, wanted[JOB_ROWS] as f64);
        assert_eq!(columns.attributes[0].values, Values::I64(wanted));
        assert!(join(Path::new("test"), &[layout(0, 1), layout(5, 3 * JOB_ROWS)], 0, &()).is_err());
    }

    #[test]
    fn integers_beyond_63_bits_become_floats() {
        let bytes: Vec<u8> = [3u64, u64::MAX].into_iter().flat_map(u64::to_be_bytes).collect();
        let source =
            Source { bytes: &bytes, kind: Kind::U64, order: Order::Big, start: 0, stride: 8, step: 0 };
        let gather = |count| {
            let field = Field { name: "id".into(), components: 1, source };
            let layout = Layout { count, axes: [None; 3], fields: vec![field] };
            layout.gather(Path::new("test"), 0, &()).unwrap().attributes.remove(0).values
        };
        assert_eq!(gather(1), Values::I64(vec![3]));
        assert_eq!(gather(2), Values::F64(vec![3.0, u64::MAX as f64]));
    }

    #[test]
    fn hostile_counts_are_refused_before_memory_is_asked_for() {
        let source =
            Source { bytes: &[0; 64], kind: Kind::F32, order: Order::Little, start: 0, stride: 4, step: 4 };
        for count in [17, 1 << 40, 1 << 60, usize::MAX] {
            let layout = Layout { count, axes: [Some(source); 3], fields: vec![] };
            assert!(layout.gather(Path::new("test"), 64, &()).is_err(), "{count}");
        }
    }
}
