//! Ctrl-C: what is finished stays whole, nothing else stays.
#![cfg(unix)]

use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use flate2::Compression;
use flate2::write::GzEncoder;

use super::{Folder, Ran, png};

fn spawn(folder: &Folder, line: &str) -> Child {
    let words: Vec<&str> = line.split(' ').collect();
    folder.command(&words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Sends the signal of Ctrl-C, and waits for the end.
fn interrupt(child: Child) -> Ran {
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    Ran::of(child.wait_with_output().unwrap())
}

fn wait_until(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < Duration::from_secs(60), "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn finished_pictures_stay_whole_when_interrupted() {
    let folder = Folder::new();
    let child = spawn(
        &folder,
        "render synthetic:uniform?n=1000 -o o.%06d.png --orbit 360 --frame-count 1000000 --size 64x64 --samples 1 -q",
    );
    wait_until("pictures", || folder.names().len() > 2);
    let ran = interrupt(child);
    assert_eq!(ran.code, 130, "{ran:?}");
    let names = folder.names();
    assert_eq!(ran.err, format!("interrupted: {} of 1000000 pictures written\n", names.len()));
    for (number, name) in names.iter().enumerate() {
        assert_eq!(*name, format!("o.{number:06}.png"));
        assert!(!png(&folder.path(name)).0.is_empty());
    }
}

#[test]
fn an_unfinished_picture_leaves_nothing() {
    let folder = Folder::new();
    let child = spawn(
        &folder,
        "render synthetic:uniform?n=1000 -o o.png --size 2000x2000 --samples 1000000 --threads 1 -v",
    );
    // Long enough to be at work, whatever it is at.
    std::thread::sleep(Duration::from_millis(400));
    let ran = interrupt(child);
    assert_eq!(ran.code, 130, "{ran:?}");
    assert!(ran.err.ends_with("interrupted: 0 of 1 pictures written\n"), "{ran:?}");
    assert!(folder.names().is_empty(), "{:?}", folder.names());
}

fn gzip(text: &str) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(text.as_bytes()).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn opening_a_long_compressed_file_can_be_interrupted() {
    let folder = Folder::new();
    // 16 GiB of rows, packed to 16 MB; their count is never reached, so that whoever opens this to its end fails otherwise.
    let rows = gzip(&"Cu 1.0 2.0 3.0\n".repeat(1 << 22));
    folder.file("a.xyz.gz", [gzip("1000000000000\n\n"), rows.repeat(280)].concat());
    for line in ["info a.xyz.gz", "render a.xyz.gz -o o.png --device cpu"] {
        let child = spawn(&folder, line);
        // Long enough to be at work: opening needs many seconds.
        std::thread::sleep(Duration::from_millis(400));
        let ran = interrupt(child);
        assert_eq!((ran.code, ran.err.as_str()), (130, "interrupted: nothing written\n"), "{line}");
    }
    assert_eq!(folder.names(), ["a.xyz.gz"]);
}
