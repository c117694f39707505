//! Answers.

use crate::error::ViewerError;
use serde_json::{Value, json};

/// An answer.
pub(super) struct Reply {
    pub(super) status: &'static str,
    pub(super) kind: &'static str,
    pub(super) body: Vec<u8>,
}

impl Reply {
    pub(super) fn html(body: &str) -> Self {
        Self {
            status: "200 OK",
            kind: "text/html; charset=utf-8",
            body: body.as_bytes().to_vec(),
        }
    }

    /// JSON that is text already.
    pub(super) fn json_text(text: &str) -> Self {
        Self {
            status: "200 OK",
            kind: "application/json",
            body: text.as_bytes().to_vec(),
        }
    }

    pub(super) fn json(status: &'static str, body: &Value) -> Self {
        Self {
            status,
            kind: "application/json",
            body: body.to_string().into_bytes(),
        }
    }
}

/// The answer to a request that is not listened to.
pub(super) fn refused(status: &'static str, problem: &str) -> Reply {
    Reply::json(status, &json!({ "error": problem }))
}

/// The answer to what cannot be done.
pub(super) fn unprocessable(error: &ViewerError) -> Reply {
    refused("422 Unprocessable Content", &error.to_string())
}
