//! Helpers of this crate's tests.

/// Asserts that an error prints as one line with all of `parts` in it.
#[track_caller]
pub(crate) fn assert_error<T>(outcome: crate::Result<T>, parts: &[&str]) {
    let Err(error) = outcome else {
        panic!("not refused, without {parts:?}");
    };
    let message = error.to_string();
    assert!(!message.contains('\n'), "more than one line: {message}");
    for part in parts {
        assert!(message.contains(part), "no `{part}` in: {message}");
    }
}
