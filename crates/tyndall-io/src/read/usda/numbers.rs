//! Arrays of USD's text form: numbers in brackets and parentheses, words in quotes.

use rayon::prelude::*;
use tyndall::particles::Values;

use crate::read::rows::shortened;

/// The values of a quantity.
pub(super) type Column = Values;

/// Bytes that a thread reads at a time.
const PIECE: usize = 1 << 20;

/// How many numbers an element of an array of this type has; `None` if it has none that are read.
pub(super) fn width(kind: &str) -> Option<usize> {
    let kind = kind.strip_suffix("[]")?;
    Some(match kind {
        "float" | "double" | "half" | "int" | "uint" | "int64" | "uint64" | "uchar" | "bool" | "string"
        | "token" => 1,
        "float2" | "double2" | "half2" | "int2" | "texCoord2f" | "texCoord2d" | "texCoord2h" => 2,
        "float3" | "double3" | "half3" | "int3" | "texCoord3f" | "texCoord3d" | "texCoord3h" => 3,
        "float4" | "double4" | "half4" | "int4" | "quatf" | "quatd" | "quath" => 4,
        "color4f" | "color4d" | "color4h" => 4,
        "matrix2d" => 4,
        "matrix3d" => 9,
        "matrix4d" => 16,
        _ => {
            let roles = ["point3", "vector3", "normal3", "color3"];
            let is_role = roles.iter().any(|role| {
                kind.strip_prefix(role).is_some_and(|precision| matches!(precision, "f" | "d" | "h"))
            });
            is_role.then_some(3)?
        }
    })
}

/// Whether values of this type may be no whole numbers.
pub(super) fn is_measured(kind: &str) -> bool {
    !matches!(sort(kind), Sort::Int | Sort::Long | Sort::Word)
}

enum Sort {
    Single,
    Double,
    Int,
    Long,
    Word,
}

fn sort(kind: &str) -> Sort {
    let kind = kind.trim_end_matches("[]");
    match kind {
        "string" | "token" => Sort::Word,
        "int64" | "uint64" | "uint" => Sort::Long,
        "bool" | "uchar" => Sort::Int,
        _ if kind.starts_with("int") => Sort::Int,
        _ if kind.starts_with("double") || kind.starts_with("matrix") || kind.ends_with('d') => Sort::Double,
        _ => Sort::Single,
    }
}

/// The values of an array of type `kind`, all its components one after the other.
pub(super) fn values(kind: &str, text: &[u8]) -> Result<Values, String> {
    Ok(match sort(kind) {
        Sort::Single => Values::F32(all(text, |rest| fast_float2::parse_partial::<f32, _>(rest).ok())?),
        Sort::Double => Values::F64(all(text, |rest| fast_float2::parse_partial::<f64, _>(rest).ok())?),
        Sort::Int => Values::I32(all(text, |rest| {
            let (value, taken) = integer(rest)?;
            Some((i32::try_from(value).ok()?, taken))
        })?),
        Sort::Long => Values::I64(all(text, integer)?),
        Sort::Word => words(text)?,
    })
}

fn is_between(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n' | b',' | b'(' | b')' | b'[' | b']')
}

/// All numbers, read by all threads.
fn all<T: Send>(text: &[u8], parse: impl Fn(&[u8]) -> Option<(T, usize)> + Sync) -> Result<Vec<T>, String> {
    let read = |piece: &&[u8]| {
        let (mut values, mut rest) = (Vec::with_capacity(piece.len() / 8), *piece);
        loop {
            let blank = rest.iter().take_while(|it| is_between(**it)).count();
            rest = &rest[blank..];
            if rest.is_empty() {
                return Ok(values);
            }
            let (value, taken) = parse(rest)
                .filter(|it| rest.get(it.1).is_none_or(|&next| is_between(next)))
                .ok_or_else(|| format!("wanted a number, found '{}'", shortened(word(rest))))?;
            values.push(value);
            rest = &rest[taken..];
        }
    };
    let mut parts = pieces(text).par_iter().map(read).collect::<Result<Vec<Vec<T>>, String>>()?;
    Ok(if parts.len() == 1 { parts.remove(0) } else { parts.into_iter().flatten().collect() })
}

fn word(rest: &[u8]) -> &[u8] {
    &rest[..rest.iter().position(|&it| is_between(it)).unwrap_or(rest.len())]
}

/// Cuts behind commas.
fn pieces(text: &[u8]) -> Vec<&[u8]> {
    let (mut pieces, mut rest) = (Vec::new(), text);
    while rest.len() > PIECE {
        let end = memchr::memchr(b',', &rest[PIECE..]).map_or(rest.len(), |place| PIECE + place + 1);
        let (piece, tail) = rest.split_at(end);
        pieces.push(piece);
        rest = tail;
    }
    pieces.push(rest);
    pieces
}

/// A whole number, or a truth value.
fn integer(rest: &[u8]) -> Option<(i64, usize)> {
    for (word, value) in [(&b"true"[..], 1), (b"false", 0)] {
        if rest.starts_with(word) {
            return Some((value, word.len()));
        }
    }
    let end =
        rest.iter().position(|&it| !it.is_ascii_digit() && !matches!(it, b'-' | b'+')).unwrap_or(rest.len());
    let word = std::str::from_utf8(&rest[..end]).ok()?;
    Some((word.parse().ok()?, end))
}

/// Words in quotes.
fn words(text: &[u8]) -> Result<Values, String> {
    let (mut codes, mut names) = (Vec::new(), Vec::<String>::new());
    let mut known = std::collections::HashMap::<Vec<u8>, u32>::new();
    let mut rest = text;
    loop {
        let blank = rest.iter().take_while(|it| is_between(**it)).count();
        rest = &rest[blank..];
        let Some(&quote) = rest.first() else { return Ok(Values::Text { codes, names }) };
        if !matches!(quote, b'"' | b'\'') {
            return Err(format!("wanted a word in quotes, found '{}'", shortened(word(rest))));
        }
        let (mut inside, mut at) = (Vec::new(), 1);
        loop {
            match rest.get(at) {
                Some(b'\\') => {
                    inside.extend(rest.get(at + 1));
                    at += 2;
                }
                Some(byte) if *byte == quote => break,
                Some(byte) => {
                    inside.push(*byte);
                    at += 1;
                }
                None => return Err("a word has no closing quote".to_string()),
            }
        }
        rest = &rest[at + 1..];
        let next = names.len() as u32;
        let code = *known.entry(inside).or_insert_with_key(|name| {
            names.push(String::from_utf8_lossy(name).into_owned());
            next
        });
        codes.push(code);
    }
}

/// Makes a column of the items of another.
fn picked(column: &Values, items: impl Iterator<Item = usize> + Clone) -> Values {
    match column {
        Values::F32(all) => Values::F32(items.map(|it| all[it]).collect()),
        Values::F64(all) => Values::F64(items.map(|it| all[it]).collect()),
        Values::I32(all) => Values::I32(items.map(|it| all[it]).collect()),
        Values::I64(all) => Values::I64(items.map(|it| all[it]).collect()),
        Values::U8(all) => Values::U8(items.map(|it| all[it]).collect()),
        Values::Text { codes, names } => {
            Values::Text { codes: items.map(|it| codes[it]).collect(), names: names.clone() }
        }
        Values::Frozen(_) => unreachable!("what is read is not frozen"),
    }
}

/// The elements of `components` values each at `places`.
pub(super) fn gathered(column: &Values, components: usize, places: &Values) -> Result<Values, String> {
    let count = column.len() / components;
    let Values::I32(places) = places else { unreachable!("indices are integers") };
    if let Some(place) = places.iter().find(|it| !usize::try_from(**it).is_ok_and(|it| it < count)) {
        return Err(format!("the index {place} is none of {count} elements"));
    }
    let items = places.iter().flat_map(|&place| {
        let first = place as usize * components;
        first..first + components
    });
    Ok(picked(column, items))
}

/// The same values `count` times.
pub(super) fn repeated(column: &Values, count: usize) -> Values {
    picked(column, (0..column.len() * count).map(|it| it % column.len()))
}

/// The columns of several clouds of so many points each, one behind the other. Where a cloud has none, numbers are NaN and words empty.
pub(super) fn joined(mut parts: Vec<Option<Values>>, counts: &[usize], components: usize) -> Values {
    if let [Some(_)] = parts[..]
        && let Some(Some(values)) = parts.pop()
    {
        return values;
    }
    let is_words = parts.iter().flatten().any(|it| matches!(it, Values::Text { .. }));
    if is_words {
        let (mut codes, mut names) = (Vec::new(), Vec::<String>::new());
        let mut code = |name: &str| match names.iter().position(|it| it == name) {
            Some(place) => place as u32,
            None => {
                names.push(name.to_string());
                names.len() as u32 - 1
            }
        };
        for (part, count) in parts.iter().zip(counts) {
            match part {
                Some(Values::Text { codes: own, names }) => {
                    let new: Vec<u32> = names.iter().map(|it| code(it)).collect();
                    codes.extend(own.iter().map(|&it| new[it as usize]));
                }
                _ => codes.extend(std::iter::repeat_n(code(""), count * components)),
            }
        }
        return Values::Text { codes, names };
    }
    macro_rules! alike {
        ($($kind:ident),*) => {
            $(if parts.iter().all(|it| matches!(it, Some(Values::$kind(_)))) {
                let values = parts.into_iter().flatten().flat_map(|it| match it {
                    Values::$kind(values) => values,
                    _ => Vec::new(),
                });
                return Values::$kind(values.collect());
            })*
        };
    }
    alike!(F32, F64, I32, I64);
    let numbers = parts.iter().zip(counts).flat_map(|(part, count)| {
        (0..count * components).map(move |place| part.as_ref().map_or(f64::NAN, |it| it.number(place)))
    });
    match parts.iter().flatten().all(|it| matches!(it, Values::F32(_))) {
        true => Values::F32(numbers.map(|it| it as f32).collect()),
        false => Values::F64(numbers.collect()),
    }
}
