//! Watches over attempts: panics, also those that a reader catches, time and memory.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::Duration;

use crate::attempt::{Seen, attempt};
use crate::memory;

/// An attempt that takes longer hangs; none of these files takes a second.
const MOST_TIME: Duration = Duration::from_secs(20);
/// Memory that any attempt may have.
const FREE_BYTES: usize = 24 << 20;
/// Bytes in memory for one of the content: a digit and a blank may become a place of three coordinates, twice.
const MOST_GROWTH: usize = 64;

/// The name of the thread in which attempts are made; those of the pool have none.
const THREAD: &str = "attempt";

/// Panics since the last attempt began.
static PANICS: Mutex<Vec<String>> = Mutex::new(Vec::new());
/// Attempts are made one at a time, as panics and memory belong to the whole process.
static WATCH: LazyLock<Mutex<Watch>> = LazyLock::new(|| Mutex::new(Watch::new()));

/// What came of an attempt.
pub(crate) type Outcome = std::result::Result<Vec<Seen>, String>;

type Answer = (Result<Outcome, Box<dyn Any + Send>>, usize);

struct Watch {
    ask: Sender<PathBuf>,
    answer: Receiver<Answer>,
}

impl Watch {
    fn new() -> Self {
        let usual = take_hook();
        set_hook(Box::new(move |panic| match std::thread::current().name() {
            Some(name) if name != THREAD => usual(panic),
            _ => PANICS.lock().unwrap_or_else(PoisonError::into_inner).push(panic.to_string()),
        }));
        Self::start()
    }

    fn start() -> Self {
        let (ask, asked) = channel::<PathBuf>();
        let (tell, answer) = channel();
        let work = move || {
            for path in asked {
                let before = memory::watch();
                let outcome = catch_unwind(AssertUnwindSafe(|| attempt(&path, None)));
                let bytes = memory::most().saturating_sub(before);
                if tell.send((outcome, bytes)).is_err() {
                    return;
                }
            }
        };
        std::thread::Builder::new().name(THREAD.to_string()).spawn(work).unwrap();
        Self { ask, answer }
    }
}

/// Makes an attempt on a file whose content, unpacked, has so many bytes; says what was wrong with the reader.
pub(crate) fn watched(path: &Path, content_bytes: usize) -> std::result::Result<Outcome, String> {
    let mut watch = WATCH.lock().unwrap_or_else(PoisonError::into_inner);
    let panics = || std::mem::take(&mut *PANICS.lock().unwrap_or_else(PoisonError::into_inner)).join("; ");
    watch.ask.send(path.to_path_buf()).unwrap();
    let (outcome, bytes) = watch.answer.recv_timeout(MOST_TIME).map_err(|error| {
        // The thread is left to itself; the next attempt has another.
        *watch = Watch::start();
        match error {
            RecvTimeoutError::Timeout => format!("it takes more than {MOST_TIME:?}"),
            RecvTimeoutError::Disconnected => format!("it ended its thread: {}", panics()),
        }
    })?;
    let panics = panics();
    if outcome.is_err() || !panics.is_empty() {
        return Err(format!("it panics: {panics}"));
    }
    let most = FREE_BYTES + MOST_GROWTH * content_bytes;
    if bytes > most {
        return Err(format!("it takes {bytes} bytes of memory for {content_bytes}, more than {most}"));
    }
    outcome.map_err(|_| "it panics".to_string())
}

#[test]
fn the_watch_sees_memory() {
    let folder = crate::files::Folder::empty("watch");
    // A million lines of three digits are 6 MB, more than none of which anybody has to keep.
    let path = folder.file("table.csv", &b"1 2 3\n".repeat(1 << 20));
    assert!(watched(&path, 6 << 20).unwrap().is_ok());
    let memory = {
        let _alone = WATCH.lock().unwrap_or_else(PoisonError::into_inner);
        let before = memory::watch();
        drop(vec![1u8; 100 << 20]);
        memory::most() - before
    };
    assert!(memory >= 100 << 20, "{memory}");
}
