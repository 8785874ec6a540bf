//! Parquet: row groups of packed columns, decoded side by side.
//!
//! Nothing but the footer and the pages of the wanted columns is read. Pages are unpacked by `pages.rs`: snappy, gzip, LZ4, zstd.
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
use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader, RowGroupMetaData};
use rayon::prelude::*;
use tyndall::{Error, Progress, Result};

use super::column::part;
use super::pages::Pages;
use super::plan::{Leaf, Place};
use super::{ABOUT, Block, HINT, MOST_RATIO, ROUND_ROWS, Table, thrift};
use crate::read::content::kept;
use crate::read::guard::guarded;
use crate::read::{Index, Request, Span};
use crate::sequence::{Frame, Options};

const MAGIC: &[u8] = b"PAR1";
/// Rows that are decoded at a time.
const BATCH_ROWS: usize = 1 << 16;
/// Values of a list of a row, beyond which it is no vector.
const MOST_VALUES: u64 = 64;

/// Whether the file begins like Parquet.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}

/// A file whose footer was read.
struct File {
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
        Ok(Self { bytes: Bytes::from_owner(kept(path, bytes)), metadata })
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
    let mut table = Table::new(path, file.schema(), request)?;
    let row_bytes = table.plan.leaves.iter().map(Leaf::row_bytes).sum();
    let all = rows(path, &file, row_bytes)?;
    progress.begin("read", Some(all as u64), "rows");
    let roots = table.roots();
    let mut group = 0;
    while group < file.groups().len() {
        let first = group;
        let mut round = 0;
        while group < file.groups().len() && (group == first || round < ROUND_ROWS) {
            round += file.rows(group);
            group += 1;
        }
        let jobs: Vec<(usize, usize)> =
            (first..group).flat_map(|group| roots.iter().map(move |&root| (group, root))).collect();
        let leaves = &table.plan.leaves;
        let decoded: Vec<_> = jobs
            .par_iter()
            .map(|&(group, root)| {
                let mine: Vec<&Leaf> = leaves.iter().filter(|it| it.root == root).collect();
                let read =
                    || if progress.cancelled() { Ok(Vec::new()) } else { column(&file, group, root, &mine) };
                guarded(read).unwrap_or_else(|| Err("the data are damaged".to_string()))
            })
            .collect();
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        // From columns of batches to blocks of all columns.
        let mut columns = Vec::new();
        for ((group, root), batches) in jobs.into_iter().zip(decoded) {
            columns.push(batches.map_err(|what| {
                let name = file.schema().field(root).name();
                let place = format!("row group {}, column '{name}'", group + 1);
                Error::format(path, place, what, HINT)
            })?);
        }
        let mut blocks = Vec::new();
        for (group, columns) in (first..group).zip(columns.chunks_mut(roots.len())) {
            for (batch, rows) in batches(file.rows(group)).enumerate() {
                let mut parts: Vec<_> =
                    columns.iter_mut().map(|it| std::mem::take(&mut it[batch]).into_iter()).collect();
                let part = |leaf: &Leaf| {
                    let root = roots.binary_search(&leaf.root).expect("each leaf has a root");
                    parts[root].next().expect("a part a leaf")
                };
                blocks.push((rows, leaves.iter().map(part).collect::<Block>()));
            }
        }
        table.append(blocks)?;
        progress.advance(round as u64);
    }
    let about = file.schema().metadata().get(ABOUT).cloned();
    table.finish(about.as_deref())
}

/// The numbers of rows that are decoded at a time.
fn batches(rows: usize) -> impl Iterator<Item = usize> {
    (0..rows).step_by(BATCH_ROWS).map(move |start| BATCH_ROWS.min(rows - start))
}

/// What the leaves have of a column of a row group, batch by batch; on failure why it cannot be decoded.
fn column(
    file: &File,
    group: usize,
    root: usize,
    leaves: &[&Leaf],
) -> std::result::Result<Vec<Block>, String> {
    let said = |error: &dyn std::fmt::Display| error.to_string();
    let descriptor = file.metadata.parquet_schema();
    let rows = file.rows(group);
    if leaves.iter().any(|it| it.place == Place::List) {
        let values = |column: usize| file.groups()[group].column(column).num_values();
        let mut mine = (0..descriptor.num_columns()).filter(|&it| descriptor.get_column_root_idx(it) == root);
        if mine.any(|it| values(it) as u64 > rows as u64 * MOST_VALUES) {
            let long = || Err(format!("its lists have more than {MOST_VALUES} numbers"));
            return Ok(batches(rows).map(|_| leaves.iter().map(|_| long()).collect()).collect());
        }
    }
    let mask = ProjectionMask::roots(descriptor, [root]);
    let levels = parquet_to_arrow_field_levels(descriptor, mask, Some(file.schema().fields()))
        .map_err(|it| said(&it))?;
    let mut reader =
        ParquetRecordBatchReader::try_new_with_row_groups(&levels, &Group { file, group }, BATCH_ROWS, None)
            .map_err(|it| said(&it))?;
    let (mut blocks, mut found) = (Vec::new(), 0);
    for wanted in batches(rows) {
        let Some(batch) = reader.next() else { break };
        let batch = batch.map_err(|it| said(&it))?;
        found += batch.num_rows();
        if batch.num_rows() != wanted {
            break;
        }
        blocks.push(leaves.iter().map(|leaf| part(batch.column(0), leaf)).collect());
    }
    if found != rows {
        return Err(format!("{found} rows were found, {rows} were promised"));
    }
    Ok(blocks)
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
