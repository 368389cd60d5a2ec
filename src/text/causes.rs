//! Errors as people read them: each with its causes.

use std::error::Error;

/// An error and its causes in one line, outermost first, each behind a colon.
#[must_use]
pub fn with_causes(error: &(dyn Error + 'static)) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(": ");
        text.push_str(&cause.to_string());
        source = cause.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("the port is gone")]
    struct Outer(#[source] io::Error);

    #[test]
    fn causes_follow_the_error_and_none_is_repeated() {
        let inner = io::Error::new(io::ErrorKind::NotConnected, Outer(io::Error::other("unplugged")));
        assert_eq!(with_causes(&Outer(inner)), "the port is gone: the port is gone: unplugged");
        assert_eq!(with_causes(&io::Error::other("full")), "full");
    }
}
