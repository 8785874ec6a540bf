//! Animated WebP: every picture without loss, with alpha, shown forever.
//!
//! Source: Google, WebP Container Specification, sections "Extended File Format" and "Animation".

use std::fs;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};

use image_webp::{ColorType, EncodingError, WebPEncoder};

use super::{Frames, duration};
use crate::xmp;

/// There is an animation; alpha; XMP.
const FLAGS: u8 = 0x02 | 0x10 | 0x04;
/// What a picture was drawn over does not shine through it.
const NO_BLENDING: u8 = 0x02;
/// A file of one picture begins with these before its chunks: `RIFF`, a size, `WEBP`.
const HEAD: usize = 12;

pub(super) struct File {
    file: BufWriter<fs::File>,
    size: [u32; 2],
    rate: f64,
    count: u64,
}

impl File {
    /// The size has at most 14 bits.
    pub(super) fn new(file: fs::File, size: [u32; 2], rate: f64) -> io::Result<Self> {
        let mut file = BufWriter::new(file);
        file.write_all(b"RIFF\0\0\0\0WEBP")?;
        let mut extended = vec![FLAGS, 0, 0, 0];
        size.iter().for_each(|it| push_24(&mut extended, it - 1));
        write_chunk(&mut file, b"VP8X", &extended)?;
        // Transparent black behind, shown forever.
        write_chunk(&mut file, b"ANIM", &[0; 6])?;
        Ok(Self { file, size, rate, count: 0 })
    }
}

impl Frames for File {
    fn add(&mut self, pixels: &[u8]) -> io::Result<()> {
        let [width, height] = self.size;
        let mut picture = Vec::new();
        WebPEncoder::new(&mut picture).encode(pixels, width, height, ColorType::Rgba8).map_err(io_error)?;
        let mut frame = Vec::with_capacity(picture.len() + 16);
        for number in [0, 0, width - 1, height - 1] {
            push_24(&mut frame, number);
        }
        let milliseconds = duration(self.count, self.rate, 1000.0).min(0xff_ffff) as u32;
        push_24(&mut frame, milliseconds);
        frame.push(NO_BLENDING);
        frame.extend(&picture[HEAD..]);
        self.count += 1;
        write_chunk(&mut self.file, b"ANMF", &frame)
    }

    fn finish(mut self: Box<Self>, metadata: &[(String, String)]) -> io::Result<()> {
        write_chunk(&mut self.file, b"XMP ", xmp::packet(metadata).as_bytes())?;
        let bytes = self.file.stream_position()?;
        let size = u32::try_from(bytes - 8)
            .map_err(|_| io::Error::other("a WebP has at most 4 GiB: fewer or smaller pictures, or .mp4"))?;
        self.file.seek(SeekFrom::Start(4))?;
        self.file.write_all(&size.to_le_bytes())?;
        self.file.flush()
    }
}

/// A chunk has an even number of bytes.
fn write_chunk(file: &mut impl Write, name: &[u8; 4], content: &[u8]) -> io::Result<()> {
    file.write_all(name)?;
    file.write_all(&(content.len() as u32).to_le_bytes())?;
    file.write_all(content)?;
    if content.len() % 2 == 1 { file.write_all(&[0]) } else { Ok(()) }
}

/// The lower 24 bits.
fn push_24(bytes: &mut Vec<u8>, number: u32) {
    bytes.extend(&number.to_le_bytes()[..3]);
}

fn io_error(error: EncodingError) -> io::Error {
    match error {
        EncodingError::IoError(error) => error,
        other => io::Error::other(other),
    }
}
