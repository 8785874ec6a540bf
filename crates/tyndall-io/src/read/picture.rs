//! The texts that are written in pictures: of PNG files the text chunks, of EXR files the attributes that are texts, of JPEG files what
//! Tyndall writes as XMP.
//!
//! Sources: Portable Network Graphics, third edition, W3C 2025; The OpenEXR File Layout, openexr.com; ITU-T T.81, annex B (markers);
//! Adobe, XMP Specification Part 3, 2012 (JPEG).

use std::io::Cursor;
use std::path::Path;

use exr::meta::MetaData;
use exr::prelude::AttributeValue;
use tyndall::{Error, Result};

use crate::xmp;

/// Keys and texts that a PNG, EXR or JPEG file has beside its pixels, which are not looked at.
///
/// Fails with [`Error::Format`] if it is no such file or is damaged before its pixels, with [`Error::Io`] if it cannot be read.
pub fn picture_texts(path: &Path) -> Result<Vec<(String, String)>> {
    let bytes = super::map(path)?;
    let found = match &bytes[..] {
        [0x89, b'P', b'N', b'G', ..] => of_png(&bytes),
        [0x76, 0x2f, 0x31, 0x01, ..] => of_exr(&bytes),
        [0xff, 0xd8, ..] => of_jpeg(&bytes),
        _ => Err("it is neither a PNG, an EXR nor a JPEG file".into()),
    };
    found.map_err(|what| Error::format(path, "", what, "a picture as Tyndall writes it"))
}

/// Keys and texts, or what is wrong.
type Found = std::result::Result<Vec<(String, String)>, String>;

fn of_png(bytes: &[u8]) -> Found {
    let reader = png::Decoder::new(Cursor::new(bytes)).read_info().map_err(|error| error.to_string())?;
    let info = reader.info();
    let latin = info.uncompressed_latin1_text.iter().map(|it| (it.keyword.clone(), it.text.clone()));
    let mut texts: Vec<(String, String)> = latin.collect();
    for text in &info.utf8_text {
        texts.push((text.keyword.clone(), text.get_text().map_err(|error| error.to_string())?));
    }
    Ok(texts)
}

fn of_exr(bytes: &[u8]) -> Found {
    let read = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|error| error.to_string())?;
    let attributes = read.headers.iter().flat_map(|header| &header.own_attributes.other);
    let texts = attributes.filter_map(|(key, value)| match value {
        AttributeValue::Text(text) => {
            Some((key.to_string(), String::from_utf8_lossy(text.bytes()).into_owned()))
        }
        _ => None,
    });
    let mut texts: Vec<(String, String)> = texts.collect();
    texts.sort();
    Ok(texts)
}

fn of_jpeg(bytes: &[u8]) -> Found {
    const CUT_OFF: &str = "it ends before its pixels";
    // Behind the marker that begins the file each segment has a marker and a length, which counts itself.
    let mut rest = &bytes[2..];
    loop {
        let [0xff, marker, high, low, ..] = *rest else { return Err(CUT_OFF.into()) };
        // The start of scan.
        if marker == 0xda {
            return Ok(Vec::new());
        }
        let length = usize::from(u16::from_be_bytes([high, low]));
        let segment = rest.get(4..2 + length).ok_or(CUT_OFF)?;
        if let Some(packet) = segment.strip_prefix(xmp::IN_JPEG).filter(|_| marker == 0xe1) {
            return xmp::texts(std::str::from_utf8(packet).map_err(|error| error.to_string())?);
        }
        rest = &rest[2 + length..];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::write::tests::{Folder, ramp};
    use crate::write::{ImageOptions, image};

    #[test]
    fn texts_come_back_as_they_were_written() {
        let folder = Folder::new("picture-texts");
        let pair = |key: &str, text: &str| (key.to_string(), text.to_string());
        let metadata = vec![
            pair("Scene", "[camera]\neye = [1, 2, 3]\n\n[look]\ncolor = '<&\">'  \n"),
            pair("Software", "Tyndall 0.1.0"),
            pair("Unit", "½ Å"),
        ];
        for name in ["a.png", "a.exr", "a.jpg"] {
            let path = folder.0.join(name);
            let options = ImageOptions { metadata: metadata.clone(), ..Default::default() };
            image(&path, &ramp(9, 8, true), &options).unwrap();
            let found = picture_texts(&path).unwrap();
            for pair in &metadata {
                assert!(found.contains(pair), "{name}: {pair:?} is not in {found:?}");
            }
        }
    }

    #[test]
    fn what_is_no_picture_is_refused() {
        let folder = Folder::new("no-picture");
        let contents: [&[u8]; 5] =
            [b"", b"P6", b"\x89PNG\r\n\x1a\n", b"\x76\x2f\x31\x01\x02", b"\xff\xd8\xff\xe1\x00\x20http"];
        for content in contents {
            let path = folder.0.join("a");
            std::fs::write(&path, content).unwrap();
            assert!(matches!(picture_texts(&path), Err(Error::Format { .. })), "{content:?}");
        }
    }
}
