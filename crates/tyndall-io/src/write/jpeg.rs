//! JPEG: sRGB-encoded, 8 bits a channel, opaque. From quality 90 on colors have the resolution of brightness.
//!
//! Source: ITU-T T.81 and T.871 (JFIF).

use std::io;
use std::path::Path;

use jpeg_encoder::{ColorType, Encoder, EncodingError, PixelDensity};
use tyndall::{Error, Image, Result};

use super::stored::{Stored, is_opaque};
use super::{ImageOptions, atomically, transparent};
use crate::xmp;

/// The most bytes of a packet of XMP, which has to fit one segment.
const XMP_BYTES: usize = 65_000;

/// Writes the picture. The options but for `quality` were checked by the caller.
pub(super) fn write(path: &Path, image: &Image, options: &ImageOptions) -> Result<()> {
    if !(1..=100).contains(&options.quality) {
        return Err(Error::setting("--quality", options.quality, "from 1 (small) to 100 (good)"));
    }
    let sides = [image.width, image.height].map(u16::try_from);
    let [Ok(width), Ok(height)] = sides else {
        let size = format!("{}x{}", image.width, image.height);
        return Err(Error::setting("--size", size, "a JPEG has at most 65535 pixels across and down"));
    };
    if !is_opaque(image) {
        return Err(transparent(path, "JPEG"));
    }
    let bytes = Stored { is_wide: false, has_alpha: false }.bytes(&image.color).concat();
    atomically(path, |file| {
        let mut encoder = Encoder::new(file, options.quality);
        encoder.set_optimized_huffman_tables(true);
        if let Some(dpi) = options.dpi {
            encoder.set_density(PixelDensity::dpi((dpi.round() as u16).max(1)));
        }
        let packet = [xmp::IN_JPEG, packet(&options.metadata).as_bytes()].concat();
        encoder.add_app_segment(1, packet).map_err(io_error)?;
        encoder.encode(&bytes, width, height, ColorType::Rgb).map_err(io_error)
    })
}

/// The texts that fit: the longest are left out first.
fn packet(metadata: &[(String, String)]) -> String {
    let mut kept = metadata.to_vec();
    loop {
        let packet = xmp::packet(&kept);
        let longest = kept.iter().enumerate().max_by_key(|(_, (_, text))| text.len()).map(|(place, _)| place);
        match longest {
            Some(longest) if packet.len() > XMP_BYTES => kept.remove(longest),
            _ => return packet,
        };
    }
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
    use crate::read::picture_texts;

    /// Mean difference of the channels from those of a PNG, and the bytes of the file.
    fn written(folder: &Folder, quality: u8) -> (f64, usize) {
        let (path, image) = (folder.0.join("a.jpeg"), ramp(60, 50, true));
        super::super::image(&path, &image, &ImageOptions { quality, ..Default::default() }).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let mut decoder = zune_jpeg::JpegDecoder::new(std::io::Cursor::new(&bytes[..]));
        let found = decoder.decode().unwrap();
        assert_eq!(decoder.dimensions(), Some((60, 50)));
        let wanted = Stored { is_wide: false, has_alpha: false }.bytes(&image.color).concat();
        assert_eq!(found.len(), wanted.len());
        let sum: u64 = found.iter().zip(&wanted).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        (sum as f64 / wanted.len() as f64, bytes.len())
    }

    #[test]
    fn quality_is_paid_with_bytes() {
        let folder = Folder::new("jpeg");
        let [(good, large), (poor, small)] = [95, 10].map(|quality| written(&folder, quality));
        assert!(good < 1.5 && poor > good && large > small, "{good} {poor} {large} {small}");
    }

    #[test]
    fn what_a_jpeg_cannot_have_is_refused() {
        let folder = Folder::new("jpeg-refused");
        let path = folder.0.join("a.jpg");
        let refused = |image: &Image, options: &ImageOptions| {
            super::super::image(&path, image, options).unwrap_err().to_string()
        };
        let opaque = ramp(4, 4, true);
        assert!(refused(&ramp(4, 4, false), &ImageOptions::default()).contains("transparent"));
        assert!(refused(&opaque, &ImageOptions { quality: 0, ..Default::default() }).contains("--quality"));
        assert!(refused(&ramp(65_536, 1, true), &ImageOptions::default()).contains("65535"));
        assert!(folder.names().is_empty());
    }

    #[test]
    fn texts_that_do_not_fit_are_left_out() {
        let folder = Folder::new("jpeg-texts");
        let path = folder.0.join("a.jpg");
        let metadata = vec![("Inputs".to_string(), "é".repeat(50_000)), ("Scene".into(), "a = 1".into())];
        super::super::image(&path, &ramp(4, 4, true), &ImageOptions { metadata, ..Default::default() })
            .unwrap();
        assert_eq!(picture_texts(&path).unwrap(), [("Scene".to_string(), "a = 1".to_string())]);
    }
}
