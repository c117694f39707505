//! Decoders that panic on damaged files, as both of them may: turned into errors, with nothing
//! printed.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

thread_local! {
    static DECODING: Cell<bool> = const { Cell::new(false) };
}

/// Runs a decoder; `None` if it panicked.
///
/// The decoders catch most panics themselves, but only after the hook has printed them; so the hook
/// is silenced on a thread that decodes.
pub(super) fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let other = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !DECODING.get() {
                other(info);
            }
        }));
    });
    let before = DECODING.replace(true);
    let outcome = catch_unwind(AssertUnwindSafe(decode)).ok();
    DECODING.set(before);
    outcome
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_none_and_is_forgotten() {
        assert_eq!(guarded(|| 1), Some(1));
        assert_eq!(guarded(|| -> u32 { panic!("on purpose") }), None);
        assert!(!DECODING.get());
    }
}
