//! Formats that are known but not read: each is named, with a way out.
//!
//! Takes the first bytes of a file, gives the error. What is read is asked first, so nothing here shadows a reader.

use std::path::Path;

use tyndall::Error;

use super::whole_lines;

/// Point clouds.
const POINTS: &str = "convert it to PLY or CSV, for example with PDAL or CloudCompare";
/// Tools of visual effects.
const EFFECTS: &str = "export the points as PLY, or as classic .bgeo";
/// ParaView.
const PARAVIEW: &str = "open it in ParaView and save the points as PLY or CSV";

struct Known {
    name: &'static str,
    is: fn(&[u8]) -> bool,
    way_out: &'static str,
}

/// Each format that has a recognisable beginning.
const KNOWN: &[Known] = &[
    Known { name: "HDF5", is: is_hdf5, way_out: "read it with h5py and save the columns with numpy.savez" },
    Known {
        name: "MMTF",
        is: |head| matches!(head.first(), Some(0x80..=0x8f | 0xde | 0xdf)) && head_has(head, b"mmtf"),
        way_out: "download the entry as BinaryCIF or mmCIF, which replaced it",
    },
    Known {
        name: "Gadget binary",
        is: is_gadget,
        way_out: "read it with pynbody or yt and save the columns with numpy.savez",
    },
    Known {
        name: "TIPSY",
        is: is_tipsy,
        way_out: "read it with pynbody and save the columns with numpy.savez",
    },
    Known { name: "XDMF", is: |head| head_has(head, b"<Xdmf"), way_out: PARAVIEW },
    Known {
        name: "Krakatoa PRT 2 or SPRT",
        is: super::prt::is_later,
        way_out: "save it as PRT 1 in Krakatoa or Stoke, or export the points as PLY",
    },
    Known {
        name: "MegaMol MMSPD",
        is: |head| head.starts_with(b"MMSPD"),
        way_out: "save it as MMPLD with MegaMol",
    },
    Known { name: "LAS or LAZ", is: |head| head.starts_with(b"LASF"), way_out: POINTS },
    Known { name: "E57", is: |head| head.starts_with(b"ASTM-E57"), way_out: POINTS },
    Known { name: "PCD", is: is_pcd, way_out: POINTS },
    Known {
        name: "PTS",
        is: is_pts,
        way_out: "delete the first line and read the rest with --columns x,y,z,…",
    },
    Known { name: "Houdini JSON geometry (since version 12)", is: is_houdini_json, way_out: EFFECTS },
    Known { name: "Houdini blosc (.sc)", is: |head| head.starts_with(b"scf1"), way_out: EFFECTS },
    Known { name: "Alembic", is: |head| head.starts_with(b"Ogawa"), way_out: EFFECTS },
    Known {
        name: "USD",
        is: |head| head.starts_with(b"PXR-USDC") || head.starts_with(b"#usda"),
        way_out: EFFECTS,
    },
    Known {
        name: "OpenVDB",
        is: |head| head.starts_with(b" BDV"),
        way_out: "give the particles, not the grid",
    },
    Known {
        name: "Parquet",
        is: |head| head.starts_with(b"PAR1"),
        way_out: "save it as CSV, or with numpy.savez",
    },
    Known {
        name: "Arrow",
        is: |head| head.starts_with(b"ARROW1"),
        way_out: "save it as CSV, or with numpy.savez",
    },
    Known {
        name: "bzip2",
        is: |head| head.starts_with(b"BZh"),
        way_out: "unpack it, or pack it with gzip or zstd",
    },
    Known {
        name: "xz",
        is: |head| head.starts_with(b"\xfd7zXZ\0"),
        way_out: "unpack it, or pack it with gzip or zstd",
    },
    Known {
        name: "LZ4",
        is: |head| head.starts_with(b"\x04\x22\x4d\x18"),
        way_out: "unpack it, or pack it with gzip or zstd",
    },
];

/// The error about `path`, if its first bytes are those of a known format.
pub(crate) fn explain(path: &Path, head: &[u8]) -> Option<Error> {
    let known = KNOWN.iter().find(|it| (it.is)(head))?;
    let what = format!("this is a file of the format {}, which this version does not read yet", known.name);
    Some(Error::format(path, "", what, known.way_out))
}

fn be_u32(head: &[u8], at: usize) -> Option<u32> {
    let bytes = head.get(at..at + 4)?;
    Some(u32::from_be_bytes(bytes.try_into().expect("four bytes")))
}

fn le_u32(head: &[u8], at: usize) -> Option<u32> {
    be_u32(head, at).map(u32::swap_bytes)
}

fn head_has(head: &[u8], word: &[u8]) -> bool {
    memchr::memmem::find(&head[..head.len().min(1024)], word).is_some()
}

fn is_hdf5(head: &[u8]) -> bool {
    // A user block of a power of two may stand before it.
    [0, 512, 1024, 2048, 4096]
        .iter()
        .any(|&at| head.get(at..).is_some_and(|it| it.starts_with(b"\x89HDF\r\n\x1a\n")))
}

fn is_gadget(head: &[u8]) -> bool {
    let record = |length: u32, at: usize| {
        [le_u32, be_u32].iter().any(|read| {
            read(head, at) == Some(length) && read(head, at + 4 + length as usize) == Some(length)
        })
    };
    record(256, 0) || (record(8, 0) && head.get(4..8) == Some(b"HEAD"))
}

fn is_tipsy(head: &[u8]) -> bool {
    let header = |read: fn(&[u8], usize) -> Option<u32>| -> Option<bool> {
        let [all, dimensions] = [read(head, 8)?, read(head, 12)?];
        let parts = [read(head, 16)?, read(head, 20)?, read(head, 24)?].map(u64::from);
        Some(all > 0 && dimensions == 3 && parts.iter().sum::<u64>() == u64::from(all))
    };
    header(be_u32) == Some(true) || header(le_u32) == Some(true)
}

fn is_pcd(head: &[u8]) -> bool {
    head.starts_with(b"# .PCD") || (head.starts_with(b"VERSION") && head_has(head, b"\nFIELDS"))
}

/// A count, then rows of numbers without a comment between.
fn is_pts(head: &[u8]) -> bool {
    let mut lines = whole_lines(head);
    let numbers = |line: Option<&[u8]>| -> Option<usize> {
        let tokens: Vec<_> =
            line?.split(|byte| byte.is_ascii_whitespace()).filter(|it| !it.is_empty()).collect();
        let all = tokens.iter().all(|it| fast_float2::parse::<f64, _>(it).is_ok());
        all.then_some(tokens.len())
    };
    let counts = [numbers(lines.next()), numbers(lines.next()), numbers(lines.next())];
    counts[0] == Some(1) && counts[1].is_some_and(|count| count >= 3) && counts[1] == counts[2]
}

fn is_houdini_json(head: &[u8]) -> bool {
    head.starts_with(b"\x7fNSJb") || (head.starts_with(b"[") && head_has(head, b"\"fileversion\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(head: &[u8]) -> String {
        explain(Path::new("file"), head).map_or_else(String::new, |error| error.to_string())
    }

    #[test]
    fn known_beginnings_are_named_with_a_way_out() {
        let gadget = [&256u32.to_le_bytes()[..], &[0; 256], &256u32.to_le_bytes()].concat();
        let cases: [(&[u8], &str); 5] = [
            (b"\x89HDF\r\n\x1a\n", "HDF5"),
            (&gadget, "Gadget"),
            (b"5\n0 0 0 9\n1 0 0 9\n", "PTS"),
            (b"\xc0PRT2\r\n\x1a", "PRT 2"),
            (b"[\n\t\"fileversion\",\"18\"", "Houdini JSON"),
        ];
        for (head, name) in cases {
            let message = named(head);
            assert!(message.contains(name) && message.contains("does not read yet"), "{name}: {message}");
        }
    }

    #[test]
    fn plain_rows_are_nothing_known() {
        for head in [&b"1 2 3 4 5\n1 2 3 4 5\n"[..], b"", b"\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0"] {
            assert_eq!(named(head), "");
        }
    }
}
