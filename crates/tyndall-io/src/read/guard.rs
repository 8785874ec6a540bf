//! Calls into decoders of other crates that assert what damaged data may break: a panic of theirs is an error of the file.
//!
//! The process's panic hook, which would print such a panic, is passed over while a guarded call runs on this thread, and called as before
//! for all others. It is the one global that the readers touch, and only once a guarded decoder is needed.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// What `decode` gives; `None` if it panicked. It must not leave anything behind that is used afterwards, but what it was given to fill.
pub(crate) fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |panic| {
            if !GUARDED.get() {
                usual(panic);
            }
        }));
    });
    let outer = GUARDED.replace(true);
    let result = catch_unwind(AssertUnwindSafe(decode));
    GUARDED.set(outer);
    result.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_none_and_everything_else_passes() {
        let numbers = [1, 2, 3];
        assert_eq!(guarded(|| numbers[1]), Some(2));
        assert_eq!(guarded(|| numbers[numbers.len() + 7 - numbers[0]]), None);
        assert_eq!(guarded(|| (guarded(|| panic!("inside")), 4)), Some((None::<()>, 4)));
        assert!(!GUARDED.get());
    }
}
