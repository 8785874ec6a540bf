//! The binary as its users meet it: pictures, numbers, words and exit codes.
#![allow(clippy::unwrap_used, reason = "helpers of tests, in which a panic is the failure")]

mod annotations;
mod bench;
mod bonds;
mod build;
mod convert;
mod cut;
mod device;
mod errors;
mod given;
mod illustrations;
mod info;
mod layers;
mod looks;
mod medium;
mod outputs;
mod periodic;
mod pictures;
mod project;
mod scenes;
mod shapes;
mod stages;
mod stop;

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// A folder that is gone after the test, in which the command runs.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file and gives its name.
    fn file<'a>(&self, name: &'a str, content: impl AsRef<[u8]>) -> &'a str {
        std::fs::write(self.path(name), content).unwrap();
        name
    }

    /// The names of all files, hidden ones too.
    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tyndall"));
        command.current_dir(self.0.path()).args(words.iter().map(OsStr::new));
        command
    }

    fn run(&self, words: &[&str]) -> Ran {
        Ran::of(self.command(words).output().unwrap())
    }

    /// Runs with words separated by blanks.
    fn line(&self, line: &str) -> Ran {
        self.run(&line.split_whitespace().collect::<Vec<_>>())
    }

    /// Renders a small picture, with more words.
    fn render(&self, line: &str) -> Ran {
        self.line(&format!("render --size 48x32 --samples 4 {line}"))
    }
}

/// What came of a run.
#[derive(Debug)]
struct Ran {
    code: i32,
    out: String,
    err: String,
}

impl Ran {
    fn of(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Self { code: output.status.code().unwrap(), out: text(output.stdout), err: text(output.stderr) }
    }

    /// Succeeded; what was said.
    #[track_caller]
    fn fine(self) -> String {
        assert_eq!(self.code, 0, "{self:?}");
        self.err
    }

    /// Failed with this code and one line that has these parts.
    #[track_caller]
    fn fails(&self, code: i32, parts: &[&str]) {
        assert_eq!(self.code, code, "{self:?}");
        let errors: Vec<&str> = self.err.lines().filter(|line| line.starts_with("error[E-")).collect();
        assert_eq!(errors.len(), 1, "one line says why: {self:?}");
        for part in parts {
            assert!(errors[0].contains(part), "'{part}' is not in: {}", errors[0]);
        }
    }
}

/// Extended XYZ of particles on a line along x, with `c_pe` from 0 upwards.
fn line_of(count: usize) -> String {
    let mut text = format!("{count}\nProperties=species:S:1:pos:R:3:c_pe:R:1\n");
    for id in 0..count {
        writeln!(text, "Cu {id}.0 0.25 -0.5 {id}.5").unwrap();
    }
    text
}

/// A LAMMPS dump of particles inside a cell of that size.
fn dump(columns: &str, cell: f64, rows: &[&str]) -> String {
    let side = format!("0 {cell}\n");
    format!(
        "ITEM: TIMESTEP\n100\nITEM: NUMBER OF ATOMS\n{}\nITEM: BOX BOUNDS pp pp pp\n{side}{side}{side}ITEM: ATOMS {columns}\n{}\n",
        rows.len(),
        rows.join("\n")
    )
}

/// The pixels of a PNG and what is written beside them.
fn png(path: &Path) -> (Vec<u8>, png::ColorType, Vec<(String, String)>) {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    reader.finish().unwrap();
    let info = reader.info();
    let mut texts: Vec<(String, String)> =
        info.uncompressed_latin1_text.iter().map(|it| (it.keyword.clone(), it.text.clone())).collect();
    texts.extend(info.utf8_text.iter().map(|it| (it.keyword.clone(), it.get_text().unwrap())));
    (pixels, info.color_type, texts)
}
