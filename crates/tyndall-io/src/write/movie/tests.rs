use std::io::Cursor;
use std::path::Path;

use rusty_h264_decoder::Decoder;
use shiguredo_mp4::boxes::SampleEntry;
use shiguredo_mp4::demux::{Input, Mp4FileDemuxer};
use tyndall::srgb::linear_from_encoded;
use tyndall::{Error, Image};

use super::super::tests::Folder;
use super::*;

/// A picture of straight sRGB colors, of which `place` gives that of a pixel.
fn image([width, height]: [u32; 2], place: impl Fn(u32, u32) -> [u8; 4]) -> Image {
    let pixel = |at: u32| {
        let [red, green, blue, alpha] = place(at % width, at / width).map(|it| f32::from(it) / 255.0);
        let light = [red, green, blue].map(|it| linear_from_encoded(it) * alpha);
        [light[0], light[1], light[2], alpha]
    };
    let pixels = (width * height) as usize;
    Image {
        width,
        height,
        color: (0..width * height).map(pixel).collect(),
        depth: vec![1.0; pixels],
        id: vec![0; pixels],
    }
}

/// Soft colors with a hard edge that moves by picture.
fn moving(size: [u32; 2], number: u32) -> impl Fn(u32, u32) -> [u8; 4] {
    move |x, y| match x >= 8 + 4 * number && x < 24 + 4 * number && y >= 6 && y < size[1] / 2 {
        true => [200, 40, 30, 255],
        false => [(x * 255 / size[0]) as u8, 120, (y * 255 / size[1]) as u8, 255],
    }
}

fn options(rate: f64, encoder: Encoder) -> MovieOptions {
    let metadata = vec![
        ("Software".to_string(), "Tyndall 0.1".to_string()),
        ("Command".to_string(), "render <a> & 'b' 粒子".to_string()),
    ];
    MovieOptions { frames_per_second: rate, encoder, metadata }
}

fn write(path: &Path, size: [u32; 2], count: u32, options: &MovieOptions) {
    let mut movie = Movie::create(path, size, options).unwrap();
    for number in 0..count {
        movie.add(&image(size, moving(size, number))).unwrap();
    }
    movie.finish().unwrap();
}

/// A sample of an MP4: whether it stands for itself, when it is shown, for how long, its bytes.
type Shown = (bool, u64, u32, Vec<u8>);

/// The entry of an MP4 and what it shows.
fn demuxed(bytes: &[u8]) -> (SampleEntry, u32, Vec<Shown>) {
    let mut demuxer = Mp4FileDemuxer::new();
    demuxer.handle_input(Input { position: 0, data: bytes });
    let timescale = demuxer.tracks().unwrap()[0].timescale.get();
    let (mut entry, mut samples) = (None, Vec::new());
    while let Some(sample) = demuxer.next_sample().unwrap() {
        entry = entry.or(sample.sample_entry.cloned());
        let at = sample.data_offset as usize;
        let data = bytes[at..at + sample.data_size].to_vec();
        samples.push((sample.keyframe, sample.timestamp, sample.duration, data));
    }
    (entry.unwrap(), timescale, samples)
}

/// Root of the mean square difference between what was given and what is shown of the pictures.
fn error_of_mp4(bytes: &[u8], size: [u32; 2]) -> (usize, f64) {
    let (entry, _, samples) = demuxed(bytes);
    let SampleEntry::Avc1(entry) = entry else { panic!("H.264") };
    let mut stream = Vec::new();
    for unit in entry.avcc_box.sps_list.iter().chain(&entry.avcc_box.pps_list) {
        stream.extend([0, 0, 0, 1]);
        stream.extend(unit);
    }
    for (.., data) in &samples {
        let mut left = &data[..];
        while let Some((length, rest)) = left.split_first_chunk::<4>() {
            let (unit, rest) = rest.split_at(u32::from_be_bytes(*length) as usize);
            stream.extend([0, 0, 0, 1]);
            stream.extend(unit);
            left = rest;
        }
    }
    let frames = Decoder::new().decode_stream(&stream).unwrap();
    let [width, height] = size.map(|it| it as usize);
    let mut sum = 0.0;
    for (number, frame) in frames.iter().enumerate() {
        assert_eq!((frame.width, frame.height), (width, height));
        for at in 0..width * height {
            let (x, y) = (at % width, at / width);
            let chroma = y / 2 * (width / 2) + x / 2;
            let level = |value: u8, zero: f64| (f64::from(value) - zero) * 255.0;
            let luma = level(frame.y[at], 16.0) / 219.0;
            let [blue, red] = [frame.u[chroma], frame.v[chroma]].map(|it| level(it, 128.0) / 224.0);
            let rgb = [luma + 1.5748 * red, luma - 0.1873 * blue - 0.4681 * red, luma + 1.8556 * blue];
            let wanted = moving(size, number as u32)(x as u32, y as u32);
            sum += rgb
                .iter()
                .zip(wanted)
                .map(|(found, wanted)| (found - f64::from(wanted)).powi(2))
                .sum::<f64>();
        }
    }
    (frames.len(), (sum / (3 * width * height * frames.len().max(1)) as f64).sqrt())
}

#[test]
fn an_mp4_shows_the_pictures_at_their_times() {
    let folder = Folder::new("movie-mp4");
    let path = folder.0.join("a.mp4");
    // No multiples of the blocks that are coded.
    let size = [106, 58];
    write(&path, size, 60, &options(29.97, Encoder::BuiltIn));
    let bytes = fs::read(&path).unwrap();
    let (entry, timescale, samples) = demuxed(&bytes);
    assert!(
        matches!(&entry, SampleEntry::Avc1(entry) if entry.visual.width == 106 && entry.visual.height == 58)
    );
    assert_eq!(samples.len(), 60);
    assert!(samples[0].0 && samples.iter().filter(|sample| sample.0).count() < 4);
    for (number, (_, time, ..)) in samples.iter().enumerate() {
        assert!((*time as f64 / f64::from(timescale) - number as f64 / 29.97).abs() < 1e-4);
    }
    let (count, error) = error_of_mp4(&bytes, size);
    // Most of it lies at the edge, where colors are those of two by two pixels.
    assert!(count == 60 && error < 6.0, "{count} pictures, error {error}");
    let xmp = String::from_utf8_lossy(&bytes);
    assert!(xmp.contains("Command: render &lt;a&gt; &amp; &apos;b&apos; 粒子"));
    assert_eq!(folder.names(), ["a.mp4"]);
}

#[test]
fn flat_colors_come_back_from_an_mp4() {
    let folder = Folder::new("movie-flat");
    let path = folder.0.join("a.mp4");
    for color in [[0, 0, 0], [255, 255, 255], [255, 0, 0], [0, 255, 0], [0, 0, 255], [68, 1, 84]] {
        let [red, green, blue] = color;
        let mut movie = Movie::create(&path, [32, 32], &options(10.0, Encoder::BuiltIn)).unwrap();
        movie.add(&image([32, 32], |_, _| [red, green, blue, 255])).unwrap();
        movie.finish().unwrap();
        let bytes = fs::read(&path).unwrap();
        let (entry, _, samples) = demuxed(&bytes);
        let SampleEntry::Avc1(entry) = entry else { panic!("H.264") };
        let mut stream = Vec::new();
        let mut units = vec![&entry.avcc_box.sps_list[0][..], &entry.avcc_box.pps_list[0]];
        units.push(&samples[0].3[4..]);
        units.iter().for_each(|unit| stream.extend([&[0, 0, 0, 1], *unit].concat()));
        let frame = &Decoder::new().decode_stream(&stream).unwrap()[0];
        let at = |value: u8, zero: f64, range: f64| (f64::from(value) - zero) / range;
        let (luma, cb, cr) =
            (at(frame.y[500], 16.0, 219.0), at(frame.u[100], 128.0, 224.0), at(frame.v[100], 128.0, 224.0));
        let found = [luma + 1.5748 * cr, luma - 0.1873 * cb - 0.4681 * cr, luma + 1.8556 * cb];
        for (found, wanted) in found.iter().zip(color) {
            assert!((255.0 * found - f64::from(wanted)).abs() < 3.0, "{color:?}: {found}");
        }
    }
}

#[test]
fn ffmpeg_is_used_where_it_is_found() {
    let folder = Folder::new("movie-ffmpeg");
    let path = folder.0.join("a.mp4");
    let (size, asked) = ([64, 48], options(25.0, Encoder::Ffmpeg));
    if ffmpeg::has_x264() {
        let automatic = Movie::create(&path, size, &options(25.0, Encoder::Automatic)).unwrap();
        assert_eq!(automatic.encoder(), "ffmpeg, libx264");
        drop(automatic);
        write(&path, size, 30, &asked);
        let bytes = fs::read(&path).unwrap();
        let (_, timescale, samples) = demuxed(&bytes);
        let lasts: u64 = samples.iter().map(|sample| u64::from(sample.2)).sum();
        assert_eq!((samples.len(), lasts as f64 / f64::from(timescale)), (30, 1.2));
        assert!(String::from_utf8_lossy(&bytes).contains("Software: Tyndall 0.1"));
    } else {
        let automatic = Movie::create(&path, size, &options(25.0, Encoder::Automatic)).unwrap();
        assert_eq!(automatic.encoder(), "built in");
        assert!(matches!(Movie::create(&path, size, &asked), Err(Error::Setting { .. })));
    }
    drop(folder);
}

#[test]
fn a_gif_shows_the_pictures_at_their_times() {
    let folder = Folder::new("movie-gif");
    let path = folder.0.join("a.gif");
    let size = [161, 120];
    write(&path, size, 9, &options(24.0, Encoder::Automatic));
    let mut decoder = ::gif::DecodeOptions::new();
    decoder.set_color_output(::gif::ColorOutput::RGBA);
    let mut decoder = decoder.read_info(fs::File::open(&path).unwrap()).unwrap();
    assert_eq!((decoder.width(), decoder.height()), (161, 120));
    let (mut count, mut hundredths, mut sum) = (0, 0, 0);
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        hundredths += u32::from(frame.delay);
        let wanted = moving(size, count);
        for (at, found) in frame.buffer.chunks(4).enumerate() {
            let wanted = wanted(at as u32 % size[0], at as u32 / size[0]);
            sum += found.iter().zip(wanted).map(|(a, b)| u32::from(a.abs_diff(b))).sum::<u32>();
        }
        count += 1;
    }
    assert_eq!((count, hundredths), (9, 38));
    // Two ramps have more colors than a picture can.
    let mean = f64::from(sum) / f64::from(4 * 161 * 120 * count);
    assert!(mean < 4.0, "{mean}");
    assert_eq!(decoder.repeat(), ::gif::Repeat::Infinite);
    let bytes = fs::read(&path).unwrap();
    assert!(String::from_utf8_lossy(&bytes).contains("Software: Tyndall 0.1"));
}

#[test]
fn an_animated_webp_has_every_pixel_and_alpha() {
    let folder = Folder::new("movie-webp");
    let path = folder.0.join("a.webp");
    let size = [33, 20];
    let see_through = |number: u32| {
        move |x: u32, y: u32| {
            let [red, green, blue, _] = moving(size, number)(x, y);
            [red, green, blue, if x < 3 { 0 } else { 255 - (x * 7) as u8 }]
        }
    };
    let mut movie = Movie::create(&path, size, &options(30.0, Encoder::Automatic)).unwrap();
    (0..6).for_each(|number| movie.add(&image(size, see_through(number))).unwrap());
    movie.finish().unwrap();
    let bytes = fs::read(&path).unwrap();
    let mut decoder = image_webp::WebPDecoder::new(Cursor::new(&bytes)).unwrap();
    assert!(decoder.is_animated() && decoder.has_alpha());
    assert_eq!((decoder.dimensions(), decoder.num_frames()), ((33, 20), 6));
    assert_eq!(decoder.loop_count(), image_webp::LoopCount::Forever);
    assert!(String::from_utf8(decoder.xmp_metadata().unwrap().unwrap()).unwrap().contains("Tyndall 0.1"));
    let mut pixels = vec![0; decoder.output_buffer_size().unwrap()];
    let mut lasts = 0;
    for number in 0..6 {
        lasts += decoder.read_frame(&mut pixels).unwrap();
        for (at, found) in pixels.chunks(4).enumerate() {
            let wanted = see_through(number)(at as u32 % size[0], at as u32 / size[0]);
            let wanted = if wanted[3] == 0 { [0; 4] } else { wanted };
            let error = found.iter().zip(wanted).map(|(a, b)| a.abs_diff(b)).max().unwrap();
            assert!(error <= 1, "{found:?} for {wanted:?}");
        }
    }
    assert_eq!(lasts, 200);
}

#[test]
fn what_cannot_be_is_refused_before_the_work() {
    let folder = Folder::new("movie-refused");
    let refused = |name: &str, size, is_opaque, rate| {
        let options = options(rate, Encoder::BuiltIn);
        let error = check(&folder.0.join(name), size, is_opaque, &options).unwrap_err().to_string();
        let created = Movie::create(&folder.0.join(name), size, &options).map(|_| ());
        assert!(!is_opaque || created.unwrap_err().to_string() == error);
        assert!(folder.names().is_empty());
        error
    };
    assert!(refused("a.mp4", [15, 10], true, 24.0).contains("even"));
    assert!(refused("a.mp4", [20, 10], false, 24.0).contains("no transparency"));
    assert!(refused("a.gif", [20, 10], false, 24.0).contains("no transparency"));
    assert!(refused("a.mp4", [16_000, 16_000], true, 24.0).contains("no level of H.264"));
    assert!(refused("a.gif", [70_000, 10], true, 24.0).contains("65535"));
    assert!(refused("a.gif", [0, 10], true, 24.0).contains("0x10"));
    assert!(refused("a.gif", [10, 10], true, 60.0).contains("at most 50"));
    for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(refused("a.webp", [10, 10], true, rate).contains("--fps"));
    }
    assert!(refused("a.avi", [10, 10], true, 24.0).contains(".mp4 .gif .webp"));
    assert!(refused("none/a.mp4", [10, 10], true, 24.0).contains("folder"));
    check(&folder.0.join("a.WEBP"), [10, 11], false, &options(24.0, Encoder::BuiltIn)).unwrap();
    assert_eq!(size(Path::new("a.mp4"), [15, 10]), [16, 10]);
    assert_eq!(size(Path::new("a.gif"), [15, 10]), [15, 10]);

    let size = [10, 10];
    let mut movie = Movie::create(&folder.0.join("a.mp4"), size, &options(24.0, Encoder::BuiltIn)).unwrap();
    let error = movie.add(&image(size, |_, _| [9, 9, 9, 100])).unwrap_err().to_string();
    assert!(error.contains("no transparency"), "{error}");
    drop(movie);
    assert!(folder.names().is_empty(), "a movie that is not finished leaves nothing");
}

#[test]
fn levels_are_those_of_the_standard() {
    assert_eq!(h264::level([640, 480], 30.0), Some(30));
    assert_eq!(h264::level([1280, 720], 30.0), Some(31));
    assert_eq!(h264::level([1920, 1080], 30.0), Some(40));
    assert_eq!(h264::level([1920, 1080], 60.0), Some(42));
    assert_eq!(h264::level([3840, 2160], 30.0), Some(51));
    assert_eq!(h264::level([3840, 2160], 60.0), Some(52));
    assert_eq!(h264::level([7680, 4320], 30.0), Some(60));
    // Too wide for the number of its macroblocks.
    assert_eq!(h264::level([4096, 16], 24.0), Some(40));
    assert_eq!(h264::level([4112, 16], 24.0), Some(42));
    assert_eq!(h264::level([16_384, 16_384], 1.0), None);
}
