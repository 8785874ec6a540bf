//! Parquet: row groups of packed columns, decoded side by side.
//!
//! Nothing but the footer and the pages of the wanted columns is read, a few batches of all columns at a time, so that large row groups need
//! no more memory than small ones. Pages are unpacked by `pages.rs`: snappy, gzip, LZ4, zstd.
//! Source: Apache Parquet format 2.12, parquet.apache.org.

use std::path::Path;
use std::sync::Arc;

use arrow_schema::Schema;
use bytes::Bytes;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReader, RowGroups,
};
use parquet::arrow::{ProjectionMask, parquet_to_arrow_field_levels};
use parquet::column::page::{PageIterator, PageReader};
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::metadata::{
    ColumnChunkMetaData, ParquetMetaData, ParquetMetaDataReader, RowGroupMetaData,
};
use rayon::prelude::*;
use tyndall::{Error, Progress, Result};

use super::column::part;
use super::pages::Pages;
use super::plan::{Leaf, Place};
use super::{ABOUT, BATCH_ROWS, Block, HINT, MOST_RATIO, ROUND_BYTES, Shared, Table, thrift};
use crate::read::content::{Content, kept};
use crate::read::guard::guarded;
use crate::read::map::released;
use crate::read::{Index, Request, Span};
use crate::sequence::{Frame, Options};

const MAGIC: &[u8] = b"PAR1";
/// Values of a list of a row, beyond which it is no vector.
const MOST_VALUES: u64 = 64;

/// Whether the file begins like Parquet.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}

/// A file whose footer was read.
struct File {
    content: Arc<Content>,
    bytes: Bytes,
    metadata: ArrowReaderMetadata,
}

impl File {
    fn new(path: &Path, bytes: &[u8]) -> Result<Self> {
        let wrong = |what: String| Error::format(path, "footer", what, HINT);
        let footer = footer(bytes).map_err(|what| wrong(what.to_string()))?;
        if !thrift::is_shallow(footer) {
            return Err(wrong("the metadata cannot be understood".to_string()));
        }
        let read = || {
            let metadata = Arc::new(ParquetMetaDataReader::decode_metadata(footer)?);
            // A schema of Arrow that does not fit the file is not needed to read it.
            ArrowReaderMetadata::try_new(metadata.clone(), ArrowReaderOptions::new()).or_else(|_| {
                ArrowReaderMetadata::try_new(
                    metadata,
                    ArrowReaderOptions::new().with_skip_arrow_metadata(true),
                )
            })
        };
        let metadata = guarded(read)
            .ok_or_else(|| wrong("the metadata are damaged".to_string()))?
            .map_err(|error| wrong(format!("the metadata cannot be understood: {error}")))?;
        let content = Arc::new(kept(path, bytes));
        Ok(Self { bytes: Bytes::from_owner(Shared(content.clone())), content, metadata })
    }

    fn schema(&self) -> &Schema {
        self.metadata.schema()
    }

    /// Rows of a row group.
    fn rows(&self, group: usize) -> usize {
        self.groups()[group].num_rows() as usize
    }

    fn groups(&self) -> &[RowGroupMetaData] {
        self.metadata.metadata().row_groups()
    }

    /// What is stored of a column of the table in a row group.
    fn columns_of(&self, group: usize, root: usize) -> impl Iterator<Item = &ColumnChunkMetaData> {
        let descriptor = self.metadata.parquet_schema();
        let mine =
            (0..descriptor.num_columns()).filter(move |&it| descriptor.get_column_root_idx(it) == root);
        mine.map(move |it| self.groups()[group].column(it))
    }

    /// Bytes of some columns in a row group, as the file tells.
    fn packed_bytes(&self, group: usize, roots: &[usize]) -> f64 {
        let columns = roots.iter().flat_map(|&root| self.columns_of(group, root));
        columns.map(|it| it.compressed_size().max(0) as f64).sum()
    }
}

/// The metadata at the end of the file.
fn footer(bytes: &[u8]) -> std::result::Result<&[u8], &'static str> {
    let Some((rest, tail)) = bytes.split_last_chunk::<8>() else { return Err("the file is cut off") };
    if !tail.ends_with(MAGIC) {
        return Err("the file does not end like Parquet: it is cut off, or was not closed");
    }
    let size = u32::from_le_bytes([tail[0], tail[1], tail[2], tail[3]]) as usize;
    let start = rest.len().checked_sub(size).filter(|it| *it >= MAGIC.len());
    start.map(|start| &rest[start..]).ok_or("its metadata are larger than the file")
}

/// The number of rows; fails where there are more than the file could hold.
fn rows(path: &Path, file: &File, row_bytes: usize) -> Result<usize> {
    let rows = file
        .groups()
        .iter()
        .try_fold(0usize, |sum, it| sum.checked_add(usize::try_from(it.num_rows()).ok()?));
    let most = file.bytes.len().saturating_mul(MOST_RATIO);
    let bytes = rows.and_then(|rows| rows.checked_mul(row_bytes));
    match (rows, bytes) {
        (Some(rows), Some(bytes)) if bytes <= most => Ok(rows),
        _ => {
            let what = format!(
                "it promises {} rows of {row_bytes} bytes, which {} bytes cannot hold",
                rows.map_or("too many".to_string(), |it| it.to_string()),
                file.bytes.len()
            );
            Err(Error::format(path, "footer", what, HINT))
        }
    }
}

/// A table is one frame; its footer has to be readable.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    rows(path, &File::new(path, bytes)?, 1)?;
    Ok(Index { frames: vec![Span { offset: 0, line: 1, bytes: None }], ..Index::default() })
}

/// Reads the table.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    _: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    let file = File::new(path, bytes)?;
    let progress = &released(file.content.map(), progress);
    let mut table = Table::new(path, file.schema(), request)?;
    let row_bytes = table.plan.leaves.iter().map(Leaf::row_bytes).sum();
    rows(path, &file, row_bytes)?;
    let roots = table.roots();
    let packed = |group| file.packed_bytes(group, &roots);
    progress.begin("read", Some((0..file.groups().len()).map(packed).sum::<f64>() as u64), "B");
    let mut groups = (0..file.groups().len()).map(|group| Reading {
        group,
        left: file.rows(group),
        columns: roots.iter().map(|&root| Column { group, root, found: 0, reader: None }).collect(),
    });
    // A group of which only some rows were read.
    let mut begun: Option<Reading> = None;
    loop {
        let (mut round, mut bytes) = (Vec::new(), 0);
        while bytes < ROUND_BYTES
            && let Some(mut reading) = begun.take().or_else(|| groups.next())
        {
            let mut batches = Vec::new();
            while bytes < ROUND_BYTES && reading.left > 0 {
                let rows = reading.left.min(BATCH_ROWS);
                reading.left -= rows;
                bytes += rows * row_bytes.max(1);
                batches.push(rows);
            }
            round.push((reading, batches));
        }
        if round.is_empty() {
            break;
        }
        let blocks = decoded(path, &file, &table.plan.leaves, &mut round, progress)?;
        table.append(blocks)?;
        for (reading, batches) in &round {
            let share = batches.iter().sum::<usize>() as f64 / file.rows(reading.group).max(1) as f64;
            progress.advance((share * packed(reading.group)) as u64);
        }
        begun = round.pop().map(|(reading, _)| reading).filter(|it| it.left > 0);
    }
    let about = file.schema().metadata().get(ABOUT).cloned();
    table.finish(about.as_deref())
}

/// A row group while it is read.
struct Reading {
    group: usize,
    /// Rows behind those that were read.
    left: usize,
    columns: Vec<Column>,
}

/// The next rows of row groups, in batches of so many rows each: all columns side by side.
fn decoded(
    path: &Path,
    file: &File,
    leaves: &[Leaf],
    round: &mut [(Reading, Vec<usize>)],
    progress: &dyn Progress,
) -> Result<Vec<(usize, Block)>> {
    let mut jobs: Vec<(&mut Column, &[usize])> = Vec::new();
    for (reading, batches) in &mut *round {
        jobs.extend(reading.columns.iter_mut().map(|column| (column, &batches[..])));
    }
    let decoded: Vec<_> = jobs
        .par_iter_mut()
        .map(|(column, batches)| {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let mine: Vec<&Leaf> = leaves.iter().filter(|it| it.root == column.root).collect();
            let next = guarded(|| column.next(file, &mine, batches));
            next.unwrap_or_else(|| Err("the data are damaged".to_string())).map_err(|what| {
                let name = file.schema().field(column.root).name();
                let place = format!("row group {}, column '{name}'", column.group + 1);
                Error::format(path, place, what, HINT)
            })
        })
        .collect();
    // From columns of batches to blocks of all columns.
    let (mut decoded, mut blocks) = (decoded.into_iter(), Vec::new());
    for (reading, batches) in &*round {
        let roots: Vec<usize> = reading.columns.iter().map(|it| it.root).collect();
        let mut columns: Vec<Vec<Block>> = decoded.by_ref().take(roots.len()).collect::<Result<_>>()?;
        for (batch, &rows) in batches.iter().enumerate() {
            let mut parts: Vec<_> =
                columns.iter_mut().map(|it| std::mem::take(&mut it[batch]).into_iter()).collect();
            let part = |leaf: &Leaf| {
                let root = roots.binary_search(&leaf.root).expect("each leaf has a root");
                parts[root].next().expect("a part a leaf")
            };
            blocks.push((rows, leaves.iter().map(part).collect::<Block>()));
        }
    }
    Ok(blocks)
}

/// A column of a row group while it is read.
struct Column {
    group: usize,
    root: usize,
    /// Rows that were read.
    found: usize,
    /// What decodes it, from the first batch to the last one.
    reader: Option<ParquetRecordBatchReader>,
}

impl Column {
    /// What the leaves have of the next batches, which have so many rows; on failure why they cannot be decoded.
    fn next(
        &mut self,
        file: &File,
        leaves: &[&Leaf],
        batches: &[usize],
    ) -> std::result::Result<Vec<Block>, String> {
        if leaves.iter().any(|it| it.place == Place::List) && self.has_long_lists(file) {
            let long = || Err(format!("its lists have more than {MOST_VALUES} numbers"));
            return Ok(batches.iter().map(|_| leaves.iter().map(|_| long()).collect()).collect());
        }
        let rows = file.rows(self.group);
        let reader = match &mut self.reader {
            Some(reader) => reader,
            none => none.insert(reader(file, self.group, self.root).map_err(|it| it.to_string())?),
        };
        let mut blocks = Vec::with_capacity(batches.len());
        for &wanted in batches {
            let batch = reader.next().transpose().map_err(|it| it.to_string())?;
            let count = batch.as_ref().map_or(0, |it| it.num_rows());
            self.found += count;
            let Some(batch) = batch.filter(|_| count == wanted) else {
                return Err(format!("{} rows were found, {rows} were promised", self.found));
            };
            blocks.push(leaves.iter().map(|leaf| part(batch.column(0), leaf)).collect());
        }
        if self.found == rows {
            self.reader = None;
        }
        Ok(blocks)
    }

    fn has_long_lists(&self, file: &File) -> bool {
        let most = file.rows(self.group) as u64 * MOST_VALUES;
        file.columns_of(self.group, self.root).any(|it| it.num_values() as u64 > most)
    }
}

/// Decodes a column of a row group.
fn reader(file: &File, group: usize, root: usize) -> ParquetResult<ParquetRecordBatchReader> {
    let descriptor = file.metadata.parquet_schema();
    let mask = ProjectionMask::roots(descriptor, [root]);
    let levels = parquet_to_arrow_field_levels(descriptor, mask, Some(file.schema().fields()))?;
    ParquetRecordBatchReader::try_new_with_row_groups(&levels, &Group { file, group }, BATCH_ROWS, None)
}

/// The pages of a row group.
struct Group<'a> {
    file: &'a File,
    group: usize,
}

impl Group<'_> {
    fn metadata(&self) -> &RowGroupMetaData {
        &self.file.groups()[self.group]
    }
}

impl RowGroups for Group<'_> {
    fn num_rows(&self) -> usize {
        self.metadata().num_rows() as usize
    }

    fn column_chunks(&self, column: usize) -> ParquetResult<Box<dyn PageIterator>> {
        let column = self.metadata().column(column);
        let outside = || ParquetError::General("the column lies outside of the file".to_string());
        // Some writers tell a dictionary's place as 0 where there is none.
        let dictionary =
            column.dictionary_page_offset().filter(|it| (1..column.data_page_offset()).contains(it));
        let start =
            usize::try_from(dictionary.unwrap_or(column.data_page_offset())).map_err(|_| outside())?;
        let size = usize::try_from(column.compressed_size()).map_err(|_| outside())?;
        let end = start.checked_add(size).filter(|it| *it <= self.file.bytes.len()).ok_or_else(outside)?;
        let values = u64::try_from(column.num_values()).map_err(|_| outside())?;
        let pages = Pages::new(self.file.bytes.slice(start..end), column.compression_codec(), values);
        Ok(Box::new(One(Some(Box::new(pages)))))
    }

    fn row_groups(&self) -> Box<dyn Iterator<Item = &RowGroupMetaData> + '_> {
        Box::new(std::iter::once(self.metadata()))
    }

    fn metadata(&self) -> &ParquetMetaData {
        self.file.metadata.metadata()
    }
}

/// The pages of one column.
struct One(Option<Box<dyn PageReader>>);

impl Iterator for One {
    type Item = ParquetResult<Box<dyn PageReader>>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.take().map(Ok)
    }
}

impl PageIterator for One {}
