//! Arrow's own files (also called Feather, version 2) and streams: blocks of rows as they lie in memory.
//!
//! A file tells at its end where its blocks are; a stream is walked through. Arrays are read where they lie in the mapped file unless they
//! are packed. Source: Apache Arrow columnar format 1.5, "Serialization and interprocess communication".

use std::path::Path;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::{ArrayRef, RecordBatch};
use arrow_buffer::Buffer;
use arrow_ipc::reader::FileDecoder;
use arrow_ipc::{
    Block as Place, CompressionType, MessageHeader, MetadataVersion, RecordBatch as Packed, convert,
    root_as_footer, root_as_message,
};
use arrow_schema::{Schema, SchemaRef};
use bytes::Bytes;
use rayon::prelude::*;
use tyndall::{Error, Progress, Result};

use super::column::part;
use super::plan::Leaf;
use super::{ABOUT, BATCH_ROWS, Block, HINT, ROUND_BYTES, Shared, Table};
use crate::read::content::kept;
use crate::read::guard::guarded;
use crate::read::map::released;
use crate::read::{Index, Request, Span};
use crate::sequence::{Frame, Options};

const MAGIC: &[u8] = b"ARROW1";
/// What stands before each message.
const MARK: [u8; 4] = [0xff; 4];
/// Bytes that a byte of LZ4 becomes at most.
const MOST_LZ4: usize = 255;

/// Whether the file begins like one of Arrow, or like a stream: with a message that is a schema.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(MAGIC) || is_stream(head)
}

fn is_stream(head: &[u8]) -> bool {
    let Some((mark, rest)) = head.split_first_chunk::<4>() else { return false };
    let Some((size, rest)) = rest.split_first_chunk::<4>() else { return false };
    let size = i32::from_le_bytes(*size);
    // A schema is longer than what is looked at only where there are hundreds of columns.
    *mark == MARK
        && (16..1 << 24).contains(&size)
        && rest
            .get(..size as usize)
            .is_none_or(|it| root_as_message(it).is_ok_and(|it| it.header_type() == MessageHeader::Schema))
}

/// Something that a block holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Message {
    Dictionary,
    Rows,
}

/// Where everything is.
struct File {
    schema: SchemaRef,
    version: MetadataVersion,
    blocks: Vec<(Message, Place)>,
    /// Whether it ends as its writer meant it to end.
    is_ended: bool,
}

type Fault = (String, &'static str);

fn fault<T>(what: impl Into<String>) -> std::result::Result<T, Fault> {
    Err((what.into(), HINT))
}

impl File {
    fn new(path: &Path, bytes: &[u8]) -> Result<Self> {
        let read = || if bytes.starts_with(MAGIC) { Self::of_file(bytes) } else { Self::of_stream(bytes) };
        guarded(read)
            .unwrap_or_else(|| fault("the metadata are damaged"))
            .map_err(|(what, hint)| Error::format(path, "", what, hint))
    }

    fn of_file(bytes: &[u8]) -> std::result::Result<Self, Fault> {
        let cut = "the file does not end like one of Arrow: it is cut off, or was not closed";
        let rest = bytes.strip_suffix(MAGIC).ok_or((cut.to_string(), HINT))?;
        let (rest, size) = rest.split_last_chunk::<4>().ok_or((cut.to_string(), HINT))?;
        let size = usize::try_from(i32::from_le_bytes(*size)).ok().filter(|it| *it <= rest.len());
        let Some(size) = size else { return fault("its metadata are larger than the file") };
        let (rest, footer) = rest.split_at(rest.len() - size);
        let unclear =
            |error: &dyn std::fmt::Display| (format!("the metadata cannot be understood: {error}"), HINT);
        let footer = root_as_footer(footer).map_err(|error| unclear(&error))?;
        let schema = footer.schema().ok_or(("there is no schema".to_string(), HINT))?;
        let mut blocks = Vec::new();
        for (message, places) in
            [(Message::Dictionary, footer.dictionaries()), (Message::Rows, footer.recordBatches())]
        {
            blocks.extend(places.into_iter().flatten().map(|place| (message, *place)));
        }
        if blocks.iter().any(|(_, it)| end(it).is_none_or(|end| end > rest.len())) {
            return fault("a block lies outside of the file");
        }
        let (version, schema) = (footer.version(), native(schema)?);
        Ok(Self { schema, version, blocks, is_ended: true })
    }

    fn of_stream(bytes: &[u8]) -> std::result::Result<Self, Fault> {
        let (mut place, mut found, mut blocks, mut is_ended) = (0, None, Vec::new(), false);
        while place < bytes.len() {
            let Some((head, rest)) = bytes[place..].split_first_chunk::<8>() else {
                return fault("the stream is cut off");
            };
            let size = i32::from_le_bytes([head[4], head[5], head[6], head[7]]);
            let metadata = usize::try_from(size).ok().and_then(|size| rest.get(..size));
            let Some(metadata) = metadata.filter(|_| head[..4] == MARK) else {
                return fault("the stream is cut off");
            };
            if size == 0 {
                is_ended = true;
                break;
            }
            let message = root_as_message(metadata).map_err(|error| {
                (format!("the message at byte {place} cannot be understood: {error}"), HINT)
            })?;
            let here = Place::new(place as i64, size + 8, message.bodyLength());
            match end(&here).filter(|end| *end <= bytes.len()) {
                Some(end) => place = end,
                None => return fault("the stream is cut off"),
            }
            match message.header_type() {
                MessageHeader::Schema => {
                    let schema =
                        message.header_as_schema().ok_or(("there is no schema".to_string(), HINT))?;
                    found = Some((native(schema)?, message.version()));
                }
                MessageHeader::DictionaryBatch => blocks.push((Message::Dictionary, here)),
                MessageHeader::RecordBatch => blocks.push((Message::Rows, here)),
                _ => {}
            }
        }
        let Some((schema, version)) = found else { return fault("there is no schema") };
        Ok(Self { schema, version, blocks, is_ended })
    }
}

fn native(schema: arrow_ipc::Schema) -> std::result::Result<SchemaRef, Fault> {
    if !schema.endianness().equals_to_target_endianness() {
        return Err((
            "its numbers are in the other order of bytes".to_string(),
            "write it on this kind of machine, or as Parquet",
        ));
    }
    let schema: Schema = convert::try_fb_to_schema(schema)
        .map_err(|error| (format!("the schema cannot be understood: {error}"), HINT))?;
    Ok(Arc::new(schema))
}

/// The byte behind a block; `None` if there is no such place.
fn end(place: &Place) -> Option<usize> {
    let [start, metadata, body] = [place.offset(), place.metaDataLength().into(), place.bodyLength()]
        .map(|it| usize::try_from(it).ok());
    start?.checked_add(metadata.filter(|it| *it >= 8)?)?.checked_add(body?)
}

/// A table is one frame; where its blocks are has to be readable.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let file = File::new(path, bytes)?;
    let doubt = "the stream has no mark at its end, so nobody can tell whether it is whole";
    let is_stream = !bytes.starts_with(MAGIC);
    Ok(Index {
        frames: vec![Span { offset: 0, line: 1, bytes: None }],
        doubt: (!file.is_ended).then(|| doubt.to_string()),
        title: is_stream.then(|| "Arrow stream".to_string()),
        ..Index::default()
    })
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
    let mut table = Table::new(path, &file.schema, request)?;
    let roots = table.roots();
    let row_bytes: usize = table.plan.leaves.iter().map(Leaf::row_bytes).sum();
    let content = Arc::new(kept(path, bytes));
    let progress = &released(content.map(), progress);
    progress.begin("read", Some(bytes.len() as u64), "B");
    let whole = Buffer::from(Bytes::from_owner(Shared(content.clone())));
    let mut decoder = FileDecoder::new(file.schema.clone(), file.version).with_projection(roots.clone());
    let wrong = |place: &Place, (what, hint): Fault| {
        Error::format(path, format!("the block at byte {}", place.offset()), what, hint)
    };
    let slice = |place: &Place| {
        let size = place.metaDataLength() as usize + place.bodyLength() as usize;
        whole.slice_with_length(place.offset() as usize, size)
    };
    let mut next = 0;
    while next < file.blocks.len() {
        let (message, place) = &file.blocks[next];
        if *message == Message::Dictionary {
            let bytes = slice(place);
            let read = || {
                check(&bytes, place)?;
                decoder.read_dictionary(place, &bytes).map_err(|error| (error.to_string(), HINT))
            };
            guarded(read).unwrap_or_else(|| fault("it is damaged")).map_err(|fault| wrong(place, fault))?;
            next += 1;
            continue;
        }
        // As many blocks as are decoded together, up to the next dictionary.
        let (mut round, mut bytes) = (Vec::new(), 0);
        while let Some((Message::Rows, place)) = file.blocks.get(next)
            && bytes < ROUND_BYTES
        {
            let block = slice(place);
            let rows = guarded(|| check(&block, place)).unwrap_or_else(|| fault("it is damaged"));
            bytes += rows.map_err(|fault| wrong(place, fault))?.saturating_mul(row_bytes.max(1));
            round.push((place, block));
            next += 1;
        }
        let batches: Vec<Result<RecordBatch>> = round
            .par_iter()
            .map(|(place, block)| {
                if progress.cancelled() {
                    return Err(Error::Interrupted);
                }
                let read = || match decoder.read_record_batch(place, block) {
                    Ok(Some(batch)) => Ok(batch),
                    Ok(None) => fault("it has no rows"),
                    Err(error) => fault(error.to_string()),
                };
                guarded(read).unwrap_or_else(|| fault("it is damaged")).map_err(|fault| wrong(place, fault))
            })
            .collect();
        // A block may have all rows of the file: they become columns a few at a time.
        let mut slices = Vec::new();
        for ((place, block), batch) in round.into_iter().zip(batches) {
            let batch = batch?;
            let step = slice_rows(&batch);
            for start in (0..batch.num_rows()).step_by(step) {
                let rows = step.min(batch.num_rows() - start);
                let share = (rows as f64 / batch.num_rows() as f64 * block.len() as f64) as u64;
                slices.push((place, batch.slice(start, rows), share));
            }
        }
        let mut rest = &slices[..];
        while !rest.is_empty() {
            let mut bytes = 0;
            let fits = |it: &&(&Place, RecordBatch, u64)| {
                let before = bytes;
                bytes += it.1.num_rows() * row_bytes;
                before < ROUND_BYTES
            };
            let (now, later) = rest.split_at(rest.iter().take_while(fits).count());
            let leaves = &table.plan.leaves;
            let column = |batch: &RecordBatch, leaf: &Leaf| {
                let place = roots.iter().position(|&it| it == leaf.root).expect("each leaf has a root");
                part(batch.column(place), leaf)
            };
            let blocks: Vec<Result<(usize, Block)>> = now
                .par_iter()
                .map(|(place, batch, _)| {
                    if progress.cancelled() {
                        return Err(Error::Interrupted);
                    }
                    let block = guarded(|| leaves.iter().map(|leaf| column(batch, leaf)).collect::<Block>());
                    let block = block.ok_or_else(|| wrong(place, ("it is damaged".to_string(), HINT)))?;
                    Ok((batch.num_rows(), block))
                })
                .collect();
            table.append(blocks.into_iter().collect::<Result<_>>()?)?;
            progress.advance(now.iter().map(|it| it.2).sum());
            rest = later;
        }
    }
    let about = file.schema.metadata().get(ABOUT).cloned();
    table.finish(about.as_deref())
}

/// How many rows of a block become columns at a time: more than its dictionaries have entries, which are looked at each time.
fn slice_rows(batch: &RecordBatch) -> usize {
    let entries = |it: &ArrayRef| it.as_any_dictionary_opt().map_or(0, |it| it.values().len());
    4 * batch.columns().iter().map(entries).max().unwrap_or(0).max(BATCH_ROWS / 4)
}

/// How many rows a block claims; fails where packed buffers claim to be more than they can become.
fn check(bytes: &Buffer, place: &Place) -> std::result::Result<usize, Fault> {
    let (front, body) = bytes.split_at(place.metaDataLength() as usize);
    // Before version 0.15 there was no mark.
    let metadata = if front.starts_with(&MARK) { &front[8..] } else { &front[4..] };
    let message = root_as_message(metadata)
        .map_err(|error| (format!("its header cannot be understood: {error}"), HINT))?;
    let rows = match message.header_type() {
        MessageHeader::DictionaryBatch => message.header_as_dictionary_batch().and_then(|it| it.data()),
        _ => message.header_as_record_batch(),
    };
    let Some(rows) = rows else { return fault("it has no rows") };
    unpackable(&rows, body)?;
    usize::try_from(rows.length()).or_else(|_| fault("it has less than no rows"))
}

fn unpackable(rows: &Packed, body: &[u8]) -> std::result::Result<(), Fault> {
    let Some(compression) = rows.compression() else { return Ok(()) };
    if compression.codec() != CompressionType::LZ4_FRAME {
        return Err((
            "its buffers are packed with zstd".to_string(),
            "write it with compression lz4 or none, or as Parquet",
        ));
    }
    for buffer in rows.buffers().into_iter().flatten() {
        let range = || {
            let start = usize::try_from(buffer.offset()).ok()?;
            body.get(start..start.checked_add(usize::try_from(buffer.length()).ok()?)?)
        };
        let Some(packed) = range() else { return fault("a buffer lies outside of it") };
        let Some((size, packed)) = packed.split_first_chunk::<8>() else { continue };
        let size = i64::from_le_bytes(*size);
        // -1 is what is not packed.
        if size != -1 && usize::try_from(size).is_ok_and(|it| it > packed.len().saturating_mul(MOST_LZ4)) {
            return fault("a buffer claims to be larger than its packed bytes can become");
        }
    }
    Ok(())
}
