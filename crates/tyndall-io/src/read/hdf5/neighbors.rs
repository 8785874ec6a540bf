//! The files that external links of an HDF5 file name: in its own folder or below, and nowhere else.
//!
//! Their sizes are counted, so that what a link leads to is measured by the files that it may be in.

use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

use hdf5_reader::error::{Error, Result};
use hdf5_reader::{ExternalLinkResolver, Hdf5File, OpenOptions};

use super::filters;
use crate::read::content;

/// Opens each file once.
pub(super) struct Neighbors {
    folder: PathBuf,
    files: Mutex<HashMap<PathBuf, Hdf5File>>,
    /// Bytes of all that were opened.
    bytes: Arc<AtomicU64>,
    /// How often one was asked for.
    links: Arc<AtomicU64>,
    /// See [`filters::registry`].
    chunk_bytes: Arc<AtomicU64>,
}

impl Neighbors {
    /// Those of the file at `path`. Adds to the first count the bytes of what is opened, to the second one for each link; the third is
    /// that of [`filters::registry`].
    pub(super) fn of(path: &Path, [bytes, links, chunk_bytes]: [Arc<AtomicU64>; 3]) -> Self {
        let folder = path.parent().filter(|it| !it.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Self { folder: folder.to_path_buf(), files: Mutex::default(), bytes, links, chunk_bytes }
    }
}

impl ExternalLinkResolver for Neighbors {
    /// The file of that name; none if there is no regular file, so that nobody waits for a pipe.
    fn resolve_external_link(&self, filename: &str) -> Result<Option<Hdf5File>> {
        self.links.fetch_add(1, Relaxed);
        let stays = |it: Component| matches!(it, Component::Normal(_) | Component::CurDir);
        if !Path::new(filename).components().all(stays) {
            return Err(Error::InvalidData("an external link leads out of the file's folder".into()));
        }
        let Ok(path) = self.folder.join(filename).canonicalize() else { return Ok(None) };
        if !path.starts_with(self.folder.canonicalize()?) || !path.metadata()?.is_file() {
            return Ok(None);
        }
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(file) = files.get(&path) {
            return Ok(Some(file.clone()));
        }
        let content = content::content(&path).map_err(|error| Error::InvalidData(error.to_string()))?;
        let bytes = content.as_ref().len() as u64;
        let registry = filters::registry(Arc::clone(&self.chunk_bytes));
        let file = Hdf5File::from_owner(content, OpenOptions::default().with_filter_registry(registry))?;
        self.bytes.fetch_add(bytes, Relaxed);
        files.insert(path, file.clone());
        Ok(Some(file))
    }
}
