//! Formats that are known but not read: each is named, with a way out.
//!
//! Takes the first bytes of a file, gives the error. What is read is asked first, so nothing here shadows a reader.

use std::path::Path;

use tyndall::Error;

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
    #[cfg(not(feature = "hdf5"))]
    Known { name: "HDF5", is: is_hdf5, way_out: "build with the feature hdf5, which reads it" },
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
    Known { name: "Houdini JSON geometry (since version 12)", is: is_houdini_json, way_out: EFFECTS },
    Known { name: "Houdini blosc (.sc)", is: |head| head.starts_with(b"scf1"), way_out: EFFECTS },
    Known { name: "Alembic", is: |head| head.starts_with(b"Ogawa"), way_out: EFFECTS },
    Known {
        name: "binary USD",
        is: |head| head.starts_with(b"PXR-USDC"),
        way_out: "convert it: usdcat IN -o OUT.usda",
    },
    #[cfg(not(feature = "parquet"))]
    Known {
        name: "Parquet",
        is: |head| head.starts_with(b"PAR1"),
        way_out: "build with the feature parquet, which reads it, or save it as CSV or with numpy.savez",
    },
    #[cfg(not(feature = "parquet"))]
    Known {
        name: "Arrow",
        is: |head| head.starts_with(b"ARROW1"),
        way_out: "build with the feature parquet, which reads it, or save it as CSV or with numpy.savez",
    },
    Known {
        name: "Parquet with an encrypted footer",
        is: |head| head.starts_with(b"PARE"),
        way_out: "write it without encryption",
    },
    Known {
        name: "Feather 1",
        is: |head| head.starts_with(b"FEA1"),
        way_out: "write it again as Feather 2 or Parquet: pandas.read_feather, then to_feather",
    },
    Known {
        name: "text in UTF-16",
        is: |head| matches!(head, [0xff, 0xfe, _, 0, ..] | [0xfe, 0xff, 0, _, ..]),
        way_out: "save it as UTF-8: iconv -f UTF-16 -t UTF-8 IN > OUT",
    },
    Known {
        name: "text whose lines end with CR alone",
        is: |head| super::is_text(head) && head.contains(&b'\r') && !head.contains(&b'\n'),
        way_out: "end them with LF: tr '\\r' '\\n' < IN > OUT",
    },
    Known {
        name: "LZ4",
        is: |head| head.starts_with(b"\x04\x22\x4d\x18"),
        way_out: "unpack it, or pack it with gzip, zstd, bzip2 or xz",
    },
];

/// The error about `path`, if its first bytes are those of a known format.
pub(crate) fn explain(path: &Path, head: &[u8]) -> Option<Error> {
    let known = KNOWN.iter().find(|it| (it.is)(head))?;
    let what = format!("this is a file of the format {}, which this version does not read yet", known.name);
    Some(Error::format(path, "", what, known.way_out))
}

fn head_has(head: &[u8], word: &[u8]) -> bool {
    memchr::memmem::find(&head[..head.len().min(1024)], word).is_some()
}

/// Whether HDF5 begins here.
pub(super) fn is_hdf5(head: &[u8]) -> bool {
    // A user block of a power of two may stand before it.
    [0, 512, 1024, 2048, 4096]
        .iter()
        .any(|&at| head.get(at..).is_some_and(|it| it.starts_with(b"\x89HDF\r\n\x1a\n")))
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
        let cases: [(&[u8], &str); 9] = [
            (b"\xff\xfex\0,\0y\0\n\0", "UTF-16"),
            (b"x,y,z\r1,2,3\r", "CR alone"),
            (b"FEA1\0\0\0\0", "Feather 1"),
            (b"PARE", "encrypted"),
            (b"PXR-USDC\0", "usdcat"),
            (b"Ogawa\xff\0", "Alembic"),
            (b"<?xml version=\"1.0\"?>\n<Xdmf>", "XDMF"),
            (b"\xc0PRT2\r\n\x1a", "PRT 2"),
            (b"[\n\t\"fileversion\",\"18\"", "Houdini JSON"),
        ];
        for (head, name) in cases {
            let message = named(head);
            assert!(message.contains(name) && message.contains("does not read yet"), "{name}: {message}");
        }
    }

    #[cfg(not(feature = "parquet"))]
    #[test]
    fn what_another_build_reads_says_which() {
        for (head, name) in [(&b"PAR1\x15\x04"[..], "Parquet"), (b"ARROW1\0\0", "Arrow")] {
            let message = named(head);
            assert!(message.contains(name) && message.contains("the feature parquet"), "{message}");
        }
    }

    #[test]
    fn plain_rows_are_nothing_known() {
        for head in [&b"1 2 3 4 5\n1 2 3 4 5\n"[..], b"", b"\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0"] {
            assert_eq!(named(head), "");
        }
    }
}
