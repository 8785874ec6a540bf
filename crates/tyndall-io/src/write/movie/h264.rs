//! H.264 by the encoder that is built in, and pictures as it takes them.
//!
//! Sources: ITU-T H.264 (2021), Annex A (levels), B (byte streams); ITU-R BT.709-6 (2015), section 3 (colors).

use std::io;

use rayon::prelude::*;
use rusty_h264_common::YuvFrame;
use rusty_h264_encoder::{EncoderConfig, Preset};

/// From 0 (best) to 51: at 18 a picture is hard to tell from the one that was given.
const QUANTIZER: u8 = 18;
/// Pictures from one that stands for itself to the next: a player can jump there.
const KEY_INTERVAL: u32 = 48;
/// Of each level: what the stream calls it, macroblocks of a picture and of a second (table A-1).
const LEVELS: [(u8, u64, u64); 11] = [
    (30, 1_620, 40_500),
    (31, 3_600, 108_000),
    (32, 5_120, 216_000),
    (40, 8_192, 245_760),
    (42, 8_704, 522_240),
    (50, 22_080, 589_824),
    (51, 36_864, 983_040),
    (52, 36_864, 2_073_600),
    (60, 139_264, 4_177_920),
    (61, 139_264, 8_355_840),
    (62, 139_264, 16_711_680),
];

/// The lowest level that has pictures of `size` at `rate` pictures a second. Neither side may have more macroblocks than the root of eight
/// times a picture's.
pub(super) fn level(size: [u32; 2], rate: f64) -> Option<u8> {
    let [width, height] = size.map(|it| u64::from(it.div_ceil(16)));
    let (picture, second) = (width * height, (width * height) as f64 * rate);
    let fits = |&&(_, most, most_a_second): &&(u8, u64, u64)| {
        picture <= most && second <= most_a_second as f64 && width.max(height).pow(2) <= 8 * most
    };
    LEVELS.iter().find(fits).map(|(name, ..)| *name)
}

/// A stream that is being written.
pub(super) struct Stream {
    encoder: rusty_h264_encoder::Encoder,
    size: [usize; 2],
}

/// A picture of the stream.
pub(super) struct Coded {
    /// Its units, each behind its length in four bytes, without those that all pictures share.
    pub(super) units: Vec<u8>,
    /// Whether it stands for itself.
    pub(super) is_key: bool,
    /// Of the stream: sets of parameters of sequences and of pictures. Empty if it repeats none.
    pub(super) sequence: Vec<u8>,
    pub(super) picture: Vec<u8>,
}

impl Stream {
    /// `size` is even and has a [`level`].
    pub(super) fn new(size: [u32; 2], rate: f64) -> io::Result<Self> {
        let [width, height] = size.map(|it| it as usize);
        let mut config = EncoderConfig::new(width, height);
        config.level_idc = level(size, rate).unwrap_or(u8::MAX);
        config.qp = QUANTIZER;
        config.gop_size = KEY_INTERVAL;
        config.framerate = rate as f32;
        config.preset = Preset::Balanced;
        // Nothing looks ahead: each picture given is a picture out.
        (config.scenecut, config.mbtree, config.bframes) = (0, false, 0);
        let encoder = rusty_h264_encoder::Encoder::new(config)
            .map_err(|error| io::Error::other(format!("H.264: {error:?}")))?;
        Ok(Self { encoder, size: [width, height] })
    }

    /// Codes a picture of red, green and blue.
    pub(super) fn code(&mut self, pixels: &[u8]) -> io::Result<Coded> {
        let bytes = self
            .encoder
            .try_encode(&from_rgb(pixels, self.size))
            .map_err(|error| io::Error::other(format!("H.264: {error:?}")))?;
        let mut coded = Coded { units: Vec::new(), is_key: false, sequence: Vec::new(), picture: Vec::new() };
        for unit in units(&bytes) {
            match unit.first().map_or(0, |head| head & 0x1f) {
                0 => {}
                7 => coded.sequence = unit.to_vec(),
                8 => coded.picture = unit.to_vec(),
                kind => {
                    coded.is_key |= kind == 5;
                    coded.units.extend((unit.len() as u32).to_be_bytes());
                    coded.units.extend(unit);
                }
            }
        }
        Ok(coded)
    }
}

/// What stands between the start codes 0 0 1 of a byte stream (Annex B), without zeros around.
fn units(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let starts: Vec<usize> = memchr::memmem::find_iter(bytes, &[0, 0, 1]).collect();
    let ends: Vec<usize> = starts.iter().skip(1).copied().chain([bytes.len()]).collect();
    starts.into_iter().zip(ends).map(|(start, end)| {
        let unit = &bytes[start + 3..end];
        let length = unit.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
        &unit[..length]
    })
}

/// Brightness of each pixel and color of each two by two, of the range from 16 to 235 and to 240. Color lies at the left pixels, between the
/// rows, as players take it: of each row, half is of that pixel and a quarter of each neighbor.
fn from_rgb(pixels: &[u8], [width, height]: [usize; 2]) -> YuvFrame {
    let [chroma_width, chroma_height] = [width / 2, height / 2];
    let mut luma = vec![0; width * height];
    let mut blue = vec![0; chroma_width * chroma_height];
    let mut red = blue.clone();
    let rows = luma.par_chunks_mut(2 * width).zip(pixels.par_chunks(6 * width));
    rows.zip(blue.par_chunks_mut(chroma_width).zip(red.par_chunks_mut(chroma_width))).for_each(
        |((luma, pixels), (blue, red))| {
            let pixel = |place: usize| [0, 1, 2].map(|channel| f32::from(pixels[3 * place + channel]));
            let brightness = |[r, g, b]: [f32; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
            for (place, luma) in luma.iter_mut().enumerate() {
                *luma = (16.0 + brightness(pixel(place)) * (219.0 / 255.0)).round() as u8;
            }
            for (column, (blue, red)) in blue.iter_mut().zip(red).enumerate() {
                let x = 2 * column;
                let weighted = [(x.saturating_sub(1), 0.125), (x, 0.25), (x + 1, 0.125)];
                let mut mean = [0.0; 3];
                for (x, weight) in weighted {
                    for y in [0, 1] {
                        let rgb = pixel(y * width + x);
                        mean.iter_mut().zip(rgb).for_each(|(mean, value)| *mean += weight * value);
                    }
                }
                let y = brightness(mean);
                let color = |difference: f32, most: f32| {
                    (128.0 + difference / most * (224.0 / 255.0)).round().clamp(16.0, 240.0) as u8
                };
                *blue = color(mean[2] - y, 1.8556);
                *red = color(mean[0] - y, 1.5748);
            }
        },
    );
    YuvFrame { width, height, y: luma, u: blue, v: red }
}
