//! Groups, attributes and data sets of an HDF5 file: all that the readers know of the crate hdf5-reader, but for large chunks (`chunks.rs`).
//!
//! Invariant: a data set is only given out as [`Rows`] if the file could hold it, that is if its size is within what the
//! strongest filter could have made of the bytes of the file, and of those that its links led to. So a damaged extent asks for no memory.

use std::collections::HashSet;
use std::ops::{Deref, Range};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};

use hdf5_reader::error::Error as ReadError;
use hdf5_reader::messages::datatype::{CompoundField, Datatype};
use hdf5_reader::{Dataset, Hdf5File, OpenOptions, SliceInfo, SliceInfoElem};
use tyndall::{Error, Result};

use super::attributes::{Attributes, number_kind};
use super::chunks::{Chunks, Found, Known};
use super::filters;
use super::forms::Form;
use super::neighbors::Neighbors;
use crate::read::content::{self, Content};
use crate::read::map::Map;
use crate::read::numbers::{Kind, Order};
use crate::read::records::Source;

/// In which order this machine has the bytes of a number.
pub(super) const NATIVE: Order = if cfg!(target_endian = "big") { Order::Big } else { Order::Little };

/// How many bytes deflate, the strongest common filter, can make of one.
const STRONGEST: u64 = 1032;

/// Bytes of chunks that are kept: those that the rows of several threads share are unpacked once.
const CACHE_BYTES: usize = 8 << 20;

/// Rows that a thread decodes at a time, if chunks do not make that more.
pub(super) const BATCH_ROWS: usize = 1 << 16;
/// The most that chunks make it which the crate unpacks.
const MOST_BATCH_ROWS: usize = 1 << 20;

/// More numbers than this are no quantity of a particle.
pub(super) const MOST_WIDTH: u64 = 1 << 12;

/// The most bytes that a data set in files of that size can have.
fn most_bytes(file_bytes: u64) -> u64 {
    file_bytes.saturating_mul(STRONGEST).saturating_add(1 << 16)
}

/// A file that is open.
pub(super) struct Tree {
    file: Hdf5File,
    path: PathBuf,
    bytes: u64,
    content: Arc<Content>,
    /// Bytes of the files that links led to.
    linked_bytes: Arc<AtomicU64>,
    /// How many links to other files were followed.
    links: Arc<AtomicU64>,
    /// Bytes of the largest chunk of all data sets so far.
    chunk_bytes: Arc<AtomicU64>,
    /// For chunks that are unpacked here.
    known: Arc<Known>,
}

/// The content, for the library beside us.
struct Shared(Arc<Content>);

impl AsRef<[u8]> for Shared {
    fn as_ref(&self) -> &[u8] {
        (*self.0).as_ref()
    }
}

impl Tree {
    /// Opens the content `bytes` of `path`.
    pub(super) fn open(path: &Path, bytes: &[u8]) -> Result<Self> {
        let [linked_bytes, links, chunk_bytes] = [(); 3].map(|()| Arc::<AtomicU64>::default());
        let counts = [&linked_bytes, &links, &chunk_bytes].map(Arc::clone);
        let neighbors = Neighbors::of(path, counts);
        let options = OpenOptions::default()
            .with_chunk_cache_bytes(CACHE_BYTES)
            .with_filter_registry(filters::registry(Arc::clone(&chunk_bytes)))
            .with_external_link_resolver(Arc::new(neighbors));
        let content = Arc::new(content::kept(path, bytes));
        let file = Hdf5File::from_owner(Shared(Arc::clone(&content)), options);
        let (path, bytes) = (path.to_path_buf(), bytes.len() as u64);
        let file = file.map_err(|error| fault(&path, "", &error))?;
        let registry = filters::registry(Arc::clone(&chunk_bytes));
        let known = Arc::new(Known { registry, content: Arc::clone(&content) });
        Ok(Self { file, path, bytes, content, linked_bytes, links, chunk_bytes, known })
    }

    /// Its map, if it is mapped.
    pub(super) fn map(&self) -> Option<&Map> {
        self.content.map()
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The size of its content.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The group of all.
    pub(super) fn root(&self) -> Result<Group<'_>> {
        let group = self.file.root_group().map_err(|error| fault(&self.path, "/", &error))?;
        Ok(Group { tree: self, group, path: String::new(), members: OnceLock::new() })
    }

    /// The group at `path`; `None` if there is none.
    pub(super) fn group(&self, path: &str) -> Result<Option<Group<'_>>> {
        let mut group = self.root()?;
        for name in path.split('/').filter(|it| !it.is_empty()) {
            match group.group(name)? {
                Some(child) => group = child,
                None => return Ok(None),
            }
        }
        Ok(Some(group))
    }

    /// An [`Error::Format`] about this file.
    pub(super) fn fault(
        &self,
        place: impl Into<String>,
        what: impl Into<String>,
        hint: impl Into<String>,
    ) -> Error {
        Error::format(&self.path, place, what, hint)
    }
}

/// The filter that is not built in, if that is what the reader misses.
fn missing_filter(error: &ReadError) -> Option<String> {
    let ReadError::UnsupportedFilter(filter) = cause(error) else { return None };
    let id = filter.split_whitespace().last().unwrap_or_default();
    let name = filters::name(id).map_or(String::new(), |name| format!(" ({name})"));
    Some(format!("HDF5 filter {id}{name}, which is not built in"))
}

/// The error without the places that it passed.
fn cause(error: &ReadError) -> &ReadError {
    match error {
        ReadError::Context { source, .. } => cause(source),
        cause => cause,
    }
}

/// What the reader said, with a way out.
fn fault(path: &Path, place: &str, error: &ReadError) -> Error {
    if let Some(filter) = missing_filter(error) {
        let what = format!("the data need {filter}");
        return Error::format(path, place, what, "take it off: h5repack -f NONE in.hdf5 out.hdf5");
    }
    match cause(error) {
        ReadError::UnsupportedLayoutClass(3) => {
            let what = "the data set is virtual: its data are in other files";
            Error::format(
                path,
                place,
                what,
                "name those files, or copy it to one: h5repack -l CONTI in.hdf5 out.hdf5",
            )
        }
        cause => Error::format(
            path,
            place,
            cause.to_string(),
            "was the file copied to its end? h5dump may say more",
        ),
    }
}

/// A group.
pub(super) struct Group<'a> {
    tree: &'a Tree,
    group: hdf5_reader::group::Group,
    path: String,
    /// The names of what is in it, once they were asked for.
    members: OnceLock<Members>,
}

/// The names of the groups and of the data sets in a group, in order, and for looking up.
struct Members {
    groups: Vec<String>,
    datasets: Vec<String>,
    known: [HashSet<String>; 2],
}

impl<'a> Group<'a> {
    /// Its path in the file; empty for the root.
    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// What tells it from every other group, by whatever path it was come to: links may lead in circles.
    pub(super) fn identity(&self) -> (usize, u64) {
        (std::ptr::from_ref(self.group.storage()).addr(), self.group.address())
    }

    /// Where it is in the file, as references tell it.
    pub(super) fn address(&self) -> u64 {
        self.group.address()
    }

    fn child(&self, name: &str) -> String {
        if self.path.is_empty() { name.to_string() } else { format!("{}/{name}", self.path) }
    }

    fn failed(&self, error: &ReadError) -> Error {
        fault(&self.tree.path, &self.path, error)
    }

    fn members(&self) -> Result<&Members> {
        if let Some(members) = self.members.get() {
            return Ok(members);
        }
        let (groups, datasets) = self.group.member_names().map_err(|error| self.failed(&error))?;
        let known = [&groups, &datasets].map(|names| names.iter().cloned().collect());
        Ok(self.members.get_or_init(|| Members { groups, datasets, known }))
    }

    /// The names of the groups in it.
    pub(super) fn groups(&self) -> Result<Vec<String>> {
        Ok(self.members()?.groups.clone())
    }

    /// The names of the data sets in it.
    pub(super) fn datasets(&self) -> Result<Vec<String>> {
        Ok(self.members()?.datasets.clone())
    }

    /// A group in it; `None` if there is none of that name.
    pub(super) fn group(&self, name: &str) -> Result<Option<Group<'a>>> {
        if !self.members()?.known[0].contains(name) {
            return Ok(None);
        }
        let path = self.child(name);
        let group = self.group.group(name).map_err(|error| fault(&self.tree.path, &path, &error))?;
        Ok(Some(Group { tree: self.tree, group, path, members: OnceLock::new() }))
    }

    /// A data set in it; `None` if there is none of that name.
    pub(super) fn dataset(&self, name: &str) -> Result<Option<Data>> {
        if !self.members()?.known[1].contains(name) {
            return Ok(None);
        }
        let path = self.child(name);
        let links = self.tree.links.load(Relaxed);
        let dataset = self.group.dataset(name).map_err(|error| fault(&self.tree.path, &path, &error))?;
        let is_here = self.tree.links.load(Relaxed) == links;
        let chunks = if is_here { Chunks::of(&self.group, &dataset, &self.tree.known) } else { None };
        let element = dataset.raw_element_size().unwrap_or(0) as u64;
        let chunk = dataset.chunks().unwrap_or_default();
        let bytes = chunk.iter().fold(element, |bytes, &it| bytes.saturating_mul(it.into()));
        let file_bytes = self.tree.bytes.saturating_add(self.tree.linked_bytes.load(Relaxed));
        // A chunk of no file has more bytes than the strongest filter could make of all of it.
        let most = most_bytes(file_bytes);
        self.tree.chunk_bytes.fetch_max(bytes.min(most), Relaxed);
        Ok(Some(Data { dataset, chunks, path, file: self.tree.path.clone(), file_bytes }))
    }

    /// Its attributes.
    pub(super) fn attributes(&self) -> Result<Attributes> {
        self.group.attributes().map(Attributes).map_err(|error| self.failed(&error))
    }
}

/// A data set.
pub(super) struct Data {
    dataset: Dataset,
    chunks: Option<Chunks>,
    path: String,
    file: PathBuf,
    file_bytes: u64,
}

impl Data {
    /// Its path in the file.
    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// Its extent.
    pub(super) fn shape(&self) -> &[u64] {
        self.dataset.shape()
    }

    /// Whether it has numbers.
    pub(super) fn is_number(&self) -> bool {
        number_kind(self.dataset.dtype()).is_some()
    }

    /// The names of the members of its rows, if these are records.
    pub(super) fn member_names(&self) -> Vec<String> {
        match self.dataset.dtype() {
            Datatype::Compound { fields, .. } => fields.iter().map(|it| it.name.clone()).collect(),
            _ => Vec::new(),
        }
    }

    /// The members of its rows that are numbers, or arrays of some; none if its rows are no records.
    pub(super) fn members(&self) -> Vec<Member> {
        let Datatype::Compound { size, fields } = self.dataset.dtype() else { return Vec::new() };
        let member = |field: &CompoundField| {
            let (datatype, width) = match &field.datatype {
                Datatype::Array { base, dims } => {
                    (&**base, dims.iter().try_fold(1u64, |width, &it| width.checked_mul(it))?)
                }
                scalar => (scalar, 1),
            };
            let (kind, order) = number_kind(datatype).filter(|_| (1..=MOST_WIDTH).contains(&width))?;
            let (offset, width) = (field.byte_offset as usize, width as usize);
            let fits = offset + width * kind.size() <= *size as usize;
            fits.then(|| Member { name: field.name.clone(), kind, order, offset, width })
        };
        fields.iter().filter_map(member).collect()
    }

    /// The bytes of all its rows, as they are stored, and those of one, which are not none. Fails if the file cannot hold them.
    pub(super) fn records(&self) -> Result<(Vec<u8>, usize)> {
        let failed = |error: ReadError| fault(&self.file, &self.path, &error);
        let row = self.dataset.raw_element_size().map_err(failed)?;
        let bytes = self.dataset.raw_byte_len().map_err(failed)?;
        if row == 0 || bytes as u64 > most_bytes(self.file_bytes) {
            let what = format!("{bytes} bytes are more than a file of {} bytes can hold", self.file_bytes);
            return Err(Error::format(&self.file, &self.path, what, "was the file copied to its end?"));
        }
        Ok((self.dataset.read_raw_bytes().map_err(failed)?, row))
    }

    /// Where in their bytes its numbers are, if they are no machine's own.
    fn form(&self) -> Option<Form> {
        Form::of(&self.dataset.raw_datatype().ok()?)
    }

    /// Bytes of the file and of those that links led to: more rows than these they cannot hold.
    pub(super) fn file_bytes(&self) -> u64 {
        self.file_bytes
    }

    /// Its attributes.
    pub(super) fn attributes(&self) -> Attributes {
        Attributes(self.dataset.attributes())
    }

    /// The number of places to which nothing was written, if the file says one.
    pub(super) fn fill(&self) -> Option<f64> {
        let (kind, order) = number_kind(self.dataset.dtype()).filter(|_| self.form().is_none())?;
        let bytes = self.dataset.fill_value()?.value.as_deref().filter(|it| it.len() == kind.size())?;
        Some(Source { bytes, kind, order, start: 0, stride: 0, step: 0 }.number(0))
    }

    /// The words that the numbers of an enumeration stand for, by number; none if it is no enumeration of words.
    pub(super) fn words(&self) -> Vec<(i64, String)> {
        let Datatype::Enum { base, members } = self.dataset.dtype() else { return Vec::new() };
        let Some((kind, order)) = number_kind(base) else { return Vec::new() };
        let fits = members.iter().filter(|it| it.value.len() == kind.size());
        fits.map(|member| {
            let bytes = &member.value;
            let source = Source { bytes, kind, order, start: 0, stride: 0, step: 0 };
            (source.number(0) as i64, member.name.clone())
        })
        .collect()
    }

    /// All its words, for a small data set of words; none if it has others.
    pub(super) fn texts(&self) -> Vec<String> {
        let small = self.dataset.num_elements().is_ok_and(|count| count <= 64);
        let texts = if small { self.dataset.read_strings().unwrap_or_default() } else { Vec::new() };
        texts.iter().map(|it| it.trim_matches(['\0', ' ']).to_string()).collect()
    }

    /// Its number, if it is a single one.
    pub(super) fn number(&self) -> Result<Option<f64>> {
        let Some((kind, _)) = number_kind(self.dataset.dtype()) else { return Ok(None) };
        if self.dataset.num_elements().is_ok_and(|count| count > 64) {
            return Ok(None);
        }
        let bytes =
            self.dataset.read_native_bytes().map_err(|error| fault(&self.file, &self.path, &error))?;
        let (bytes, kind) = match self.form() {
            Some(form) => (form.apply(&bytes, kind.size()), form.kind(kind)),
            None => (Native::of(bytes), kind),
        };
        let source = Source { bytes: &bytes, kind, order: NATIVE, start: 0, stride: 0, step: 0 };
        Ok((bytes.len() >= kind.size()).then(|| source.number(0)))
    }

    /// Its rows as those of a quantity of particles, beside their positions; or why it is to be left out, where its rows are no quantity or
    /// need a filter that is not built in.
    pub(super) fn quantity(self, lead: &[u64]) -> Result<std::result::Result<Rows, String>> {
        let width: u64 =
            self.shape().iter().skip(lead.len() + 1).fold(1, |width, &it| width.saturating_mul(it));
        if width == 0 || width > MOST_WIDTH {
            return Ok(Err(format!("{width} numbers a row")));
        }
        let rows = self.rows(lead)?;
        if rows.chunks.is_some() {
            return Ok(Ok(rows));
        }
        let first = rows.decode(0..rows.count.min(1));
        Ok(match first.err().and_then(|error| missing_filter(&error)) {
            Some(filter) => Err(format!("it needs {filter}")),
            None => Ok(rows),
        })
    }

    /// Its rows, `lead` being indices of the dimensions before that of the particles. Fails if the file cannot hold them, or if
    /// what is in it are no numbers.
    pub(super) fn rows(self, lead: &[u64]) -> Result<Rows> {
        let fault = |what: String| {
            Error::format(&self.file, &self.path, what, "was the file copied to its end? h5dump may say more")
        };
        let (stored, order) =
            number_kind(self.dataset.dtype()).ok_or_else(|| fault("these are no numbers".into()))?;
        let form = self.form();
        let shape = self.dataset.shape();
        if shape.len() <= lead.len() || lead.iter().zip(shape).any(|(index, size)| index >= size) {
            return Err(fault(format!("an extent of {shape:?} has no place {lead:?}")));
        }
        let count = shape[lead.len()];
        let width = shape[lead.len() + 1..].iter().try_fold(1u64, |product, &size| product.checked_mul(size));
        let bytes = width.and_then(|it| it.checked_mul(count)?.checked_mul(stored.size() as u64));
        let fits = bytes.is_some_and(|bytes| bytes <= most_bytes(self.file_bytes));
        if width.is_some_and(|width| width == 0 || width > MOST_WIDTH) {
            return Err(fault(format!("an extent of {shape:?} is not 1 to {MOST_WIDTH} numbers a row")));
        }
        if !fits {
            let what =
                format!("an extent of {shape:?} is more than a file of {} bytes can hold", self.file_bytes);
            return Err(fault(what));
        }
        let width = width.expect("it fits") as usize;
        let chunk_rows =
            self.dataset.chunks().and_then(|it| it.get(lead.len()).copied()).map_or(0, |it| it as usize);
        let chunks = self.chunks.filter(|it| count > 0 && it.are_rows(lead.len())).and_then(|chunks| {
            // What is wrong with them, the crate says.
            let found = chunks.find(lead, 0..count as usize).ok().flatten()?;
            Some(Box::new((chunks, found)))
        });
        Ok(Rows {
            chunks,
            is_swapped: order != NATIVE,
            dataset: Box::new(self.dataset),
            path: self.path,
            file: self.file,
            lead: lead.to_vec(),
            kind: form.map_or(stored, |it| it.kind(stored)),
            stored,
            form,
            first: 0,
            count: count as usize,
            width,
            chunk_rows,
            whole: OnceLock::new(),
        })
    }
}

/// Numbers in rows that are records.
pub(super) struct Member {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) order: Order,
    /// Where in a row it begins.
    pub(super) offset: usize,
    /// How many numbers it has.
    pub(super) width: usize,
}

/// Numbers in this machine's order of bytes.
pub(super) struct Native(Box<dyn AsRef<[u8]> + Send>);

impl Native {
    pub(super) fn of<T: bytemuck::NoUninit + Send>(numbers: Vec<T>) -> Self {
        struct Owned<T>(Vec<T>);
        impl<T: bytemuck::NoUninit> AsRef<[u8]> for Owned<T> {
            fn as_ref(&self) -> &[u8] {
                bytemuck::cast_slice(&self.0)
            }
        }
        Self(Box::new(Owned(numbers)))
    }
}

impl Deref for Native {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        (*self.0).as_ref()
    }
}

/// The rows of a data set, a particle each.
pub(super) struct Rows {
    dataset: Box<Dataset>,
    path: String,
    file: PathBuf,
    lead: Vec<u64>,
    /// The type of the numbers.
    pub(super) kind: Kind,
    /// That in which they are stored, and where their bits are in it, if that is no machine's own.
    stored: Kind,
    form: Option<Form>,
    /// The place of the first row in the data set.
    first: usize,
    /// How many rows there are.
    pub(super) count: usize,
    /// Numbers in a row.
    pub(super) width: usize,
    /// Rows of a chunk; 0 if there are no chunks.
    pub(super) chunk_rows: usize,
    /// Its chunks, if they are large.
    chunks: Option<Box<(Chunks, Found)>>,
    /// Whether its numbers are stored in the other order of bytes.
    is_swapped: bool,
    /// All of it, where its type can only be read as a whole.
    whole: OnceLock<Vec<u8>>,
}

impl Rows {
    /// The data set's path in the file.
    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// Those of its rows, all of which must be there.
    pub(super) fn within(self, rows: Range<usize>) -> Option<Self> {
        let fits = rows.start <= rows.end && rows.end <= self.count;
        // Only rows of one frame are counted among those of others.
        let whole = rows == (0..self.count);
        (fits && (whole || self.lead.is_empty())).then(|| Self {
            first: self.first + rows.start,
            count: rows.len(),
            ..self
        })
    }

    /// Some of its rows.
    pub(super) fn read(&self, rows: Range<usize>) -> Result<Native> {
        if self.chunks.is_none() {
            return self.decode(rows).map_err(|error| fault(&self.file, &self.path, &error));
        }
        let mut all = Vec::with_capacity(rows.len() * self.width * self.kind.size());
        self.read_each(rows, |numbers, _| all.extend_from_slice(&numbers))?;
        Ok(Native::of(all))
    }

    /// Rows for which a thread has work: whole chunks, so that none is unpacked twice.
    pub(super) fn batch_rows(&self) -> usize {
        match self.chunk_rows {
            0 => BATCH_ROWS,
            rows if self.chunks.is_some() => rows.saturating_mul(BATCH_ROWS.div_ceil(rows)),
            rows => rows.saturating_mul(BATCH_ROWS.div_ceil(rows)).min(MOST_BATCH_ROWS),
        }
    }

    /// The memory that a thread needs for a chunk.
    pub(super) fn working_bytes(&self) -> usize {
        let row = self.width * self.stored.size();
        // The crate has a chunk with its bytes shuffled and not, and rows of it.
        if self.chunks.is_some() { self.chunk_rows * row } else { 3 * self.chunk_rows.saturating_mul(row) }
    }

    /// Gives some of its rows to `take`, in order and some at a time, with their places among `rows`.
    pub(super) fn read_each(
        &self,
        rows: Range<usize>,
        mut take: impl FnMut(Native, Range<usize>),
    ) -> Result<()> {
        let fault = |error: ReadError| fault(&self.file, &self.path, &error);
        let Some((chunks, found)) = self.chunks.as_deref() else {
            for first in rows.clone().step_by(self.batch_rows()) {
                let some = first..rows.end.min(first + self.batch_rows());
                let numbers = self.decode(some.clone()).map_err(fault)?;
                take(numbers, some.start - rows.start..some.end - rows.start);
            }
            return Ok(());
        };
        let stored = self.first + rows.start..self.first + rows.end;
        let each = chunks.read_each(found, stored, |mut numbers, rows| {
            if self.is_swapped {
                numbers.chunks_exact_mut(self.stored.size()).for_each(<[u8]>::reverse);
            }
            let numbers = match self.form {
                Some(form) => form.apply(&numbers, self.stored.size()),
                None => Native::of(numbers),
            };
            take(numbers, rows);
        });
        each.map_err(fault)
    }

    fn decode(&self, rows: Range<usize>) -> std::result::Result<Native, ReadError> {
        let stored = self.as_stored(self.first + rows.start..self.first + rows.end)?;
        Ok(match self.form {
            Some(form) => form.apply(&stored, self.stored.size()),
            None => stored,
        })
    }

    fn as_stored(&self, rows: Range<usize>) -> std::result::Result<Native, ReadError> {
        let is_plain =
            matches!(self.dataset.dtype(), Datatype::FixedPoint { .. } | Datatype::FloatingPoint { .. });
        match self.stored {
            _ if rows.is_empty() => Ok(Native::of(Vec::<u8>::new())),
            _ if !is_plain => self.cut(rows),
            Kind::F16 => self.cut(rows),
            Kind::I8 => self.slice::<i8>(rows),
            Kind::U8 => self.slice::<u8>(rows),
            Kind::I16 => self.slice::<i16>(rows),
            Kind::U16 => self.slice::<u16>(rows),
            Kind::I32 => self.slice::<i32>(rows),
            Kind::U32 => self.slice::<u32>(rows),
            Kind::I64 => self.slice::<i64>(rows),
            Kind::U64 => self.slice::<u64>(rows),
            Kind::F32 => self.slice::<f32>(rows),
            Kind::F64 => self.slice::<f64>(rows),
        }
    }

    fn slice<T: hdf5_reader::H5Type + bytemuck::NoUninit + Send>(
        &self,
        rows: Range<usize>,
    ) -> std::result::Result<Native, ReadError> {
        let mut selections: Vec<_> = self.lead.iter().map(|&index| SliceInfoElem::Index(index)).collect();
        selections.push(SliceInfoElem::Slice { start: rows.start as u64, end: rows.end as u64, step: 1 });
        let all = SliceInfoElem::Slice { start: 0, end: u64::MAX, step: 1 };
        selections.resize(self.dataset.ndim(), all);
        let array = self.dataset.read_slice::<T>(&SliceInfo { selections })?;
        if array.len() != rows.len() * self.width {
            return Err(ReadError::InvalidData("a selection has another size than its rows".into()));
        }
        if !array.is_standard_layout() {
            return Ok(Native::of(array.iter().copied().collect::<Vec<T>>()));
        }
        let count = array.len();
        let (mut numbers, first) = array.into_raw_vec_and_offset();
        numbers.drain(..first.unwrap_or(0));
        numbers.truncate(count);
        Ok(Native::of(numbers))
    }

    fn cut(&self, rows: Range<usize>) -> std::result::Result<Native, ReadError> {
        let whole = match self.whole.get() {
            Some(whole) => whole,
            None => {
                let bytes = self.dataset.read_native_bytes()?;
                self.whole.get_or_init(|| bytes)
            }
        };
        // Places before this frame's first row, the last dimension running fastest.
        let lead =
            self.lead.iter().zip(self.dataset.shape()).fold(0, |place, (&index, &size)| place * size + index);
        let row = self.width * self.stored.size();
        let first = lead as usize * self.count;
        let bytes = whole.get((first + rows.start) * row..(first + rows.end) * row);
        bytes
            .map(|it| Native::of(it.to_vec()))
            .ok_or_else(|| ReadError::InvalidData("a data set is shorter than its extent".into()))
    }

    /// Its numbers, for a small data set.
    pub(super) fn numbers(&self) -> Result<Vec<f64>> {
        let bytes = self.read(0..self.count)?;
        let size = self.kind.size();
        let source =
            Source { bytes: &bytes, kind: self.kind, order: NATIVE, start: 0, stride: size, step: 0 };
        Ok((0..bytes.len() / size).map(|place| source.number(place)).collect())
    }
}
