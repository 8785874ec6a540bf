//! Files that are damaged at random.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::cut::content_bytes;
use crate::files::{Folder, name, samples, shared};
use crate::watch::watched;

/// Numbers that follow from a seed.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// A number below `most`, which must not be 0.
    pub(crate) fn below(&mut self, most: usize) -> usize {
        (self.next() % most as u64) as usize
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 8
    }
}

/// Numbers that readers may take for sizes, counts and places.
const NUMBERS: [u64; 16] = [
    0,
    1,
    2,
    7,
    255,
    256,
    65535,
    65536,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    1 << 32,
    1 << 40,
    i64::MAX as u64,
    1 << 63,
    u64::MAX,
];
/// Words that readers of text may take for numbers.
const WORDS: [&[u8]; 12] = [
    b"-1",
    b"0",
    b"99999999999",
    b"18446744073709551616",
    b"1e999",
    b"-1e308",
    b"nan",
    b"inf",
    b"1e-320",
    b"\n",
    b"<",
    b"\"",
];

/// The file with some damage.
pub(crate) fn damaged(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..1 + random.below(4) {
        if bytes.len() < 2 {
            break;
        }
        // Headers, which stand at the beginning, are where most can go wrong.
        let reach = if random.below(2) == 0 { bytes.len().min(512) } else { bytes.len() };
        let at = random.below(reach);
        let length = (1 + random.below(64)).min(bytes.len() - at);
        match random.below(9) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.next() as u8,
            2 => bytes[at..at + length].fill([0, 0xff][random.below(2)]),
            3 | 4 => {
                let (number, size) = (NUMBERS[random.below(NUMBERS.len())], [2, 4, 8][random.below(3)]);
                let (little, big) = (number.to_le_bytes(), number.to_be_bytes());
                let number = if random.below(2) == 0 { &little[..size] } else { &big[8 - size..] };
                let size = size.min(bytes.len() - at);
                bytes[at..at + size].copy_from_slice(&number[..size]);
            }
            5 => drop(bytes.drain(at..at + length)),
            6 => {
                let copy = bytes[at..at + length].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, copy);
            }
            7 => {
                // The number that stands here as text.
                let is_digit = |it: &u8| it.is_ascii_digit();
                let start = at + bytes[at..].iter().position(is_digit).unwrap_or(0);
                let end = start + bytes[start..].iter().take_while(|it| is_digit(it)).count();
                bytes.splice(start..end, WORDS[random.below(WORDS.len())].iter().copied());
            }
            _ => {
                let other = random.below(bytes.len());
                bytes.swap(at, other);
            }
        }
    }
    bytes
}

/// Damages the files in turn until the time is over; says what was wrong.
fn check(files: &[PathBuf], time: Duration) {
    let number = |name: &str| std::env::var(name).ok().map(|it| it.parse::<u64>().unwrap());
    let time = number("TYNDALL_HOSTILE_SECS").map_or(time, Duration::from_secs);
    let first = number("TYNDALL_HOSTILE_SEED").unwrap_or(1);
    let folder = Folder::with_neighbors(&format!("damage-{}", files.len()), &samples());
    let contents: Vec<Vec<u8>> = files.iter().map(|it| std::fs::read(it).unwrap()).collect();
    let (begin, mut rounds, mut wrong) = (Instant::now(), 0, Vec::new());
    'all: for seed in first.. {
        for (file, bytes) in files.iter().zip(&contents) {
            if begin.elapsed() > time || wrong.len() > 20 {
                break 'all;
            }
            let damaged = damaged(bytes, &mut Random::new(seed));
            let path = folder.file(&name(file), &damaged);
            if let Err(error) = watched(&path, content_bytes(&damaged)) {
                wrong.push(format!("{} with seed {seed}: {error}", name(file)));
                if let Some(kept) = std::env::var_os("TYNDALL_HOSTILE_KEEP") {
                    std::fs::write(PathBuf::from(kept).join(format!("{seed}-{}", name(file))), &damaged)
                        .unwrap();
                }
            }
            std::fs::write(&path, bytes).unwrap();
            rounds += 1;
        }
    }
    println!("{rounds} damaged files, seeds from {first} on, {:?}", begin.elapsed());
    assert!(wrong.is_empty(), "{} faults:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn samples_that_are_damaged_are_refused_or_read() {
    check(&samples(), Duration::from_secs(5));
}

#[test]
fn real_files_that_are_damaged_are_refused_or_read() {
    let files = shared(1 << 20);
    if !files.is_empty() {
        check(&files, Duration::from_secs(5));
    }
}
