//! Helpers of the tests: comparing what was read from real files with what independent libraries read, and damaging files.

use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use serde_json::Value;
use tyndall::particles::{Attribute, Values};
use tyndall::{Particles, Progress, Result};

use super::{FORMATS, Feed, Format, Index, Open, Request, Span};
use crate::sequence::{Frame, Options};

/// Reads the real file `name` and compares it with what is expected; says so and returns if the files are not there.
pub(crate) fn compare(
    name: &str,
    recognise: impl Fn(&[u8]) -> bool,
    read: impl Fn(&Path, &[u8], &dyn Progress) -> Result<Frame>,
) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let Ok(json) = std::fs::read_to_string(root.join("expected.json")) else {
        println!("skipped {name}: no {}", root.display());
        return;
    };
    let json: Value = serde_json::from_str(&json).unwrap();
    let expected = &json["files"][name]["expected"];
    let path = root.join(name);
    let mut bytes = std::fs::read(&path).unwrap();
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let mut content = Vec::new();
        flate2::read::MultiGzDecoder::new(&bytes[..]).read_to_end(&mut content).unwrap();
        bytes = content;
    }
    assert!(recognise(&bytes[..bytes.len().min(4096)]), "{name} is not recognised");
    let particles = read(&path, &bytes, &()).unwrap().particles;
    if let Err(difference) = differs(&particles, expected) {
        panic!("{name}: {difference}");
    }
    // A comparison must be seen to fail.
    let mut altered = expected.clone();
    altered["bounds"]["max"][1] = Value::from(altered["bounds"]["max"][1].as_f64().unwrap() + 1e-3);
    assert!(differs(&particles, &altered).is_err(), "{name}: an altered value passes");
}

fn differs(particles: &Particles, expected: &Value) -> std::result::Result<(), String> {
    if expected["particles"] != particles.len() {
        return Err(format!("{} particles instead of {}", particles.len(), expected["particles"]));
    }
    let numbers =
        |value: &Value| -> Vec<f64> { value.as_array().unwrap().iter().flat_map(Value::as_f64).collect() };
    let (min, max) = (numbers(&expected["bounds"]["min"]), numbers(&expected["bounds"]["max"]));
    let size = (0..3).map(|axis| max[axis] - min[axis]).fold(0.0, f64::max);
    let close = |what: &str, found: f64, wanted: f64, scale: f64| {
        let near = (found - wanted).abs() <= 1e-5 * scale;
        if near { Ok(()) } else { Err(format!("{what}: {found} instead of {wanted}")) }
    };
    let (bounds, origin) = (particles.bounds(), particles.positions().origin());
    for axis in 0..3 {
        close("least", origin[axis] + f64::from(bounds.min[axis]), min[axis], size)?;
        close("greatest", origin[axis] + f64::from(bounds.max[axis]), max[axis], size)?;
    }
    for (id, values) in [(0, &expected["first"]), (particles.len() - 1, &expected["last"])] {
        for (name, value) in values.as_object().unwrap() {
            let world = particles.positions().world(id).to_array();
            let axis = ["x", "y", "z"].iter().position(|axis| axis == name);
            if let Some(axis) = axis {
                close(name, world[axis], value.as_f64().unwrap(), size)?;
            } else if name.eq_ignore_ascii_case("position") {
                for (found, wanted) in world.into_iter().zip(numbers(value)) {
                    close(name, found, wanted, size)?;
                }
            } else {
                let attribute = particles.attribute(name).ok_or_else(|| format!("no attribute {name}"))?;
                compare_attribute(attribute, id, value)?;
            }
        }
    }
    Ok(())
}

fn compare_attribute(attribute: &Attribute, id: usize, expected: &Value) -> std::result::Result<(), String> {
    let expected = expected.as_array().cloned().unwrap_or_else(|| vec![expected.clone()]);
    if expected.len() != attribute.components {
        return Err(format!("{} has {} components", attribute.name, attribute.components));
    }
    for (component, wanted) in expected.iter().enumerate() {
        let same = match (&attribute.values, wanted.as_f64()) {
            (Values::Text { codes, names }, _) => *wanted == names[codes[id] as usize].as_str(),
            (_, Some(wanted)) => (attribute.number(id, component) - wanted).abs() <= 1e-6 * wanted.abs(),
            _ => false,
        };
        if !same {
            return Err(format!("{} of {id}: {wanted} was wanted", attribute.name));
        }
    }
    Ok(())
}

/// All frames of a file in memory, as its format reads them.
pub(crate) fn frames(open: &Open, bytes: &[u8], options: &Options) -> Result<Vec<Frame>> {
    let path = Path::new("test");
    let read = |index: Index, read: &dyn Fn(Span, &Request) -> Result<Frame>| {
        let one = |span: &Span| {
            read(
                *span,
                &Request {
                    options,
                    bytes: span.bytes,
                    units: index.units.as_deref(),
                    topology: None,
                    others: &(),
                },
            )
        };
        index.frames.iter().map(one).collect()
    };
    match open {
        Open::Whole(whole) => Ok(vec![whole(path, bytes, options.wanted.as_ref(), &())?]),
        Open::Binary { index, frame } => {
            read(index(path, bytes, options)?, &|span, request| frame(path, bytes, span, request, &()))
        }
        Open::Text { index, frame } => read(index(&mut Feed::over(path, bytes))?, &|span, request| {
            let mut feed = Feed::over(path, bytes);
            feed.skip_to(span.offset, span.line, &())?;
            frame(&mut feed, request, &())
        }),
    }
}

/// The one format that recognises these bytes.
pub(crate) fn recognised(bytes: &[u8]) -> &'static Format {
    let path = Path::new("test");
    let known: Vec<_> = FORMATS.iter().filter(|it| (it.recognise)(bytes, path)).collect();
    let titles: Vec<_> = known.iter().map(|it| it.title).collect();
    assert_eq!(known.len(), 1, "{titles:?} recognise it");
    known[0]
}

/// All frames of a file in memory, whose format is recognised.
pub(crate) fn open(bytes: &[u8]) -> Result<Vec<Frame>> {
    frames(&recognised(bytes).open, bytes, &Options::default())
}

/// Calls `read` with a thousand damaged copies of a file, and with all its beginnings; says which one made it panic.
pub(crate) fn damage(file: &[u8], read: impl Fn(&[u8])) {
    damage_at(file, 0..file.len(), 1000, read);
}

/// The same with fewer copies and beginnings, for files that take long to read.
pub(crate) fn damage_some(file: &[u8], read: impl Fn(&[u8])) {
    let step = file.len().div_ceil(200).max(1);
    damage_at(file, (0..file.len()).step_by(step), 400, read);
}

fn damage_at(file: &[u8], lengths: impl IntoIterator<Item = usize>, copies: u64, read: impl Fn(&[u8])) {
    let attempt = |what: String, file: &[u8]| {
        if catch_unwind(AssertUnwindSafe(|| read(file))).is_err() {
            panic!("{what} makes the reader panic");
        }
    };
    for length in lengths {
        attempt(format!("a file cut to {length} bytes"), &file[..length]);
    }
    for seed in 0..copies {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut random = |below: usize| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % below
        };
        let mut damaged = file.to_vec();
        for _ in 0..1 + random(4) {
            let place = random(damaged.len());
            damaged[place] = match random(4) {
                0 => 0xff,
                1 => b'9',
                2 => damaged[place] ^ 1 << random(8),
                _ => random(256) as u8,
            };
        }
        attempt(format!("seed {seed}"), &damaged);
    }
}

/// The words of an attribute, with blanks between.
pub(crate) fn words(particles: &Particles, name: &str) -> String {
    let Values::Text { codes, names } = &particles.attribute(name).unwrap().values else { panic!("{name}") };
    codes.iter().map(|&code| names[code as usize].as_str()).collect::<Vec<_>>().join(" ")
}
