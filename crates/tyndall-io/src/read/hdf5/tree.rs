//! Groups of an HDF5 file and the data sets in them. With `data.rs`, `rows.rs`, `attributes.rs` and `chunks.rs` (large chunks) this is all that
//! the readers know of the crate hdf5-reader.
//!
//! Invariant: a data set is only given out as [`Rows`](super::rows::Rows) if the file could hold it, that is if its size is within what
//! the strongest filter could have made of the bytes of the file, and of those that its links led to. So a damaged extent asks for no memory.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};

use hdf5_reader::error::Error as ReadError;
use hdf5_reader::{Hdf5File, OpenOptions};
use tyndall::{Error, Result};

use super::attributes::Attributes;
use super::chunks::{Chunks, Known};
use super::data::Data;
use super::filters;
use super::neighbors::Neighbors;
use crate::read::content::{self, Content};
use crate::read::map::Map;

/// How many bytes deflate, the strongest common filter, can make of one.
const STRONGEST: u64 = 1032;

/// Bytes of chunks that are kept: those that the rows of several threads share are unpacked once.
const CACHE_BYTES: usize = 8 << 20;

/// The most bytes that a data set in files of that size can have.
pub(super) fn most_bytes(file_bytes: u64) -> u64 {
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
pub(super) fn missing_filter(error: &ReadError) -> Option<String> {
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
pub(super) fn fault(path: &Path, place: &str, error: &ReadError) -> Error {
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
