//! One file of a sequence: its format, where its frames are, and how one of them is read.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use tyndall::{Error, Progress, Result};

use super::{Frame, Options};
use crate::frame_index;
use crate::read::{self, Feature, Feed, Format, Index, Open, Others, Packing, Request, Span};
use crate::topology::Topology;

/// Unpacked content up to this size is kept, if it is not more than so many times that of the file.
const SMALL_BYTES: u64 = 256 << 20;
const SMALL_GROWTH: u64 = 64;

/// What is asked for, besides the frame's number.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    pub(super) options: &'a Options,
    /// Where the particles' names are, if the format has coordinates only.
    pub(super) topology: Option<&'a Topology>,
    /// The other files over which the frame is spread.
    pub(super) others: &'a dyn Others,
}

/// A file that was opened: what it is, and where its frames are.
pub(super) struct FileSource {
    pub(super) path: PathBuf,
    pub(super) format: &'static Format,
    pub(super) packing: Packing,
    pub(super) index: Index,
    /// What is wrong with the file as a whole.
    pub(super) warning: Option<String>,
    /// The unpacked content, if it is small; given up when the only frame is read.
    content: Mutex<Option<Arc<Vec<u8>>>>,
    /// Where the last frame of a compressed file ended.
    resume: Mutex<Option<Feed<'static>>>,
}

impl FileSource {
    /// Opens a file; `keep` says whether its content may be kept unpacked.
    pub(super) fn open(path: &Path, options: &Options, keep: bool, progress: &dyn Progress) -> Result<Self> {
        let (format, packing) = read::recognise(path, options)?;
        check_options(path, format, options)?;
        let (mut content, mut told) = (None, 0);
        let kept =
            options.index_folder.as_deref().and_then(|it| frame_index::Place::of(it, path, format.title));
        let index = match &format.open {
            Open::Whole(_) => {
                Index { frames: vec![Span { offset: 0, line: 1, bytes: None }], ..Index::default() }
            }
            Open::Binary { index, .. } if packing == Packing::Plain => {
                index(path, &read::map(path)?, options)?
            }
            Open::Binary { index, .. } => {
                let bytes = read::unpack(path, packing, progress)?;
                told = file_bytes(path);
                let index = index(path, &bytes, options)?;
                content = (keep && bytes.len() as u64 <= SMALL_BYTES).then(|| Arc::new(bytes));
                index
            }
            Open::Text { .. } if let Some(index) = kept.as_ref().and_then(frame_index::Place::load) => index,
            Open::Text { index, .. } => {
                let map;
                let mut doubt = None;
                let mut feed = match packing {
                    Packing::Plain => {
                        map = read::map(path)?;
                        doubt = read::open_end(&map);
                        Feed::over_map(path, &map).told_to(progress)
                    }
                    _ if keep => {
                        let most = SMALL_BYTES.min(SMALL_GROWTH * file_bytes(path));
                        stream(path, packing)?.keeping(most).told_to(progress)
                    }
                    _ => stream(path, packing)?.told_to(progress),
                };
                let mut index = index(&mut feed)?;
                told = feed.told();
                content = feed.into_kept().map(Arc::new);
                index.doubt = index.doubt.or(doubt);
                if let Some(kept) = kept {
                    kept.keep(&index);
                }
                index
            }
        };
        progress.advance(file_bytes(path).saturating_sub(told));
        let warning = check_whole(path, &index, options)?;
        Ok(Self {
            path: path.to_path_buf(),
            format,
            packing,
            index,
            warning,
            content: Mutex::new(content),
            resume: Mutex::new(None),
        })
    }

    /// Reads a frame.
    pub(super) fn frame(&self, frame: usize, asked: Asked, progress: &dyn Progress) -> Result<Frame> {
        let (span, wanted) = (self.index.frames[frame], asked.options.wanted.as_ref());
        let mut frame = match &self.format.open {
            Open::Whole(read) if self.packing == Packing::Plain => {
                let map = read::map(&self.path)?;
                read(&self.path, &map, wanted, &map.released(progress))?
            }
            Open::Whole(read) => {
                let content = read::unpacked(&self.path, self.packing, progress)?;
                read(&self.path, &content, wanted, progress)?
            }
            Open::Binary { frame, .. } => {
                let request = self.request(asked, span.bytes);
                let read_from = |bytes: &[u8], progress: &dyn Progress| {
                    frame(&self.path, bytes, span, &request, progress)
                };
                match self.content() {
                    Some(content) => read_from(&content, progress)?,
                    None if self.packing == Packing::Plain => {
                        let map = read::map(&self.path)?;
                        read_from(&map, &map.released(progress))?
                    }
                    None => read_from(&read::unpacked(&self.path, self.packing, progress)?, progress)?,
                }
            }
            Open::Text { frame: read, .. } => self.text(frame, asked, progress, read)?,
        };
        frame.warnings.extend(self.warning.clone());
        Ok(frame)
    }

    /// Lets `read` read a frame of a text.
    pub(super) fn text<T>(
        &self,
        frame: usize,
        asked: Asked,
        progress: &dyn Progress,
        mut read: impl FnMut(&mut Feed, &Request, &dyn Progress) -> Result<T>,
    ) -> Result<T> {
        let span = self.index.frames[frame];
        let mut read_at = |feed: &mut Feed, bytes: Option<u64>, progress: &dyn Progress| {
            feed.skip_to(span.offset, span.line, progress)?;
            read(feed, &self.request(asked, span.bytes.or(bytes)), progress)
        };
        if let Some(content) = self.content() {
            read_at(&mut Feed::over(&self.path, &content), Some(content.len() as u64), progress)
        } else if self.packing == Packing::Plain {
            let map = read::map(&self.path)?;
            let mut feed = Feed::over_map(&self.path, &map);
            read_at(&mut feed, Some(map.len() as u64), progress)
        } else {
            let mut feed = self.resumed(span.offset)?;
            let frame = read_at(&mut feed, None, progress)?;
            if self.index.frames.len() > 1 {
                // Another thread may have left its own place meanwhile; either is as good.
                *self.resume.lock().unwrap_or_else(PoisonError::into_inner) = Some(feed);
            }
            Ok(frame)
        }
    }

    fn request<'a>(&'a self, asked: Asked<'a>, bytes: Option<u64>) -> Request<'a> {
        let Asked { options, topology, others } = asked;
        Request { options, bytes, units: self.index.units.as_deref(), topology, others }
    }

    /// Gives up the place where the last frame of a compressed file ended.
    pub(super) fn close(&self) {
        self.resume.lock().unwrap_or_else(PoisonError::into_inner).take();
    }

    /// The unpacked content, if it was kept.
    fn content(&self) -> Option<Arc<Vec<u8>>> {
        let mut content = self.content.lock().unwrap_or_else(PoisonError::into_inner);
        if self.index.frames.len() == 1 { content.take() } else { content.clone() }
    }

    /// The stream where the last frame left it, if `offset` is not behind that; else from the start.
    fn resumed(&self, offset: u64) -> Result<Feed<'static>> {
        let last = self.resume.lock().unwrap_or_else(PoisonError::into_inner).take();
        match last.filter(|feed| feed.offset() <= offset) {
            Some(feed) => Ok(feed),
            None => stream(&self.path, self.packing),
        }
    }
}

/// Refuses to choose types of particles or data sets where files do not have them.
fn check_options(path: &Path, format: &Format, options: &Options) -> Result<()> {
    let refuse = |name: &str, value: &str, feature: Feature, way_out: &str| {
        let (formats, file) = (feature.formats(), file_name(path));
        let allowed = format!("only for {formats}, {file} is of the format {}; {way_out}", format.title);
        Err(Error::setting(name, value, allowed))
    };
    match options {
        Options { types: Some(types), .. } if !format.has(Feature::Types) => {
            refuse("type", &types.join(","), Feature::Types, "use --filter type=…")
        }
        Options { dataset: Some(dataset), .. } if !format.has(Feature::Datasets) => {
            refuse("dataset", dataset, Feature::Datasets, "leave it out")
        }
        _ => Ok(()),
    }
}

fn stream(path: &Path, packing: Packing) -> Result<Feed<'static>> {
    let file = read::open(path)?;
    Ok(Feed::from_stream(path, packing.stream(file)))
}

/// Refuses a file without a whole frame; says what a truncated one lacks.
fn check_whole(path: &Path, index: &Index, options: &Options) -> Result<Option<String>> {
    let whole = index.frames.len();
    if whole == 0 {
        let what = if index.cut { "the file ends inside its first frame" } else { "the file has no frame" };
        return Err(Error::format(path, "", what, "was it written and copied to its end?"));
    }
    if !index.cut {
        return Ok(index.doubt.as_ref().map(|doubt| format!("{}: {doubt}", file_name(path))));
    }
    let next = whole + 1;
    if options.strict {
        let what = format!("the file ends inside frame {next} of ≥{next}");
        return Err(Error::format(
            path,
            "",
            what,
            format!("without --strict its {whole} whole frames are read"),
        ));
    }
    Ok(Some(format!(
        "{} ends inside frame {next} of ≥{next} — {whole} whole frames read (use --strict to fail)",
        file_name(path)
    )))
}

pub(super) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// The size of a file on disk; 0 if there is none, which opening it will say.
pub(super) fn file_bytes(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |it| it.len())
}
