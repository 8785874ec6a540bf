//! Tables of Apache Arrow: Parquet, with snappy, and Arrow's own files (Feather 2), with LZ4.
//!
//! Columns x, y, z, then a column for each component of each attribute. Units stand with their columns; cell, time, unit of length and
//! a radius that all share in the file's metadata, as JSON under the key `tyndall`.

use std::collections::HashMap;
use std::io;
use std::ops::Range;
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, DictionaryArray, Float32Array, Float64Array, Int32Array, Int64Array, RecordBatch, StringArray,
    UInt8Array,
};
use arrow_ipc::CompressionType;
use arrow_ipc::writer::{FileWriter, IpcWriteOptions};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;
use parquet::schema::types::ColumnPath;
use rayon::prelude::*;
use tyndall::particles::{Attribute, View};

use super::snapshot::{Names, Snapshot, component_names};
use super::{Out, Place};
use crate::read::arrow::{ABOUT, About};

/// Rows of a row group: several threads read several at once.
const GROUP_ROWS: usize = 1 << 18;
/// Rows of a block of Arrow.
const BLOCK_ROWS: usize = 1 << 16;

/// Writes Parquet.
pub(super) fn write_parquet(out: &mut dyn Out, snapshot: &Snapshot, _: &mut Place) -> io::Result<()> {
    let table = Table::of(snapshot);
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(concat!("Tyndall ", env!("CARGO_PKG_VERSION")).to_string())
        .set_max_row_group_row_count(Some(GROUP_ROWS));
    // Measured numbers hardly come twice: a dictionary of them would only be one more copy.
    for field in table.schema.fields().iter().filter(|it| it.data_type().is_floating()) {
        let column = ColumnPath::new(vec![field.name().clone()]);
        properties = properties.set_column_dictionary_enabled(column, false);
    }
    let properties = properties.build();
    let mut writer =
        ArrowWriter::try_new(out, table.schema.clone(), Some(properties)).map_err(io::Error::other)?;
    for rows in blocks(snapshot.len(), GROUP_ROWS) {
        writer.write(&table.batch(rows)?).map_err(io::Error::other)?;
    }
    writer.close().map_err(io::Error::other).map(drop)
}

/// Writes a file of Arrow.
pub(super) fn write_ipc(out: &mut dyn Out, snapshot: &Snapshot, _: &mut Place) -> io::Result<()> {
    let table = Table::of(snapshot);
    let options = IpcWriteOptions::default()
        .try_with_compression(Some(CompressionType::LZ4_FRAME))
        .map_err(io::Error::other)?;
    let mut writer =
        FileWriter::try_new_with_options(out, &table.schema, options).map_err(io::Error::other)?;
    for rows in blocks(snapshot.len(), BLOCK_ROWS) {
        writer.write(&table.batch(rows)?).map_err(io::Error::other)?;
    }
    writer.finish().map_err(io::Error::other)
}

/// The rows, so many at a time.
fn blocks(count: usize, rows: usize) -> impl Iterator<Item = Range<usize>> {
    (0..count).step_by(rows).map(move |start| start..count.min(start + rows))
}

/// Where the values of a column come from.
enum Source<'a> {
    Axis(usize),
    Component(&'a Attribute, usize),
}

/// A snapshot as a table.
struct Table<'a> {
    snapshot: &'a Snapshot<'a>,
    schema: Arc<Schema>,
    columns: Vec<Source<'a>>,
    /// The names of each column of words.
    words: Vec<Option<ArrayRef>>,
    is_single: bool,
}

impl<'a> Table<'a> {
    fn of(snapshot: &'a Snapshot<'a>) -> Self {
        let particles = snapshot.particles;
        let is_single = snapshot.fits_f32();
        let (mut fields, mut columns, mut words) = (Vec::new(), Vec::new(), Vec::new());
        let mut names = Names::beside(&["x", "y", "z"]);
        let mut add = |name: &str, kind: DataType, unit: Option<&str>, source: Source<'a>| {
            let metadata = unit.map(|it| ("unit".to_string(), it.to_string()));
            let metadata: HashMap<String, String> = metadata.into_iter().collect();
            fields.push(Field::new(name, kind, false).with_metadata(metadata));
            columns.push(source);
        };
        let kind = if is_single { DataType::Float32 } else { DataType::Float64 };
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            add(name, kind.clone(), particles.length_unit(), Source::Axis(axis));
            words.push(None);
        }
        for attribute in &snapshot.attributes {
            let (kind, known) = match attribute.values.view() {
                View::F32(_) => (DataType::Float32, None),
                View::F64(_) => (DataType::Float64, None),
                View::I32(_) => (DataType::Int32, None),
                View::I64(_) => (DataType::Int64, None),
                View::U8(_) => (DataType::UInt8, None),
                View::Text { names, .. } => {
                    let names: ArrayRef = Arc::new(StringArray::from_iter_values(names));
                    (DataType::Dictionary(DataType::Int32.into(), DataType::Utf8.into()), Some(names))
                }
            };
            for (component, name) in component_names(attribute).into_iter().enumerate() {
                let source = Source::Component(attribute, component);
                add(&names.distinct(name), kind.clone(), attribute.unit.as_deref(), source);
                words.push(known.clone());
            }
        }
        let about = About {
            time: particles.time(),
            time_unit: particles.time_unit().map(str::to_string),
            length_unit: particles.length_unit().map(str::to_string),
            cell: particles.cell().cloned(),
            radius: snapshot.uniform_radius(),
        };
        let metadata = HashMap::from([(ABOUT.to_string(), about.to_text())]);
        let schema = Arc::new(Schema::new_with_metadata(fields, metadata));
        Self { snapshot, schema, columns, words, is_single }
    }

    fn batch(&self, rows: Range<usize>) -> io::Result<RecordBatch> {
        let column =
            |(source, words): (&Source, &Option<ArrayRef>)| self.column(source, words.as_ref(), rows.clone());
        let columns = self.columns.par_iter().zip(&self.words).map(column).collect();
        RecordBatch::try_new(self.schema.clone(), columns).map_err(io::Error::other)
    }

    fn column(&self, source: &Source, words: Option<&ArrayRef>, rows: Range<usize>) -> ArrayRef {
        let (attribute, component) = match *source {
            Source::Axis(axis) => {
                let coordinates = rows.map(|id| self.snapshot.position(id)[axis]);
                return match self.is_single {
                    true => Arc::new(Float32Array::from_iter_values(coordinates.map(|it| it as f32))),
                    false => Arc::new(Float64Array::from_iter_values(coordinates)),
                };
            }
            Source::Component(attribute, component) => (attribute, component),
        };
        let places = rows.map(|id| id * attribute.components + component);
        match attribute.values.view() {
            View::F32(values) => Arc::new(Float32Array::from_iter_values(places.map(|it| values[it]))),
            View::F64(values) => Arc::new(Float64Array::from_iter_values(places.map(|it| values[it]))),
            View::I32(values) => Arc::new(Int32Array::from_iter_values(places.map(|it| values[it]))),
            View::I64(values) => Arc::new(Int64Array::from_iter_values(places.map(|it| values[it]))),
            View::U8(values) => Arc::new(UInt8Array::from_iter_values(places.map(|it| values[it]))),
            View::Text { codes, .. } => {
                let keys = Int32Array::from_iter_values(places.map(|it| codes[it] as i32));
                let names = words.expect("a column of words has names").clone();
                Arc::new(DictionaryArray::<Int32Type>::new(keys, names))
            }
        }
    }
}
