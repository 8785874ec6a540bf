//! HDF5, by what is in it: snapshots of Gadget, AREPO, GIZMO and SWIFT, H5MD trajectories, openPMD series, VTKHDF, or
//! plain data sets.
//!
//! The crate hdf5-reader, pure Rust, finds groups and decodes chunks, but for large ones (`chunks.rs`): behind groups (`tree.rs`), data sets
//! (`data.rs`) and their rows (`rows.rs`) no dialect knows it. A dialect says which data sets are positions and quantities (`Run`), and
//! `columns.rs` brings their rows into columns, some thousand at a time, so that no data set is held as a whole beside its column.

mod attributes;
mod chunks;
mod columns;
mod compound;
mod connectivity;
mod data;
mod filters;
mod forms;
mod gadget;
mod h5md;
mod items;
mod neighbors;
mod openpmd;
mod plain;
mod rows;
mod swift;
mod tree;
mod vtkhdf;
pub(crate) mod xdmf;

use std::path::Path;

use tyndall::{Error, Progress, Result};

use super::{Index, Request, Span, map, unreadable};
use crate::sequence::{Frame, Options};
use tree::Tree;

/// Whether the file begins like HDF5.
pub(crate) fn recognise(head: &[u8]) -> bool {
    unreadable::is_hdf5(head)
}

/// Who wrote the file.
enum Dialect {
    Snapshot,
    H5md,
    OpenPmd,
    VtkHdf,
    Plain,
}

impl Dialect {
    fn of(tree: &Tree) -> Result<Self> {
        let root = tree.root()?;
        let groups = root.groups()?;
        let has = |name: &str| groups.iter().any(|it| it == name);
        Ok(if has("h5md") {
            Self::H5md
        } else if root.attributes()?.text("openPMD").is_some() {
            Self::OpenPmd
        } else if vtkhdf::root(tree)?.is_some() {
            Self::VtkHdf
        } else if has("Header") && groups.iter().any(|it| gadget::type_number(it).is_some()) {
            Self::Snapshot
        } else {
            Self::Plain
        })
    }
}

/// Finds the frames. A span's offset is the frame's number.
pub(crate) fn index(path: &Path, bytes: &[u8], options: &Options) -> Result<Index> {
    let tree = Tree::open(path, bytes)?;
    let dialect = Dialect::of(&tree)?;
    if let (Some(types), Dialect::H5md | Dialect::VtkHdf | Dialect::Plain) = (&options.types, &dialect) {
        let allowed =
            "given for this file, which is no snapshot and has no types to choose from; use --filter";
        return Err(Error::setting("type", types.join(","), allowed));
    }
    if let (Some(dataset), Dialect::Snapshot | Dialect::OpenPmd | Dialect::VtkHdf) =
        (&options.dataset, &dialect)
    {
        let allowed = "given for this file, whose format says where the positions are";
        return Err(Error::setting("dataset", dataset, allowed));
    }
    let (frames, title, files) = match dialect {
        Dialect::Snapshot => {
            let (title, files) = gadget::index(&tree, options)?;
            (1, title, files)
        }
        Dialect::H5md => (h5md::frames(&tree, options)?, "H5MD".to_string(), Vec::new()),
        Dialect::OpenPmd => (openpmd::frames(&tree)?, openpmd::title(&tree)?, Vec::new()),
        Dialect::VtkHdf => (vtkhdf::frames(&tree)?, "VTKHDF".to_string(), Vec::new()),
        Dialect::Plain => {
            let (frames, title) = plain::index(&tree, options)?;
            (frames, title, Vec::new())
        }
    };
    let span = |frame: usize| Span { offset: frame as u64, line: frame as u64 + 1, bytes: None };
    Ok(Index { frames: (0..frames).map(span).collect(), title: Some(title), files, ..Index::default() })
}

/// Reads a frame.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let tree = Tree::open(path, bytes)?;
    let progress = &map::released(tree.map(), progress);
    let (options, number) = (request.options, span.offset as usize);
    match Dialect::of(&tree)? {
        Dialect::Snapshot => gadget::frame(&tree, options, progress),
        Dialect::H5md => h5md::frame(&tree, number, options, progress),
        Dialect::OpenPmd => openpmd::frame(&tree, number, options, progress),
        Dialect::VtkHdf => vtkhdf::frame(&tree, number, options, progress),
        Dialect::Plain => plain::frame(&tree, number, options, progress),
    }
}

#[cfg(test)]
mod tests;
