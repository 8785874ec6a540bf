//! Binary headers with arbitrary fields: an error or a frame, and no memory beyond what the file can fill.

use crate::damage::Random;
use crate::files::Folder;
use crate::watch::watched;

/// A field of a header.
#[derive(Clone, Copy)]
enum Field {
    /// Bytes that make the format what it is.
    Fixed(&'static [u8]),
    /// A number of so many bytes, which may be anything.
    Number(usize),
    /// A number of so many bytes from a range, where anything would only be refused at once.
    Below(usize, u64),
    /// Words of so many bytes.
    Word(usize),
}
use Field::{Below, Fixed, Number, Word};

/// Formats with the fields of their headers, and in which order of bytes these are.
const HEADERS: [(&str, bool, &[Field]); 14] = [
    (
        "las",
        false,
        &[
            Fixed(b"LASF"),
            Word(20),
            Fixed(&[1]),
            Below(1, 5),
            Word(68),
            Below(2, 400),
            Below(4, 600),
            Below(4, 3),
            Below(1, 140),
            Below(2, 90),
            Number(4),
            Number(20),
            Word(96),
            Number(8),
            Number(8),
            Number(4),
            Number(8),
            Number(8),
        ],
    ),
    (
        "prt",
        false,
        &[
            Fixed(b"\xc0PRT\r\n\x1a\n"),
            Below(4, 80),
            Word(32),
            Below(4, 3),
            Number(8),
            Word(4),
            Below(4, 5),
            Below(4, 60),
            Fixed(b"Position"),
            Word(24),
            Below(4, 12),
            Below(4, 5),
            Below(4, 40),
        ],
    ),
    (
        "mmpld",
        false,
        &[
            Fixed(b"MMPLD\0"),
            Below(2, 105),
            Below(4, 4),
            Word(48),
            Fixed(&[76, 0, 0, 0, 0, 0, 0, 0]),
            Number(8),
            Number(4),
            Below(4, 4),
            Below(1, 5),
            Below(1, 8),
            Number(4),
            Number(8),
        ],
    ),
    (
        "gadget",
        false,
        &[
            Fixed(&[0, 1, 0, 0]),
            Number(4),
            Below(4, 99),
            Number(4),
            Number(4),
            Below(4, 9),
            Number(4),
            Word(48),
            Number(8),
            Number(8),
            Number(4),
            Number(4),
            Number(24),
            Number(4),
            Below(4, 4),
            Number(8),
            Word(120),
            Fixed(&[0, 1, 0, 0]),
            Number(4),
        ],
    ),
    (
        "tipsy",
        true,
        &[Number(8), Below(4, 60), Fixed(&[0, 0, 0, 3]), Below(4, 20), Below(4, 20), Below(4, 20), Number(4)],
    ),
    (
        "dcd",
        false,
        &[
            Fixed(b"\x54\0\0\0CORD"),
            Number(4),
            Number(4),
            Number(4),
            Number(24),
            Number(4),
            Number(4),
            Below(4, 2),
            Number(28),
            Number(4),
            Fixed(b"\x54\0\0\0"),
            Below(4, 90),
            Below(4, 2),
            Word(80),
            Below(4, 90),
            Fixed(&[4, 0, 0, 0]),
            Number(4),
            Fixed(&[4, 0, 0, 0]),
            Number(4),
        ],
    ),
    (
        "xtc",
        true,
        &[
            Fixed(&[0, 0, 7, 203, 0, 0, 0, 40]),
            Number(4),
            Number(4),
            Word(36),
            Fixed(&[0, 0, 0, 40]),
            Number(4),
            Number(12),
            Number(12),
            Below(4, 80),
            Number(4),
        ],
    ),
    (
        "trr",
        true,
        &[
            Fixed(&[0, 0, 7, 201, 0, 0, 0, 13, 0, 0, 0, 12]),
            Fixed(b"GMX_trn_file"),
            Below(4, 2),
            Number(4),
            Number(4),
            Below(4, 80),
            Number(4),
            Number(4),
            Number(4),
            Number(4),
            Number(4),
            Number(4),
            Number(4),
            Number(4),
            Number(4),
            Number(4),
        ],
    ),
    (
        "gsd",
        false,
        &[
            Fixed(&[0xdf, 0x65, 0xdf, 0x65, 0xdf, 0x65, 0xdf, 0x65]),
            Number(8),
            Number(8),
            Number(8),
            Number(8),
            Number(4),
            Number(4),
            Fixed(&[0, 0, 2, 0]),
            Word(64),
            Fixed(b"hoomd"),
            Word(59),
        ],
    ),
    (
        "bgeo",
        true,
        &[
            Fixed(b"BgeoV\0\0\0\x05"),
            Number(4),
            Below(4, 3),
            Number(4),
            Number(4),
            Below(4, 4),
            Number(4),
            Number(4),
            Number(4),
            Below(2, 9),
            Word(6),
            Below(2, 9),
            Below(4, 8),
            Number(4),
        ],
    ),
    (
        "ptc",
        false,
        &[
            Fixed(b"pptc"),
            Below(4, 3),
            Fixed(&[0, 0, 0, 0, 0, 0, 0x24]),
            Below(1, 255),
            Word(24),
            Word(140),
            Below(4, 4),
            Below(4, 9),
            Fixed(b"float mass\n"),
        ],
    ),
    (
        "nc",
        true,
        &[
            Fixed(b"CDF"),
            Below(1, 6),
            Number(4),
            Fixed(&[0, 0, 0, 10]),
            Below(4, 4),
            Below(4, 9),
            Fixed(b"frame\0\0\0"),
            Number(4),
            Fixed(&[0, 0, 0, 4]),
            Fixed(b"atom"),
            Number(4),
            Fixed(&[0, 0, 0, 12]),
            Number(4),
            Number(4),
            Number(4),
        ],
    ),
    (
        "lammps",
        false,
        &[
            Fixed(&[0xf6, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff]),
            Fixed(b"DUMPCUSTOM"),
            Fixed(&[1, 0, 0, 0, 2, 0, 0, 0]),
            Number(8),
            Number(8),
            Below(4, 3),
            Word(24),
            Word(48),
            Below(4, 12),
            Below(4, 9),
            Below(1, 2),
            Below(4, 40),
            Fixed(b"id type x y z"),
            Below(4, 4),
            Number(4),
        ],
    ),
    (
        "e57",
        false,
        &[Fixed(b"ASTM-E57"), Below(4, 2), Below(4, 2), Number(8), Number(8), Number(8), Below(8, 4096)],
    ),
];

/// A header with arbitrary fields, and some bytes behind it.
fn made_up(fields: &[Field], big: bool, random: &mut Random) -> Vec<u8> {
    let mut bytes = Vec::new();
    for field in fields {
        let (size, number) = match *field {
            Fixed(all) => {
                bytes.extend(all);
                continue;
            }
            Word(size) => {
                let kind = random.below(3);
                bytes.extend((0..size).map(|_| if kind == 0 { 0 } else { random.next() as u8 }));
                continue;
            }
            Below(size, most) => (size, random.next() % most),
            Number(size) => (size, random.next() >> random.below(56)),
        };
        let number = if big { number.to_be_bytes() } else { number.to_le_bytes() };
        let number: Vec<u8> = match big {
            true => number.iter().skip(8usize.saturating_sub(size)).copied().collect(),
            false => number.iter().take(size).copied().collect(),
        };
        bytes.extend(&number);
        bytes.resize(bytes.len() + size.saturating_sub(8), random.next() as u8);
    }
    let more = random.below(4000);
    bytes.extend((0..more).map(|_| random.next() as u8));
    bytes
}

#[test]
fn headers_with_arbitrary_fields_are_refused_or_read() {
    let folder = Folder::empty("headers");
    let mut wrong = Vec::new();
    for (name, big, fields) in HEADERS {
        let mut known = 0;
        for seed in 0..300 {
            let bytes = made_up(fields, big, &mut Random::new(seed));
            match watched(&folder.file(name, &bytes), bytes.len()) {
                Ok(outcome) => {
                    known += u32::from(!outcome.is_err_and(|it| it.contains("cannot tell the format")))
                }
                Err(fault) => wrong.push(format!("{name}, seed {seed}: {fault}")),
            }
        }
        // Else the test would pass for want of a reader.
        assert!(known > 1, "of 300 made up files of {name} only {known} are taken for it");
    }
    assert!(wrong.is_empty(), "{} faults:\n{}", wrong.len(), wrong.join("\n"));
}
