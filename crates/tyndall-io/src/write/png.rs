//! PNG: straight alpha, sRGB-encoded, 8 or 16 bits a channel. A picture that is opaque everywhere has no alpha channel.
//!
//! Source: Portable Network Graphics, third edition, W3C 2025.

use std::io::{self, Write};
use std::path::Path;

use png::{
    BitDepth, ColorType, DeflateCompression, Encoder, EncodingError, Filter, PixelDimensions,
    SrgbRenderingIntent, Unit,
};
use tyndall::{Error, Image, Result};

use super::stored::{Stored, is_opaque};
use super::{ImageOptions, atomically};

/// Pixels that are converted at a time: enough for all threads, little beside the picture.
const BATCH: usize = 1 << 18;
/// Files as small as at the usual level, in a third of its time.
const DEFLATE: u8 = 2;

/// Writes the picture. The options but for `bits` were checked by the caller.
pub(super) fn write(path: &Path, image: &Image, options: &ImageOptions) -> Result<()> {
    let format = Stored { is_wide: is_wide(options)?, has_alpha: !is_opaque(image) };
    let bands = |write: &mut Pixels| image.color.chunks(BATCH).try_for_each(write);
    atomically(path, |file| encode(file, [image.width, image.height], options, &format, bands))
}

/// Writes a picture of that size from bands, of which `band` gives the one that begins with a row. So the picture need not be in memory.
pub(super) fn write_in_bands(
    path: &Path,
    size: [u32; 2],
    has_alpha: bool,
    options: &ImageOptions,
    mut band: impl FnMut(u32) -> Result<Image>,
) -> Result<()> {
    let format = Stored { is_wide: is_wide(options)?, has_alpha };
    let mut failed = None;
    let bands = |write: &mut Pixels| {
        let mut row = 0;
        while row < size[1] {
            let image = band(row).map_err(|error| {
                failed = Some(error);
                io::Error::other("a part of the picture failed")
            })?;
            assert!(image.width == size[0] && image.height > 0, "bands are as wide as the picture");
            row += image.height;
            image.color.chunks(BATCH).try_for_each(&mut *write)?;
        }
        Ok(())
    };
    let written = atomically(path, |file| encode(file, size, options, &format, bands));
    failed.map_or(written, Err)
}

fn is_wide(options: &ImageOptions) -> Result<bool> {
    match options.bits {
        8 => Ok(false),
        16 => Ok(true),
        other => Err(Error::setting("--bits", other, "a PNG has 8 or 16 bits a channel")),
    }
}

/// What takes the pixels of a picture, from the upper left on.
type Pixels<'a> = dyn FnMut(&[[f32; 4]]) -> io::Result<()> + 'a;

fn encode(
    file: impl Write,
    [width, height]: [u32; 2],
    options: &ImageOptions,
    format: &Stored,
    give: impl FnOnce(&mut Pixels) -> io::Result<()>,
) -> io::Result<()> {
    let mut encoder = Encoder::new(file, width, height);
    encoder.set_color(if format.has_alpha { ColorType::Rgba } else { ColorType::Rgb });
    encoder.set_depth(if format.is_wide { BitDepth::Sixteen } else { BitDepth::Eight });
    encoder.set_deflate_compression(DeflateCompression::Level(DEFLATE));
    encoder.set_filter(Filter::Adaptive);
    encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    encoder.set_pixel_dims(options.dpi.map(|dpi| {
        let per_meter = (dpi / 0.0254).round() as u32;
        PixelDimensions { xppu: per_meter, yppu: per_meter, unit: Unit::Meter }
    }));
    for (key, text) in &options.metadata {
        // NUL ends nothing here, but readers take it for the end.
        let (key, text) = (key.clone(), text.replace('\0', " "));
        // tEXt is Latin-1, but readers disagree beyond ASCII.
        if text.is_ascii() { encoder.add_text_chunk(key, text) } else { encoder.add_itxt_chunk(key, text) }
            .map_err(io_error)?;
    }

    let mut picture = encoder.write_header().map_err(io_error)?;
    let mut writer = picture.stream_writer().map_err(io_error)?;
    give(&mut |pixels| format.bytes(pixels).iter().try_for_each(|bytes| writer.write_all(bytes)))?;
    writer.finish().map_err(io_error)?;
    picture.finish().map_err(io_error)
}

fn io_error(error: EncodingError) -> io::Error {
    match error {
        EncodingError::IoError(error) => error,
        other => io::Error::other(other),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Folder, ramp};
    use super::*;
    use std::fs::File;
    use std::io::BufReader;

    /// Reads a file back: its description, and its channels as numbers from 0 to 255 or 65535.
    fn read(path: &Path) -> (png::Info<'static>, Vec<u16>) {
        let mut decoder = png::Decoder::new(BufReader::new(File::open(path).unwrap()));
        decoder.set_transformations(png::Transformations::IDENTITY);
        let mut reader = decoder.read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        reader.finish().unwrap();
        let words = match reader.info().bit_depth {
            BitDepth::Sixteen => bytes.chunks(2).map(|it| u16::from_be_bytes([it[0], it[1]])).collect(),
            _ => bytes.iter().map(|&byte| byte as u16).collect(),
        };
        (reader.info().clone(), words)
    }

    /// The standard's formula in double precision.
    fn slow(light: f32, alpha: f32, full: f64) -> u16 {
        let linear = if alpha > 0.0 { light as f64 / alpha as f64 } else { 0.0 };
        let encoded =
            if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
        (full * encoded.clamp(0.0, 1.0)).round() as u16
    }

    #[test]
    fn pixels_are_encoded_to_the_nearest_value() {
        let folder = Folder::new("png");
        for (bits, opaque) in [(8, true), (8, false), (16, true), (16, false)] {
            let (path, image) = (folder.0.join("a.png"), ramp(600, 500, opaque));
            let full = if bits == 8 { 255.0 } else { 65535.0 };
            super::super::image(&path, &image, &ImageOptions { bits, ..Default::default() }).unwrap();
            let (info, words) = read(&path);
            assert_eq!((info.width, info.height, info.bit_depth as u8), (600, 500, bits));
            assert_eq!(info.color_type, if opaque { ColorType::Rgb } else { ColorType::Rgba });
            assert_eq!(info.srgb, Some(SrgbRenderingIntent::Perceptual));
            let channels = if opaque { 3 } else { 4 };
            assert_eq!(words.len(), image.color.len() * channels);
            // Single precision may fall on the other side of a half.
            let tolerance = if bits == 8 { 1 } else { 2 };
            let mut off = 0;
            for (pixel, found) in image.color.iter().zip(words.chunks(channels)) {
                for (c, found) in found.iter().enumerate() {
                    let alpha = || (full * pixel[3] as f64).round() as u16;
                    let wanted = if c < 3 { slow(pixel[c], pixel[3], full) } else { alpha() };
                    assert!(found.abs_diff(wanted) <= tolerance, "{pixel:?} {c} {found}");
                    off += usize::from(*found != wanted);
                }
            }
            assert!(off * 50 < words.len(), "{off} of {} differ at {bits} bits", words.len());
        }
    }

    #[test]
    fn bands_make_the_picture_that_the_whole_makes() {
        let folder = Folder::new("png-bands");
        let [whole, banded] = ["a.png", "b.png"].map(|name| folder.0.join(name));
        for is_opaque in [true, false] {
            let image = ramp(50, 37, is_opaque);
            super::super::image(&whole, &image, &ImageOptions::default()).unwrap();
            let band = |row: u32| {
                let rows = 10.min(37 - row);
                let pixels = (row * 50) as usize..((row + rows) * 50) as usize;
                let color = image.color[pixels].to_vec();
                Ok(Image { width: 50, height: rows, color, ..Image::default() })
            };
            super::super::in_bands(&banded, [50, 37], !is_opaque, &ImageOptions::default(), band).unwrap();
            assert_eq!(std::fs::read(&whole).unwrap(), std::fs::read(&banded).unwrap());
        }
        std::fs::remove_file(&banded).unwrap();
        let failing = |row: u32| if row == 0 { Ok(ramp(50, 10, true)) } else { Err(Error::Interrupted) };
        let failed = super::super::in_bands(&banded, [50, 37], false, &ImageOptions::default(), failing);
        assert!(matches!(failed, Err(Error::Interrupted)));
        assert_eq!(folder.names(), ["a.png"]);
    }

    #[test]
    fn texts_and_size_on_paper_are_kept() {
        let folder = Folder::new("png-text");
        let path = folder.0.join("a.png");
        let pair = |key: &str, text: &str| (key.to_string(), text.to_string());
        let metadata = vec![pair("Software", "Tyndall 0.1.0"), pair("tyndall:unit", "5 Å, ½ µm\nand 粒子")];
        super::super::image(
            &path,
            &ramp(3, 2, true),
            &ImageOptions { dpi: Some(300.0), metadata, ..Default::default() },
        )
        .unwrap();
        let (info, _) = read(&path);
        let size = info.pixel_dims.unwrap();
        assert_eq!((size.xppu, size.yppu, size.unit), (11811, 11811, Unit::Meter));
        assert_eq!(info.uncompressed_latin1_text[0].text, "Tyndall 0.1.0");
        assert_eq!(info.utf8_text[0].get_text().unwrap(), "5 Å, ½ µm\nand 粒子");
    }
}
