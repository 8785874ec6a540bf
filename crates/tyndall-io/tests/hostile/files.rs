//! The files that tests damage, and a folder to do it in.

use std::path::{Path, PathBuf};

/// A folder that is gone when it is dropped.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    /// An empty one.
    pub(crate) fn empty(name: &str) -> Self {
        // In memory where that is offered: thousands of files are written.
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
        let path = folder.join(format!("tyndall-hostile-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// One with a copy of every file beside `files`: lists and sets of files name their neighbors.
    pub(crate) fn with_neighbors(name: &str, files: &[PathBuf]) -> Self {
        let folder = Self::empty(name);
        for file in files {
            std::fs::copy(file, folder.0.join(file.file_name().unwrap())).unwrap();
        }
        folder
    }

    /// The path of a file of that content.
    pub(crate) fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).unwrap();
    }
}

/// The samples that are stored with the tests, in order of their paths.
pub(crate) fn samples() -> Vec<PathBuf> {
    let mut files = below(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data"));
    files.retain(|it| it.extension().is_some_and(|it| it != "py"));
    files
}

/// The real files up to that size; none if they are not there.
pub(crate) fn shared(most_bytes: u64) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let mut files = below(&folder);
    if files.is_empty() {
        println!("skipped: no shared data at {}", folder.display());
    }
    let is_data = |it: &Path| it.extension().is_some_and(|it| it != "md" && it != "json");
    files.retain(|it| is_data(it) && std::fs::metadata(it).unwrap().len() <= most_bytes);
    files
}

fn below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() { files.extend(below(&path)) } else { files.push(path) }
    }
    files.sort();
    files
}

/// The name of a file, for messages and copies.
pub(crate) fn name(path: &Path) -> String {
    path.file_name().unwrap().to_string_lossy().into_owned()
}
