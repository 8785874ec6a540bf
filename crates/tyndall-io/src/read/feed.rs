//! Text as lines and blocks of lines, whether it lies in a memory map or comes out of a decompressor.
//!
//! Takes the mapped bytes, or a stream; gives single lines (headers) and newline-aligned blocks (rows), and knows the offset
//! and the line number of what comes next. A stream holds no more than two blocks; while one is parsed the next is unpacked.
//! Long passes over the content can be listened to: see [`Feed::told_to`].

use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use memchr::{memchr, memchr_iter, memrchr};
use rayon::prelude::*;
use tyndall::{Error, Progress, Result};

use super::map::{Map, RELEASE_BYTES};
use super::unpack::Stream;

/// The longest line that is taken for text.
const LONGEST_LINE: usize = 64 << 20;
/// How much of a stream is looked at together, at most, when lines are counted.
const WINDOW: usize = 1 << 18;
/// How much of a map is: enough for several threads.
const MAPPED_WINDOW: usize = 8 << 20;
/// How much of it one thread looks at.
const SHARE: usize = 1 << 19;
/// So many line feeds fit a byte.
const COUNTED: usize = 192;
/// How much a stream unpacks at once.
const STREAM_STEP: usize = 1 << 20;
/// How much content is passed over between two words to who listens: at most a few hundred times a second.
const TOLD_STEP: u64 = 8 << 20;

/// A place in the content, and how to read on from it.
pub(crate) struct Feed<'a> {
    path: PathBuf,
    mapped: &'a [u8],
    /// The map that these are, and up to where its pages were given back.
    map: Option<&'a Map>,
    given_back: usize,
    stream: Option<Stream>,
    buffer: Vec<u8>,
    ahead: Vec<u8>,
    start: usize,
    offset: u64,
    line: u64,
    ended: bool,
    cut: bool,
    ragged: Option<Vec<u8>>,
    /// All content so far, and how large it may become.
    kept: Option<(Vec<u8>, u64)>,
    listener: Option<Listener<'a>>,
}

/// Who is told how much of the file is read.
struct Listener<'a> {
    progress: &'a dyn Progress,
    /// How many bytes of the file it was told of.
    told: u64,
    /// The offset from which on there is more to tell.
    next: u64,
}

/// A block of whole lines.
pub(crate) struct Block<'b> {
    /// Its bytes. Only the last line of the content may lack its line feed.
    pub(crate) bytes: &'b [u8],
    /// How many lines it has.
    pub(crate) lines: u64,
    /// The number of its first line, counted from 1.
    pub(crate) first_line: u64,
}

impl<'a> Feed<'a> {
    /// Over bytes in memory.
    pub(crate) fn over(path: &Path, mapped: &'a [u8]) -> Self {
        Self {
            path: path.to_path_buf(),
            mapped,
            map: None,
            given_back: 0,
            stream: None,
            buffer: Vec::new(),
            ahead: Vec::new(),
            start: 0,
            offset: 0,
            line: 1,
            ended: true,
            cut: false,
            ragged: None,
            kept: None,
            listener: None,
        }
    }

    /// Over a map, the pages of which are given back behind what is read.
    pub(crate) fn over_map(path: &Path, map: &'a Map) -> Self {
        Self { map: Some(map), ..Self::over(path, map) }
    }

    /// Over what `stream` gives.
    pub(crate) fn from_stream(path: &Path, stream: Stream) -> Self {
        Self { stream: Some(stream), ended: false, ..Self::over(path, &[]) }
    }

    /// Keeps what the stream gives, as long as it is not more than `most` bytes. To be called before anything is read.
    pub(crate) fn keeping(self, most: u64) -> Self {
        Self { kept: Some((Vec::new(), most)), ..self }
    }

    /// Advances `progress` by the bytes of the file, compressed ones where it is, as the content is passed over; from then on
    /// everything fails with [`Error::Interrupted`] soon after it is cancelled. The last few bytes are not told: see
    /// [`Feed::told`].
    pub(crate) fn told_to(self, progress: &'a dyn Progress) -> Self {
        Self { listener: Some(Listener { progress, told: 0, next: TOLD_STEP }), ..self }
    }

    /// How many bytes of the file were told to who listens.
    pub(crate) fn told(&self) -> u64 {
        self.listener.as_ref().map_or(0, |listener| listener.told)
    }

    /// The whole content, if it was kept, read to its end, and not larger than wanted.
    pub(crate) fn into_kept(self) -> Option<Vec<u8>> {
        self.kept.filter(|_| self.ended).map(|(bytes, _)| bytes)
    }

    /// The file, for messages.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The offset of the next byte, in the unpacked content.
    pub(crate) fn offset(&self) -> u64 {
        self.offset
    }

    /// The number of the next line, counted from 1.
    pub(crate) fn line_number(&self) -> u64 {
        self.line
    }

    /// Whether the compressed stream stopped before its end. Known once the content has ended.
    pub(crate) fn cut(&self) -> bool {
        self.cut
    }

    /// The last line, if it was reached by [`Feed::skip_lines`] and has no line feed: it may not be whole.
    pub(crate) fn ragged(&self) -> Option<&[u8]> {
        self.ragged.as_deref()
    }

    /// A [`Error::Format`] about the line that was read last.
    pub(crate) fn fault(&self, what: impl Into<String>, hint: impl Into<String>) -> Error {
        Error::format(&self.path, format!("line {}", self.line.saturating_sub(1)), what, hint)
    }

    fn unread(&self) -> &[u8] {
        if self.stream.is_some() { &self.buffer[self.start..] } else { &self.mapped[self.start..] }
    }

    fn advance(&mut self, bytes: usize, lines: u64) {
        self.start += bytes;
        self.offset += bytes as u64;
        self.line += lines;
        if let Some(map) = self.map
            && self.start - self.given_back >= RELEASE_BYTES as usize
        {
            map.release(self.given_back..self.start);
            self.given_back = self.start;
        }
    }

    /// Tells who listens how far the file is read, if that is much further than when it was told last.
    fn tell(&mut self) -> Result<()> {
        let taken = self.stream.as_ref().map_or(self.offset, Stream::taken);
        match &mut self.listener {
            Some(listener) if self.offset >= listener.next => {
                listener.progress.advance(taken - listener.told);
                listener.told = taken;
                listener.next = self.offset + TOLD_STEP;
                if listener.progress.cancelled() { Err(Error::Interrupted) } else { Ok(()) }
            }
            _ => Ok(()),
        }
    }

    /// Sees to it that `wanted` unread bytes are there, or all that are left.
    fn fill(&mut self, wanted: usize) -> Result<()> {
        self.tell()?;
        while self.unread().len() < wanted {
            if self.start > 0 && self.stream.is_some() {
                self.buffer.drain(..self.start);
                self.start = 0;
            }
            if !self.ahead.is_empty() {
                self.buffer.append(&mut self.ahead);
                continue;
            }
            let Some(stream) = self.stream.as_mut().filter(|_| !self.ended) else { break };
            let step = (wanted - self.buffer.len()).max(STREAM_STEP);
            let before = self.buffer.len();
            let more = unpack(stream, &mut self.buffer, step, &self.path)?;
            self.note(more);
            if let Some((kept, most)) = &mut self.kept {
                kept.extend_from_slice(&self.buffer[before..]);
                if kept.len() as u64 > *most {
                    self.kept = None;
                }
            }
        }
        Ok(())
    }

    /// What comes next, `most` bytes or all that are left, without taking it.
    pub(crate) fn peek(&mut self, most: usize) -> Result<&[u8]> {
        self.fill(most)?;
        let unread = self.unread();
        Ok(&unread[..most.min(unread.len())])
    }

    /// Whether nothing is left.
    pub(crate) fn at_end(&mut self) -> Result<bool> {
        Ok(self.peek(1)?.is_empty())
    }

    /// Takes one line, without its end; `None` at the end of the content.
    pub(crate) fn line(&mut self) -> Result<Option<String>> {
        let mut wanted = 1 << 12;
        let end = loop {
            self.fill(wanted)?;
            let unread = self.unread();
            if let Some(end) = memchr(b'\n', unread) {
                break end;
            }
            if unread.len() < wanted {
                break unread.len();
            }
            if wanted > LONGEST_LINE {
                return Err(self.endless());
            }
            wanted *= 4;
        };
        let unread = self.unread();
        if unread.is_empty() {
            return Ok(None);
        }
        let line = String::from_utf8_lossy(unread[..end].trim_ascii_end()).into_owned();
        let taken = (end + 1).min(unread.len());
        self.advance(taken, 1);
        Ok(Some(line))
    }

    /// Passes over `lines` lines; says how many there were, which is less only at the end of the content.
    pub(crate) fn skip_lines(&mut self, lines: u64) -> Result<u64> {
        let mut skipped = 0;
        let widest = if self.stream.is_some() { WINDOW } else { MAPPED_WINDOW } as u64;
        while skipped < lines {
            // For few lines a narrow window: small frames must not cost a look at much more than themselves.
            let width = (lines - skipped).saturating_mul(64).clamp(1 << 12, widest) as usize;
            self.fill(width + 1)?;
            let unread = self.unread();
            let window = &unread[..width.min(unread.len())];
            let found = line_feeds(window);
            let whole = memrchr(b'\n', window).map_or(0, |place| place + 1);
            if found >= lines - skipped {
                let end = lines_end(window, lines - skipped).unwrap_or(window.len());
                self.advance(end, lines - skipped);
                return Ok(lines);
            }
            // The content ends here, perhaps with a line that has no line feed.
            if unread.len() <= width {
                let ragged = (whole < window.len()).then(|| window[whole..].to_vec());
                let (length, found) = (window.len(), found + u64::from(ragged.is_some()));
                self.advance(length, found);
                self.ragged = ragged;
                return Ok(skipped + found);
            }
            // A line that goes on behind the window is left for the next one, unless it fills this one.
            let step = if whole > 0 { whole } else { window.len() };
            self.advance(step, found);
            skipped += found;
        }
        Ok(skipped)
    }

    /// Passes on to `offset`, which must not lie behind, where line `line` begins; stops at the end of the content, or when
    /// `progress` is cancelled.
    pub(crate) fn skip_to(&mut self, offset: u64, line: u64, progress: &dyn Progress) -> Result<()> {
        while self.offset < offset {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            self.fill(WINDOW)?;
            let step = (self.unread().len() as u64).min(offset - self.offset);
            if step == 0 {
                break;
            }
            // Nothing of what lies between was looked at.
            self.given_back = self.start + step as usize;
            self.advance(step as usize, 0);
        }
        self.line = line;
        Ok(())
    }

    /// Takes about `most` bytes of whole lines, at most `rows` of them, and lets `parse` work on them. `None` at the end of
    /// the content, or before what is left of a line that was cut. `most` doubles until a line fits.
    pub(crate) fn block<T: Send>(
        &mut self,
        most: usize,
        rows: u64,
        parse: impl FnOnce(Block) -> Result<T> + Send,
    ) -> Result<Option<T>> {
        let mut wanted = most;
        let (end, lines) = loop {
            self.fill(wanted)?;
            let unread = self.unread();
            let window = &unread[..wanted.min(unread.len())];
            if window.is_empty() || rows == 0 {
                return Ok(None);
            }
            let last = window.len() == unread.len() && self.ended && self.ahead.is_empty();
            // The last line of a stream that was cut may not be whole.
            let end = if last && !self.cut {
                window.len()
            } else {
                memrchr(b'\n', window).map_or(0, |place| place + 1)
            };
            if last && end == 0 {
                return Ok(None);
            }
            if end > 0 {
                break block_end(&window[..end], rows);
            }
            if wanted > LONGEST_LINE {
                return Err(self.endless());
            }
            wanted *= 2;
        };
        let first_line = self.line;
        let source = if self.stream.is_some() { &self.buffer } else { self.mapped };
        let block = Block { bytes: &source[self.start..self.start + end], lines, first_line };
        let room = most.saturating_sub(source.len() - self.start - end);
        let (parsed, more) =
            match self.stream.as_mut().filter(|_| !self.ended && self.ahead.is_empty() && room > 0) {
                Some(stream) if lines < rows => {
                    let (ahead, path) = (&mut self.ahead, &self.path);
                    rayon::join(|| parse(block), || unpack(stream, ahead, room, path))
                }
                _ => (parse(block), Ok(More::Yes)),
            };
        self.note(more?);
        self.advance(end, lines);
        parsed.map(Some)
    }

    fn note(&mut self, more: More) {
        self.ended |= !matches!(more, More::Yes);
        self.cut |= matches!(more, More::Cut);
    }

    fn endless(&self) -> Error {
        let place = format!("line {}", self.line);
        Error::format(&self.path, place, "a line of more than 64 MiB", "this does not look like a text file")
    }
}

/// Where the first `rows` lines of `bytes` end, and how many lines that are.
fn block_end(bytes: &[u8], rows: u64) -> (usize, u64) {
    let feeds = line_feeds(bytes);
    let lines = feeds + u64::from(!bytes.ends_with(b"\n"));
    if lines <= rows {
        return (bytes.len(), lines);
    }
    (lines_end(bytes, rows).expect("there are more lines than rows"), rows)
}

/// Where line `lines` of `bytes` ends, counted from 1, if its line feed is there.
fn lines_end(bytes: &[u8], mut lines: u64) -> Option<usize> {
    for (place, part) in bytes.chunks(COUNTED).enumerate() {
        let feeds = u64::from(few_line_feeds(part));
        if feeds >= lines {
            return memchr_iter(b'\n', part).nth(lines as usize - 1).map(|end| COUNTED * place + end + 1);
        }
        lines -= feeds;
    }
    None
}

fn line_feeds(bytes: &[u8]) -> u64 {
    let of_share = |share: &[u8]| share.chunks(COUNTED).map(few_line_feeds).map(u64::from).sum::<u64>();
    // Most calls are for a few lines, which are not worth a thread.
    if bytes.len() <= SHARE { of_share(bytes) } else { bytes.par_chunks(SHARE).map(of_share).sum() }
}

/// The line feeds of at most [`COUNTED`] bytes, which compilers turn into a sum on vectors.
fn few_line_feeds(bytes: &[u8]) -> u8 {
    bytes.iter().map(|&byte| u8::from(byte == b'\n')).sum()
}

/// Whether a stream has more to give.
enum More {
    Yes,
    No,
    /// It has not, but should have.
    Cut,
}

/// Appends about `step` bytes of `stream` to `buffer`.
fn unpack(stream: &mut Stream, buffer: &mut Vec<u8>, step: usize, path: &Path) -> Result<More> {
    let step = step as u64;
    match stream.take(step).read_to_end(buffer) {
        Ok(count) if (count as u64) < step => Ok(More::No),
        Ok(_) => Ok(More::Yes),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(More::Cut),
        Err(error) if matches!(error.kind(), ErrorKind::InvalidData | ErrorKind::InvalidInput) => {
            let what = format!("the compressed data are damaged: {error}");
            Err(Error::format(path, "", what, "copy the file again and check it with 'gzip -t' or 'zstd -t'"))
        }
        Err(error) => Err(Error::io(path, error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::Packing;

    fn feeds(text: &'static [u8]) -> [Feed<'static>; 2] {
        let path = Path::new("text");
        [Feed::over(path, text), Feed::from_stream(path, Packing::Plain.stream(text))]
    }

    #[test]
    fn lines_and_blocks_keep_count_in_maps_and_streams() {
        for mut feed in feeds(b"3\r\nab\n1\n2\n3\n4") {
            assert_eq!(feed.line().unwrap().as_deref(), Some("3"));
            assert_eq!(feed.skip_lines(1).unwrap(), 1);
            assert_eq!((feed.offset(), feed.line_number()), (6, 3));
            let block = feed.block(4, 3, |block| Ok((block.bytes.to_vec(), block.lines, block.first_line)));
            assert_eq!(block.unwrap(), Some((b"1\n2\n".to_vec(), 2, 3)));
            assert_eq!(
                feed.block(1 << 20, 1, |block| Ok(block.bytes.to_vec())).unwrap(),
                Some(b"3\n".to_vec())
            );
            assert_eq!(feed.skip_lines(u64::MAX).unwrap(), 1);
            assert_eq!(feed.ragged(), Some(&b"4"[..]));
            assert!(feed.at_end().unwrap() && feed.line().unwrap().is_none());
        }
    }

    #[test]
    fn a_block_grows_until_a_line_fits() {
        for mut feed in feeds(b"0123456789\nabcdefghij\n") {
            assert_eq!(feed.block(2, 9, |block| Ok(block.bytes.len())).unwrap(), Some(11));
        }
    }

    #[test]
    fn pages_of_a_map_are_given_back_once_and_up_to_the_last_few() {
        let path = std::env::temp_dir().join(format!("tyndall-feed-{}", std::process::id()));
        let line = [b'7'; 1023];
        let lines = 3 * RELEASE_BYTES / 1024 + 1;
        std::fs::write(&path, [&line[..], b"\n"].concat().repeat(lines as usize)).unwrap();
        let map = crate::read::map(&path).unwrap();
        let mut feed = Feed::over_map(&path, &map);
        feed.skip_to(1024, 2, &()).unwrap();
        assert_eq!(feed.given_back, 1024);
        let (mut given, mut times) = (feed.given_back, 0);
        let begins = |block: Block| Ok(block.bytes.starts_with(b"77"));
        while let Some(begins) = feed.block(1 << 20, u64::MAX, begins).unwrap() {
            assert!(begins);
            times += u64::from(feed.given_back > given);
            given = feed.given_back;
            assert!(given <= feed.start && feed.start - given < RELEASE_BYTES as usize);
        }
        assert_eq!((times, feed.line_number(), feed.offset()), (3, lines + 1, 1024 * lines));
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn skipping_to_an_offset_sets_the_line() {
        for mut feed in feeds(b"a\nb\nc\n") {
            feed.skip_to(4, 3, &()).unwrap();
            assert_eq!(feed.line().unwrap().as_deref(), Some("c"));
            assert_eq!(feed.line_number(), 4);
        }
    }
}
