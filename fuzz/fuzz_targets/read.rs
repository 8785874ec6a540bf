//! Every reader, with content that libFuzzer makes up from the samples of the tests.
//!
//! ```text
//! cargo +nightly fuzz run read fuzz/corpus/read crates/tyndall-io/tests/data -- -max_len=65536 -timeout=20 -malloc_limit_mb=1024
//! ```
//! The content decides which format it is, unless `TYNDALL_FORMAT` names one. New finds are kept in the first folder, what fails in
//! `fuzz/artifacts`.
#![no_main]

#[path = "../../crates/tyndall-io/tests/hostile/attempt.rs"]
mod attempt;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;

/// The file that is read, among copies of the samples: lists and sets of files name their neighbors.
static FILE: LazyLock<PathBuf> = LazyLock::new(|| {
    let memory = Path::new("/dev/shm");
    let folder = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
    let folder = folder.join(format!("tyndall-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for the file can be made");
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/tyndall-io/tests/data/samples");
    for sample in std::fs::read_dir(samples).expect("the samples are there").flatten() {
        std::fs::copy(sample.path(), folder.join(sample.file_name())).expect("a sample can be copied");
    }
    folder.join("fuzzed")
});

static FORMAT: LazyLock<Option<String>> = LazyLock::new(|| std::env::var("TYNDALL_FORMAT").ok());

fuzz_target!(|bytes: &[u8]| {
    std::fs::write(&*FILE, bytes).expect("the file can be written");
    let _ = attempt::attempt(&FILE, FORMAT.as_deref());
});
