//! Pictures of the whole sky as lights: equirectangular, from OpenEXR or Radiance HDR files, told apart by their first bytes.
//!
//! Takes a file and a factor, gives an environment with the y axis up (row 0 is above). Negative values, which filters leave, count
//! as 0; what is not a number is refused. Of an EXR file the first layer with R, G, B counts, whatever the data type.
//! Sources: The OpenEXR File Layout, openexr.com; G. Ward, "Real pixels", Graphics Gems II, 1991, and radiance-online.org,
//! "The RADIANCE picture file format" (RGBE, run lengths).

use std::path::Path;

use exr::prelude::{ReadChannels, ReadLayers, Vec2};
use tyndall::medium::light::Environment;
use tyndall::{Error, Result};

/// Pixels of the largest picture: 1.6 GB.
const MOST_PIXELS: u64 = 1 << 27;

/// Rows from the top, `width` pixels each.
struct Pixels {
    width: usize,
    rgb: Vec<[f32; 3]>,
}

/// Reads a picture of the sky; its radiance is multiplied with `factor`.
///
/// Fails with [`Error::Format`] where it is no such picture or has a pixel that is no number, and with [`Error::Setting`] for a
/// factor that is negative or not finite.
pub fn sky(path: &Path, factor: [f32; 3]) -> Result<Environment> {
    let bytes = super::map(path)?;
    let hint = "an equirectangular picture in OpenEXR or Radiance HDR";
    let bad = |what: String| Error::format(path, "", what, hint);
    let mut pixels = match &bytes[..] {
        [0x76, 0x2f, 0x31, 0x01, ..] => of_exr(&bytes).map_err(|error| bad(error.to_string()))?,
        [b'#', b'?', ..] => of_hdr(&bytes).map_err(|what| bad(what.to_string()))?,
        _ => return Err(bad("it is neither an EXR nor an HDR file".into())),
    };
    for (place, pixel) in pixels.rgb.iter_mut().enumerate() {
        for (value, factor) in pixel.iter_mut().zip(factor) {
            if !value.is_finite() {
                let (column, row) = (place % pixels.width, place / pixels.width);
                return Err(bad(format!("the pixel in column {column}, row {row} is {value}")));
            }
            *value = value.max(0.0) * factor;
        }
    }
    Environment::image(pixels.width as u32, &pixels.rgb)
}

fn of_exr(bytes: &[u8]) -> exr::error::Result<Pixels> {
    let create = |size: Vec2<usize>, _: &_| Pixels {
        width: size.width(),
        rgb: vec![[0.0; 3]; if size.area() as u64 <= MOST_PIXELS { size.area() } else { 0 }],
    };
    let set = |pixels: &mut Pixels, at: Vec2<usize>, (r, g, b, _): (f32, f32, f32, f32)| {
        if let Some(pixel) = pixels.rgb.get_mut(at.y() * pixels.width + at.x()) {
            *pixel = [r, g, b];
        }
    };
    let read = exr::prelude::read().no_deep_data().largest_resolution_level();
    let image = read.rgba_channels(create, set).first_valid_layer().all_attributes();
    let pixels = image.from_buffered(std::io::Cursor::new(bytes))?.layer_data.channel_data.pixels;
    if pixels.rgb.is_empty() {
        return Err(exr::error::Error::Invalid("it has no pixels, or more than 2^27".into()));
    }
    Ok(pixels)
}

/// What is wrong with a file.
type Found<T> = std::result::Result<T, &'static str>;

const CUT_OFF: &str = "it ends too early";

fn of_hdr(bytes: &[u8]) -> Found<Pixels> {
    let mut rest = bytes;
    let mut exposure = 1.0_f32;
    loop {
        match line(&mut rest)? {
            "" => break,
            text => match text.split_once('=') {
                Some(("FORMAT", format)) if format.trim() != "32-bit_rle_rgbe" => {
                    return Err("its format is not 32-bit_rle_rgbe");
                }
                // Pixels were multiplied with it.
                Some(("EXPOSURE", value)) => exposure *= value.trim().parse().unwrap_or(1.0),
                _ => {}
            },
        }
    }
    let words: Vec<&str> = line(&mut rest)?.split_whitespace().collect();
    let &[vertical @ ("-Y" | "+Y"), height, horizontal @ ("+X" | "-X"), width] = &words[..] else {
        return Err("its rows are not said as -Y HEIGHT +X WIDTH");
    };
    let count = |text: &str| text.parse::<usize>().ok().filter(|&it| it > 0);
    let (width, height) = count(width).zip(count(height)).ok_or("its size is not two counts")?;
    if width as u64 * height as u64 > MOST_PIXELS || !(exposure > 0.0 && exposure.is_finite()) {
        return Err("it has more than 2^27 pixels, or an impossible exposure");
    }
    let mut rgb = Vec::new();
    let mut row = vec![[0_u8; 4]; width];
    for _ in 0..height {
        scan_line(&mut rest, &mut row)?;
        rgb.extend(row.iter().map(|&pixel| light(pixel).map(|it| it / exposure)));
    }
    if vertical == "+Y" {
        rgb = rgb.chunks_exact(width).rev().flatten().copied().collect();
    }
    if horizontal == "-X" {
        rgb.chunks_exact_mut(width).for_each(<[_]>::reverse);
    }
    Ok(Pixels { width, rgb })
}

/// The next line of a header.
fn line<'a>(rest: &mut &'a [u8]) -> Found<&'a str> {
    let end = rest.iter().position(|&it| it == b'\n').ok_or(CUT_OFF)?;
    let (text, behind) = rest.split_at(end);
    *rest = &behind[1..];
    std::str::from_utf8(text).map(str::trim_end).map_err(|_| "its header is no text")
}

fn take<'a>(rest: &mut &'a [u8], count: usize) -> Found<&'a [u8]> {
    let (taken, behind) = rest.split_at_checked(count).ok_or(CUT_OFF)?;
    *rest = behind;
    Ok(taken)
}

/// One row of pixels: each component with its own run lengths, or pixels, of which some are repeated.
fn scan_line(rest: &mut &[u8], row: &mut [[u8; 4]]) -> Found<()> {
    let by_component = rest.len() >= 4 && rest[..2] == [2, 2] && rest[2] < 128;
    if by_component && usize::from(rest[2]) << 8 | usize::from(rest[3]) == row.len() {
        take(rest, 4)?;
        for component in 0..4 {
            let mut place = 0;
            while place < row.len() {
                let code = usize::from(take(rest, 1)?[0]);
                let (count, is_run) = if code > 128 { (code - 128, true) } else { (code, false) };
                let values = take(rest, if is_run { 1 } else { count })?;
                let pixels = row.get_mut(place..place + count).ok_or("a run goes beyond its row")?;
                for (pixel, value) in pixels.iter_mut().zip(values.iter().cycle()) {
                    pixel[component] = *value;
                }
                place += count.max(1);
            }
        }
        return Ok(());
    }
    let (mut place, mut shift) = (0, 0);
    while place < row.len() {
        let pixel = take(rest, 4)?;
        if pixel[..3] != [1, 1, 1] {
            row[place].copy_from_slice(pixel);
            (place, shift) = (place + 1, 0);
            continue;
        }
        // The pixel before is repeated; further counts are higher digits.
        let count = usize::from(pixel[3]).checked_shl(shift).unwrap_or(usize::MAX);
        let before = *row.get(place.wrapping_sub(1)).ok_or("a row begins with a repetition")?;
        row.get_mut(place..place.saturating_add(count)).ok_or("a run goes beyond its row")?.fill(before);
        (place, shift) = (place + count, shift + 8);
    }
    Ok(())
}

/// Three mantissas and one exponent.
fn light([r, g, b, exponent]: [u8; 4]) -> [f32; 3] {
    let unit = if exponent == 0 { 0.0 } else { (f32::from(exponent) - 136.0).exp2() };
    [r, g, b].map(|it| f32::from(it) * unit)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn read(bytes: &[u8]) -> Result<Environment> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky");
        fs::write(&path, bytes).unwrap();
        sky(&path, [2.0, 1.0, 1.0])
    }

    /// 8 x 2 pixels: the upper row 1, 0.5, 0.25, below nothing but a pixel of 4 in column 6.
    fn hdr(rows: &[u8]) -> Vec<u8> {
        [b"#?RADIANCE\n# made by hand\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 2 +X 8\n", rows].concat()
    }

    const BRIGHT: [u8; 4] = [128, 64, 32, 130];

    fn check(bytes: &[u8], how: &str) {
        let sky = read(bytes).unwrap();
        let seen = |x: f32, y: f32, z: f32| sky.radiance(tyndall::Vec3::new(x, y, z).normalize());
        // 128 * 2^(130 - 136) = 2, over the exposure of 2; the first channel twice.
        assert_eq!(seen(0.3, 0.5, -1.0), tyndall::Vec3::new(2.0, 0.5, 0.25), "{how}");
        // Column 6 of 8: from 90 to 135 degrees to the right of the middle.
        let around = 112.5_f32.to_radians();
        assert_eq!(seen(around.sin(), -0.2, -around.cos()).x, 8.0, "{how}");
        assert_eq!(seen(-1.0, -0.2, 0.1).x, 0.0, "{how}");
    }

    #[test]
    fn hdr_files_are_read_in_each_way_of_writing_rows() {
        let dark = [0; 4];
        let lone = [128, 128, 128, 132];
        let below: Vec<u8> = (0..8).flat_map(|k| if k == 6 { lone } else { dark }).collect();
        check(&hdr(&[BRIGHT.repeat(8), below.clone()].concat()), "flat");
        let repeated = [&BRIGHT[..], &[1, 1, 1, 7]].concat();
        check(&hdr(&[repeated, below].concat()), "repeated pixels");
        let runs = [2, 2, 0, 8, 136, 128, 136, 64, 136, 32, 136, 130];
        let component = |value: u8| vec![134, 0, 2, value, 0];
        let below = [128, 128, 128, 132].into_iter().flat_map(component);
        check(&hdr(&[&runs[..], &[2, 2, 0, 8], &below.collect::<Vec<_>>()].concat()), "components");
    }

    #[test]
    fn exr_files_are_read_in_single_and_half_precision() {
        let pixel = |x: usize, y: usize| match (x, y) {
            (_, 0) => (1.0_f32, 0.5_f32, 0.25_f32),
            (6, _) => (4.0, 4.0, 4.0),
            _ => (-1e-3, 0.0, 0.0),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.exr");
        exr::prelude::write_rgb_file(&path, 8, 2, pixel).unwrap();
        check(&fs::read(&path).unwrap(), "single");
        let half = |x, y| {
            let (r, g, b) = pixel(x, y);
            [r, g, b].map(exr::prelude::f16::from_f32).into()
        };
        exr::prelude::write_rgb_file(&path, 8, 2, half).unwrap();
        check(&fs::read(&path).unwrap(), "half");
    }

    #[test]
    fn what_is_no_picture_of_the_sky_is_refused() {
        let flat = hdr(&BRIGHT.repeat(16));
        assert!(read(&flat).is_ok());
        let text = String::from_utf8_lossy(&flat[..flat.len() - 64]).into_owned();
        for (bytes, part) in [
            (b"P6 1 1 255 abc".to_vec(), "neither an EXR nor an HDR"),
            (flat[..flat.len() - 1].to_vec(), "ends too early"),
            (text.replace("rgbe", "xyze").into_bytes(), "32-bit_rle_rgbe"),
            (text.replace("-Y 2", "-Y two").into_bytes(), "two counts"),
            (text.replace("-Y 2", "-Z 2").into_bytes(), "-Y HEIGHT"),
            (text.replace("-Y 2", "-Y 999999999").into_bytes(), "2^27"),
            (hdr(&[1, 1, 1, 3]), "begins with a repetition"),
            (hdr(&[2, 2, 0, 8, 137, 1]), "beyond its row"),
            (b"\x76\x2f\x31\x01broken".to_vec(), "sky"),
        ] {
            let error = read(&bytes).unwrap_err();
            assert!(error.code() == "format" && error.to_string().contains(part), "{part}: {error}");
        }
    }
}
