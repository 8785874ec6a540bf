//! Compressed files: which compression it is, by its magic bytes, and the bytes inside as a stream.
//!
//! Gzip may have many members, Zstandard many frames, bzip2 and xz many streams; all are read to their end. A stream that stops too early fails
//! with [`ErrorKind::UnexpectedEof`], one that is damaged with [`ErrorKind::InvalidData`]. It counts what it takes of the
//! file, so that a progress has a total that is known beforehand: the file's size.
//!
//! What unpacks to more than [`MOST_GROWTH`] times what was taken of the file is refused: of particles nobody packs so much into so little, but
//! a few bytes of bzip2 or xz can become terabytes.
//!
//! The mark of UTF-8 that some editors put in front of a text is no part of its content.

use std::io::{BufRead, BufReader, Error, ErrorKind, Read, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bzip2::bufread::MultiBzDecoder;
use flate2::bufread::GzDecoder;
use lzma_rust2::XzReader;
use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

/// So many bytes tell a compression.
pub(crate) const MAGIC_BYTES: usize = 6;

/// What an xz file may ask for to be unpacked, in KiB: its highest preset needs 65 MiB.
const MOST_XZ_KIB: u32 = 512 << 10;

/// Content that may come out of a file however small.
const FREE_BYTES: u64 = 64 << 20;
/// Beyond that, so many bytes may come out of one, as many as gzip can make of one at most.
const MOST_GROWTH: u64 = 1032;

/// Text in UTF-8 may begin with it.
pub(crate) const MARK: &[u8] = b"\xef\xbb\xbf";

/// How a file is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Packing {
    /// Not at all.
    Plain,
    /// With gzip.
    Gzip,
    /// With Zstandard.
    Zstd,
    /// With bzip2.
    Bzip2,
    /// With xz.
    Xz,
}

impl Packing {
    /// The compression of a file that begins with `head`.
    pub(crate) fn of(head: &[u8]) -> Self {
        // Zstandard's skippable frames, which may come first, have sixteen magic numbers.
        let skippable = head.len() >= 4 && head[0] & 0xf0 == 0x50 && head[1..4] == [0x2a, 0x4d, 0x18];
        if head.starts_with(&[0x1f, 0x8b]) {
            Self::Gzip
        } else if head.starts_with(&[0x28, 0xb5, 0x2f, 0xfd]) || skippable {
            Self::Zstd
        } else if is_bzip2(head) {
            Self::Bzip2
        } else if head.starts_with(b"\xfd7zXZ\0") {
            Self::Xz
        } else {
            Self::Plain
        }
    }

    /// Its name, as printed to people.
    pub(crate) fn name(self) -> Option<&'static str> {
        match self {
            Self::Plain => None,
            Self::Gzip => Some("gzip"),
            Self::Zstd => Some("zstd"),
            Self::Bzip2 => Some("bzip2"),
            Self::Xz => Some("xz"),
        }
    }

    /// The content of `file`.
    pub(crate) fn stream(self, file: impl Read + Send + 'static) -> Stream {
        let taken = Arc::default();
        let counted = Counted { file: Box::new(file), taken: Arc::clone(&taken) };
        let file = BufReader::with_capacity(1 << 18, counted);
        let content: Box<dyn Read + Send> = match self {
            Self::Plain => Box::new(file),
            Self::Gzip => Box::new(Gzip { member: Some(GzDecoder::new(file)) }),
            Self::Zstd => Box::new(Zstd { file, decoder: FrameDecoder::new(), inside: false }),
            Self::Bzip2 => Box::new(MultiBzDecoder::new(file)),
            Self::Xz => Box::new(XzReader::new_mem_limit(file, true, MOST_XZ_KIB)),
        };
        Stream { content, taken, front: None, given: 0 }
    }
}

/// Whether a bzip2 stream begins here: its block size, then the mark of a block or of the end. A text may begin with BZh too.
fn is_bzip2(head: &[u8]) -> bool {
    let sized = head.starts_with(b"BZh") && matches!(head.get(3), Some(b'1'..=b'9'));
    sized && head.get(4..6).is_some_and(|mark| mark == [0x31, 0x41] || mark == [0x17, 0x72])
}

/// The content of a file, unpacked while it is read.
pub(crate) struct Stream {
    content: Box<dyn Read + Send>,
    taken: Arc<AtomicU64>,
    /// What is left of the first bytes, which are looked at for a mark; `None` before.
    front: Option<Vec<u8>>,
    /// How many bytes came out.
    given: u64,
}

impl Stream {
    /// How many bytes of the file it has taken: somewhat more than the content so far needs, the whole file at its end.
    pub(crate) fn taken(&self) -> u64 {
        self.taken.load(Ordering::Relaxed)
    }
}

impl Read for Stream {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        if self.front.is_none() {
            let mut front = Vec::new();
            (&mut self.content).take(MARK.len() as u64).read_to_end(&mut front)?;
            self.front = Some(if front == MARK { Vec::new() } else { front });
        }
        if let Some(front) = self.front.as_mut().filter(|it| !it.is_empty()) {
            let count = front.len().min(buffer.len());
            buffer[..count].copy_from_slice(&front[..count]);
            front.drain(..count);
            return Ok(count);
        }
        let count = self.content.read(buffer)?;
        self.given += count as u64;
        if self.given > FREE_BYTES && self.given / MOST_GROWTH > self.taken() {
            let what = format!(
                "{} bytes of the file become more than {} bytes: if that is meant, unpack it on disk",
                self.taken(),
                self.given
            );
            return Err(Error::new(ErrorKind::InvalidData, what));
        }
        Ok(count)
    }
}

/// A file that counts its bytes as they are read.
struct Counted {
    file: Box<dyn Read + Send>,
    taken: Arc<AtomicU64>,
}

impl Read for Counted {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let count = self.file.read(buffer)?;
        self.taken.fetch_add(count as u64, Ordering::Relaxed);
        Ok(count)
    }
}

/// All members of a gzip file, one after the other. Zeros behind a member, with which tapes fill their blocks, are passed over.
struct Gzip {
    /// The member that is being read; `None` at the end.
    member: Option<GzDecoder<BufReader<Counted>>>,
}

impl Read for Gzip {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        while let Some(member) = &mut self.member {
            let count = member.read(buffer)?;
            if count > 0 || buffer.is_empty() {
                return Ok(count);
            }
            let file = member.get_mut();
            let next = loop {
                let bytes = file.fill_buf()?;
                let zeros = bytes.iter().take_while(|&&byte| byte == 0).count();
                if zeros < bytes.len() || bytes.is_empty() {
                    let more = !bytes.is_empty();
                    file.consume(zeros);
                    break more;
                }
                file.consume(zeros);
            };
            self.member = self.member.take().filter(|_| next).map(|it| GzDecoder::new(it.into_inner()));
        }
        Ok(0)
    }
}

/// All frames of a Zstandard file, one after the other.
struct Zstd {
    file: BufReader<Counted>,
    decoder: FrameDecoder,
    inside: bool,
}

impl Zstd {
    fn fault(&mut self, error: impl std::fmt::Display) -> Error {
        match self.file.fill_buf() {
            Ok([]) => Error::new(ErrorKind::UnexpectedEof, error.to_string()),
            Ok(_) => Error::new(ErrorKind::InvalidData, error.to_string()),
            Err(error) => error,
        }
    }

    fn next_frame(&mut self) -> Result<()> {
        match self.decoder.reset(&mut self.file) {
            Ok(()) => self.inside = true,
            Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame {
                length, ..
            })) => {
                std::io::copy(&mut (&mut self.file).take(length.into()), &mut std::io::sink())?;
            }
            Err(error) => return Err(self.fault(error)),
        }
        Ok(())
    }
}

impl Read for Zstd {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        loop {
            if !self.inside {
                if self.file.fill_buf()?.is_empty() {
                    return Ok(0);
                }
                self.next_frame()?;
            } else if self.decoder.can_collect() > 0 {
                return self.decoder.read(buffer);
            } else if !self.decoder.is_finished() {
                let decoded =
                    self.decoder.decode_blocks(&mut self.file, BlockDecodingStrategy::UptoBlocks(1));
                decoded.map_err(|error| self.fault(error))?;
            } else {
                self.inside = false;
                let wanted = self.decoder.get_checksum_from_data();
                if wanted.is_some() && wanted != self.decoder.get_calculated_checksum() {
                    return Err(Error::new(ErrorKind::InvalidData, "the checksum does not match"));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn unpacked(bytes: &[u8]) -> Result<Vec<u8>> {
        let mut out = Vec::new();
        let mut stream = Packing::of(bytes).stream(std::io::Cursor::new(bytes.to_vec()));
        let read = stream.read_to_end(&mut out);
        assert_eq!(stream.taken(), bytes.len() as u64, "the file is taken to its end");
        read.map(|_| out)
    }

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    fn zstd(bytes: &[u8]) -> Vec<u8> {
        ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)
    }

    fn bzip2(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = ::bzip2::write::BzEncoder::new(Vec::new(), ::bzip2::Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    fn xz(bytes: &[u8]) -> Vec<u8> {
        let mut writer =
            lzma_rust2::XzWriter::new(Vec::new(), lzma_rust2::XzOptions::with_preset(1)).unwrap();
        writer.write_all(bytes).unwrap();
        writer.finish().unwrap()
    }

    #[test]
    fn all_members_and_frames_are_read() {
        assert_eq!(unpacked(&[gzip(b"one "), gzip(b"two")].concat()).unwrap(), b"one two");
        assert_eq!(
            unpacked(&[gzip(b"one "), vec![0; 512], gzip(b"two"), vec![0; 3]].concat()).unwrap(),
            b"one two"
        );
        assert!(unpacked(&[gzip(b"one "), b"garbage behind it".to_vec()].concat()).is_err());
        let skippable = [0x50, 0x2a, 0x4d, 0x18, 3, 0, 0, 0, 9, 9, 9];
        let frames = [&skippable[..], &zstd(b"one "), &skippable, &zstd(b"two")].concat();
        assert_eq!(unpacked(&frames).unwrap(), b"one two");
        assert_eq!(unpacked(&[bzip2(b"one "), bzip2(b""), bzip2(b"two")].concat()).unwrap(), b"one two");
        assert_eq!(unpacked(&[xz(b"one "), vec![0; 4], xz(b"two")].concat()).unwrap(), b"one two");
        assert!(unpacked(&[xz(b"one "), b"garbage behind it".to_vec()].concat()).is_err());
    }

    #[test]
    fn a_compression_is_told_by_its_first_bytes() {
        for (packing, packed) in [
            (Packing::Gzip, gzip(b"")),
            (Packing::Zstd, zstd(b"")),
            (Packing::Bzip2, bzip2(b"")),
            (Packing::Bzip2, bzip2(b"one")),
            (Packing::Xz, xz(b"")),
        ] {
            assert_eq!(Packing::of(&packed[..MAGIC_BYTES]), packing);
        }
        assert_eq!(Packing::of(b"BZh91 is a zip code"), Packing::Plain);
    }

    #[test]
    fn damaged_streams_never_panic() {
        let text: Vec<u8> = (0..2000u32).flat_map(|k| k.to_string().into_bytes()).collect();
        for packed in [gzip(&text), zstd(&text), bzip2(&text), xz(&text)] {
            crate::read::real_data::damage(&packed, |file| {
                let mut out = Vec::new();
                let stream = Packing::of(file).stream(std::io::Cursor::new(file.to_vec()));
                drop(stream.take(1 << 20).read_to_end(&mut out));
            });
        }
    }

    #[test]
    fn a_stream_that_stops_early_says_so() {
        let text: Vec<u8> =
            (0..50_000u32).flat_map(|k| (k.wrapping_mul(2654435761)).to_string().into_bytes()).collect();
        for (name, packed) in
            [("gzip", gzip(&text)), ("zstd", zstd(&text)), ("bzip2", bzip2(&text)), ("xz", xz(&text))]
        {
            let error = unpacked(&packed[..packed.len() / 2]).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::UnexpectedEof, "{name}");
        }
    }

    #[test]
    fn a_small_file_does_not_become_terabytes() {
        // Zeros in streams of bzip2 behind each other: 45 bytes become 900,000, and so on.
        let bomb = bzip2(&vec![0; 10 << 20]).repeat(20);
        let mut stream = Packing::of(&bomb).stream(std::io::Cursor::new(bomb));
        let error = std::io::copy(&mut stream, &mut std::io::sink()).unwrap_err();
        assert!(error.to_string().contains("unpack it on disk"), "{error}");
        assert!(stream.given <= FREE_BYTES + (1 << 20), "{} bytes came out", stream.given);
    }

    #[test]
    fn plain_bytes_pass() {
        assert_eq!(unpacked(b"1 2 3").unwrap(), b"1 2 3");
    }
}
