//! Large chunks of a data set, unpacked here rather than by the crate hdf5-reader, which holds a chunk two to three times.
//!
//! Takes where the chunks are from the crate, and gives rows in this machine's order of bytes. A chunk is in memory once, while its rows are
//! asked for: numbers whose bytes are shuffled are put together some rows at a time. What is inflated lies in a map of its own, because an
//! allocator keeps the room of some chunks for each thread, and pages of the file are given back meanwhile. Invariant: what is here are chunks of
//! whole rows, all of which were written, with filters that can be undone. Source: HDF5 File Format Specification 3.0, "Data
//! Layout Message", "Filter Pipeline Message".

use std::io::{BufRead, Read};
use std::ops::{Deref, Range};
use std::sync::Arc;

use flate2::bufread::ZlibDecoder;
use hdf5_reader::btree_v1::{BTreeV1Key, collect_btree_v1_leaves_storage};
use hdf5_reader::checksum::fletcher32;
use hdf5_reader::chunk_index::{
    ChunkEntry, collect_implicit_chunk_entries, collect_v2_chunk_entries_storage, single_chunk_entry,
};
use hdf5_reader::error::Error;
use hdf5_reader::extensible_array::collect_extensible_array_chunk_entries_storage;
use hdf5_reader::fixed_array::collect_fixed_array_chunk_entries_storage;
use hdf5_reader::group::Group;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::filter_pipeline::{
    FILTER_DEFLATE, FILTER_FLETCHER32, FILTER_SHUFFLE, FilterDescription,
};
use hdf5_reader::messages::layout::{ChunkIndexing, DataLayout};
use hdf5_reader::object_header::ObjectHeader;
use hdf5_reader::{Dataset, FilterRegistry};
use memmap2::MmapMut;

use super::filters;
use crate::read::content::Content;

/// Chunks of fewer bytes are left to the crate, which keeps some for threads that share them.
const LARGE_BYTES: usize = 1 << 20;
/// Numbers that are put together at a time.
const STEP: usize = 1 << 16;
/// Bytes of the file that are inflated between two times that their pages are given back.
const INFLATED_BYTES: usize = 1 << 20;

type Result<T> = std::result::Result<T, Error>;

/// The chunks of a data set.
pub(super) struct Chunks {
    /// Keeps their file open.
    group: Group,
    /// What is known of the first file, which may be theirs.
    file: Arc<Known>,
    layout: Layout,
    filters: Vec<FilterDescription>,
    /// The extent of the data set, and the most that it may become.
    shape: Vec<u64>,
    most: Option<Vec<u64>>,
    /// Bytes of a number.
    size: usize,
}

/// What all chunks need.
pub(super) struct Known {
    pub(super) registry: FilterRegistry,
    pub(super) content: Arc<Content>,
}

/// Where the chunks are told, and their extent.
struct Layout {
    address: u64,
    dims: Vec<u32>,
    indexing: Option<ChunkIndexing>,
}

/// Chunks of consecutive rows.
pub(super) struct Found {
    entries: Vec<ChunkEntry>,
    /// The first row of the first one.
    start: usize,
    rows: usize,
}

impl Chunks {
    /// Those of a data set of `group`, itself in the file of that group; `None` where the crate is to read them.
    pub(super) fn of(group: &Group, dataset: &Dataset, file: &Arc<Known>) -> Option<Self> {
        let dims = dataset.chunks()?;
        let size = dataset.raw_element_size().ok()?;
        let bytes = dims.iter().try_fold(size, |bytes, &it| bytes.checked_mul(it as usize))?;
        if bytes < LARGE_BYTES || dims.len() != dataset.ndim() {
            return None;
        }
        let (offset, length) = (group.offset_size(), group.length_size());
        let header =
            ObjectHeader::parse_at_storage(group.storage(), dataset.address(), offset, length).ok()?;
        let (mut layout, mut filters) = (None, Vec::new());
        for message in header.messages {
            match message {
                HdfMessage::DataLayout(it) => layout = Some(it.layout),
                HdfMessage::FilterPipeline(it) => filters = it.filters,
                // What others share stands elsewhere.
                HdfMessage::Shared(_) => return None,
                _ => {}
            }
        }
        let Some(DataLayout::Chunked { address, chunk_indexing: indexing, .. }) = layout else { return None };
        let known = |it: &FilterDescription| {
            matches!(it.id, FILTER_DEFLATE | FILTER_FLETCHER32 | FILTER_SHUFFLE) || filters::is_ours(it.id)
        };
        let undefined = u64::MAX >> (64 - 8 * u32::from(offset.clamp(1, 8)));
        (address != undefined && filters.iter().all(known)).then(|| Self {
            group: group.clone(),
            file: Arc::clone(file),
            layout: Layout { address, dims, indexing },
            filters,
            shape: dataset.shape().to_vec(),
            most: dataset.max_dims().map(<[u64]>::to_vec),
            size,
        })
    }

    /// Bytes of a chunk.
    pub(super) fn bytes(&self) -> usize {
        self.layout.dims.iter().fold(self.size, |bytes, &it| bytes * it as usize)
    }

    /// Whether a chunk is of whole rows, `lead` dimensions being before that of the rows.
    pub(super) fn are_rows(&self, lead: usize) -> bool {
        let (dims, shape) = (&self.layout.dims, &self.shape);
        let ends = dims.iter().zip(shape).skip(lead + 1);
        dims[..lead].iter().all(|&it| it == 1) && ends.into_iter().all(|(&it, &all)| u64::from(it) == all)
    }

    /// Those that have the rows; `None` if there was nothing written to one.
    pub(super) fn find(&self, lead: &[u64], rows: Range<usize>) -> Result<Option<Found>> {
        let step = self.layout.dims[lead.len()] as usize;
        let places = rows.start / step..rows.end.div_ceil(step);
        let bound = |place: usize| {
            let mut bound = lead.to_vec();
            bound.push(place as u64);
            bound.resize(self.shape.len(), 0);
            bound
        };
        let mut entries = self.entries((&bound(places.start), &bound(places.end - 1)))?;
        entries.retain(|it| it.offsets.starts_with(lead));
        entries.sort_by_key(|it| it.offsets.get(lead.len()).copied());
        let offsets = entries.iter().map(|it| it.offsets.get(lead.len()).copied());
        let whole = offsets.eq(places.clone().map(|place| Some((place * step) as u64)));
        Ok(whole.then_some(Found { entries, start: places.start * step, rows: step }))
    }

    /// The chunks between two places in the grid of all, both included.
    fn entries(&self, bounds: (&[u64], &[u64])) -> Result<Vec<ChunkEntry>> {
        let Layout { address, dims, indexing } = &self.layout;
        let (storage, address, bounds) = (self.group.storage(), *address, Some(bounds));
        let (offset, length) = (self.group.offset_size(), self.group.length_size());
        let (shape, ndim) = (&self.shape, self.shape.len());
        match indexing {
            None => {
                let count = Some(ndim as u32);
                let leaves =
                    collect_btree_v1_leaves_storage(storage, address, offset, length, count, dims, bounds)?;
                let entries = leaves.into_iter().map(|(key, address)| match key {
                    BTreeV1Key::RawData { chunk_size, filter_mask, mut offsets } => {
                        offsets.truncate(ndim);
                        Ok(ChunkEntry { address, size: chunk_size.into(), filter_mask, offsets })
                    }
                    BTreeV1Key::Group { .. } => Err(invalid("an index of chunks leads to a group")),
                });
                entries.collect()
            }
            Some(ChunkIndexing::SingleChunk { filtered_size, filters }) => {
                Ok(vec![single_chunk_entry(address, *filtered_size, *filters, ndim)])
            }
            Some(ChunkIndexing::Implicit) => {
                collect_implicit_chunk_entries(address, shape, dims, self.size, bounds, storage.len())
            }
            Some(ChunkIndexing::BTreeV2) => {
                let count = ndim as u32;
                collect_v2_chunk_entries_storage(storage, address, offset, length, count, dims, bounds)
            }
            Some(ChunkIndexing::FixedArray { .. }) => collect_fixed_array_chunk_entries_storage(
                storage, address, offset, length, shape, dims, bounds,
            ),
            Some(ChunkIndexing::ExtensibleArray { .. }) => {
                let most = self.most.as_deref();
                collect_extensible_array_chunk_entries_storage(
                    storage, address, offset, length, shape, most, dims, bounds,
                )
            }
        }
    }

    /// Gives the rows to `take`, in order and some at a time: their numbers as they are stored, and their places among `rows`.
    pub(super) fn read_each(
        &self,
        found: &Found,
        rows: Range<usize>,
        mut take: impl FnMut(Vec<u8>, Range<usize>),
    ) -> Result<()> {
        let width = self.bytes() / self.size / found.rows;
        for (place, entry) in found.entries.iter().enumerate() {
            let start = found.start + place * found.rows;
            let mine = rows.start.max(start)..rows.end.min(start + found.rows);
            if mine.is_empty() {
                continue;
            }
            let size = if entry.size > 0 { entry.size } else { self.bytes() as u64 };
            let size = usize::try_from(size).map_err(|_| invalid("a chunk is larger than memory"))?;
            let stored = self.group.storage().read_range(entry.address, size)?;
            let chunk = self.unpacked(&stored, entry.filter_mask)?;
            for first in mine.clone().step_by(STEP.div_ceil(width)) {
                let some = first..mine.end.min(first + STEP.div_ceil(width));
                let numbers = chunk.numbers((some.start - start) * width..(some.end - start) * width);
                take(numbers, some.start - rows.start..some.end - rows.start);
            }
        }
        Ok(())
    }

    /// Undoes the filters of a chunk, but for those in `mask`.
    fn unpacked<'a>(&self, stored: &'a [u8], mask: u32) -> Result<Unpacked<'a>> {
        let applied = |place: &usize| *place >= 32 || mask >> place & 1 == 0;
        let mut filters: Vec<&FilterDescription> =
            (0..self.filters.len()).filter(applied).map(|place| &self.filters[place]).collect();
        let mut bytes = Bytes::Stored(stored);
        // Checksums stand behind what they are of.
        let sums =
            |filters: &[&FilterDescription]| filters.iter().filter(|it| it.id == FILTER_FLETCHER32).count();
        let mut shuffled = false;
        while let Some(filter) = filters.pop() {
            let are_light = filters.iter().all(|it| matches!(it.id, FILTER_SHUFFLE | FILTER_FLETCHER32));
            match filter.id {
                FILTER_SHUFFLE if self.size == 1 => {}
                FILTER_SHUFFLE if sums(&filters) == filters.len() => {
                    shuffled = true;
                    break;
                }
                FILTER_FLETCHER32 => {
                    let end = bytes.len().checked_sub(4).ok_or_else(|| invalid("a chunk has no checksum"))?;
                    verify(
                        fletcher32(&bytes[..end]),
                        bytes[end..].try_into().expect("these are four bytes"),
                    )?;
                    bytes = bytes.cut(end);
                }
                FILTER_DEFLATE if are_light => {
                    bytes = Bytes::Inflated(self.inflated(&bytes, self.bytes() + 4 * sums(&filters))?, 0);
                }
                _ => {
                    let most = self.bytes() + 4 * self.filters.len();
                    let output =
                        self.file.registry.apply_with_limit(filter, &bytes, self.size, Some(most))?;
                    bytes = Bytes::Unpacked(output);
                }
            }
        }
        let sums = sums(&filters);
        Unpacked { bytes, size: self.size, shuffled }.checked(self.bytes(), sums)
    }

    /// A deflated chunk, which must have that many bytes.
    fn inflated(&self, stored: &[u8], bytes: usize) -> Result<MmapMut> {
        if bytes / 1032 > stored.len() {
            return Err(invalid(format!("a chunk of {bytes} bytes cannot be deflated to {}", stored.len())));
        }
        let failed = |error: std::io::Error| Error::DecompressionError(format!("deflate: {error}"));
        let mut room = MmapMut::map_anon(bytes.max(1)).map_err(failed)?;
        let given_back = GivenBack { bytes: stored, content: &self.file.content, from: 0, at: 0 };
        let mut stream = ZlibDecoder::new(given_back);
        stream.read_exact(&mut room[..bytes]).map_err(failed)?;
        if stream.read(&mut [0]).map_err(failed)? > 0 {
            return Err(invalid(format!("a chunk is larger than the {bytes} bytes that its extent has")));
        }
        Ok(room)
    }
}

/// Bytes of a file whose pages are given back behind what was read.
struct GivenBack<'a> {
    bytes: &'a [u8],
    content: &'a Content,
    from: usize,
    at: usize,
}

impl Read for GivenBack<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for GivenBack<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        Ok(&self.bytes[self.at..self.bytes.len().min(self.from + INFLATED_BYTES)])
    }

    fn consume(&mut self, count: usize) {
        self.at += count;
        if self.at == self.bytes.len().min(self.from + INFLATED_BYTES) {
            if let Some(map) = self.content.map() {
                map.give_back(&self.bytes[self.from..self.at]);
            }
            self.from = self.at;
        }
    }
}

/// The bytes of a chunk.
enum Bytes<'a> {
    /// As they are in the file.
    Stored(&'a [u8]),
    /// Unpacked, without the last ones.
    Inflated(MmapMut, usize),
    /// Unpacked by another filter.
    Unpacked(Vec<u8>),
}

impl Deref for Bytes<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Stored(bytes) => bytes,
            Self::Inflated(bytes, without) => &bytes[..bytes.len() - without],
            Self::Unpacked(bytes) => bytes,
        }
    }
}

impl Bytes<'_> {
    /// The same up to `end`.
    fn cut(self, end: usize) -> Self {
        match self {
            Self::Stored(bytes) => Self::Stored(&bytes[..end]),
            Self::Inflated(bytes, _) => {
                let without = bytes.len() - end;
                Self::Inflated(bytes, without)
            }
            Self::Unpacked(mut bytes) => {
                bytes.truncate(end);
                Self::Unpacked(bytes)
            }
        }
    }
}

/// A chunk whose numbers are whole, or have all their first bytes before all their second ones, and so on.
struct Unpacked<'a> {
    bytes: Bytes<'a>,
    size: usize,
    shuffled: bool,
}

impl Unpacked<'_> {
    /// The same, if it has `bytes` bytes and behind them `sums` checksums, which are right.
    fn checked(self, bytes: usize, sums: usize) -> Result<Self> {
        if self.bytes.len() != bytes + 4 * sums {
            let found = self.bytes.len();
            return Err(invalid(format!("a chunk of {bytes} bytes is unpacked to {found}")));
        }
        for sum in (0..sums).rev() {
            let end = bytes + 4 * sum;
            verify(self.fletcher32(end), std::array::from_fn(|byte| self.byte(end + byte)))?;
        }
        Ok(self)
    }

    /// A byte of the numbers in their order; what is behind the last whole one is not shuffled.
    fn byte(&self, place: usize) -> u8 {
        let (count, number) = (self.bytes.len() / self.size, place / self.size);
        let is_apart = self.shuffled && number < count;
        self.bytes[if is_apart { place % self.size * count + number } else { place }]
    }

    /// The sum of the first `end` bytes, which is that of HDF5 up to multiples of 65535.
    fn fletcher32(&self, end: usize) -> u32 {
        let (mut sum, mut sums) = (0u64, 0u64);
        let mut add = |high: u8, low: u8| {
            sum = (sum + u64::from(u16::from_be_bytes([high, low]))) % 65535;
            sums = (sums + sum) % 65535;
        };
        let whole = end / self.size;
        for first in (0..whole).step_by(STEP) {
            let numbers = self.numbers(first..whole.min(first + STEP));
            numbers.chunks_exact(2).for_each(|it| add(it[0], it[1]));
        }
        for place in (whole * self.size..end).step_by(2) {
            add(self.byte(place), if place + 1 < end { self.byte(place + 1) } else { 0 });
        }
        (sums << 16 | sum) as u32
    }

    /// Some of its numbers.
    fn numbers(&self, range: Range<usize>) -> Vec<u8> {
        if !self.shuffled {
            return self.bytes[range.start * self.size..range.end * self.size].to_vec();
        }
        let count = self.bytes.len() / self.size;
        let mut numbers = vec![0; range.len() * self.size];
        for (byte, plane) in self.bytes.chunks_exact(count).take(self.size).enumerate() {
            let places = numbers[byte..].iter_mut().step_by(self.size);
            places.zip(&plane[range.clone()]).for_each(|(number, byte)| *number = *byte);
        }
        numbers
    }
}

fn invalid(what: impl Into<String>) -> Error {
    Error::InvalidData(what.into())
}

/// Compares two checksums, each half of which may be 0 or 65535 for the same data.
fn verify(found: u32, told: [u8; 4]) -> Result<()> {
    let told = u32::from_le_bytes(told);
    let same = |shift: u32| (found >> shift & 0xffff) % 65535 == (told >> shift & 0xffff) % 65535;
    if same(0) && same(16) {
        return Ok(());
    }
    Err(Error::ChecksumMismatch { expected: told, actual: found })
}
