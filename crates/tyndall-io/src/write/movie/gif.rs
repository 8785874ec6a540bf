//! GIF: 256 colors a picture, chosen for each by a neural quantizer (Dekker 1994), shown forever.

use std::fs;
use std::io::{self, BufWriter};

use gif::{AnyExtension, EncodingError, Frame, Repeat};

use super::{Frames, duration};

/// Of the quantizer, from 1 (best) to 30: above it pictures get worse, below it only slower.
const SPEED: i32 = 10;
/// The label of a comment (GIF89a, section 24).
const COMMENT: u8 = 0xfe;

pub(super) struct File {
    encoder: gif::Encoder<BufWriter<fs::File>>,
    size: [u16; 2],
    rate: f64,
    count: u64,
}

impl File {
    /// The size has at most 16 bits.
    pub(super) fn new(
        file: fs::File,
        size: [u32; 2],
        rate: f64,
        metadata: &[(String, String)],
    ) -> io::Result<Self> {
        let size = size.map(|it| it as u16);
        let [width, height] = size;
        let mut encoder = gif::Encoder::new(BufWriter::new(file), width, height, &[]).map_err(io_error)?;
        encoder.set_repeat(Repeat::Infinite).map_err(io_error)?;
        let lines: Vec<String> = metadata.iter().map(|(key, text)| format!("{key}: {text}")).collect();
        if !lines.is_empty() {
            let text = lines.join("\n");
            encoder.write_raw_extension(AnyExtension(COMMENT), &[text.as_bytes()]).map_err(io_error)?;
        }
        Ok(Self { encoder, size, rate, count: 0 })
    }
}

impl Frames for File {
    fn add(&mut self, pixels: &[u8]) -> io::Result<()> {
        let [width, height] = self.size;
        let mut frame = Frame::from_rgb_speed(width, height, pixels, SPEED);
        frame.delay = duration(self.count, self.rate, 100.0).min(u16::MAX.into()) as u16;
        self.count += 1;
        self.encoder.write_frame(&frame).map_err(io_error)
    }

    fn finish(self: Box<Self>, _: &[(String, String)]) -> io::Result<()> {
        let writer = self.encoder.into_inner().map_err(io_error)?;
        writer.into_inner().map_err(io::IntoInnerError::into_error)?;
        Ok(())
    }
}

fn io_error(error: EncodingError) -> io::Error {
    match error {
        EncodingError::Io(error) => error,
        other => io::Error::other(other),
    }
}
