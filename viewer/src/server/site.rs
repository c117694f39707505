//! Sites that a server serves.

use super::reply::Reply;
use super::request::Request;
use std::fmt::Debug;
use std::time::Duration;

/// Longest wait for a change before a page has to ask again.
pub(super) const LONGEST_WAIT: Duration = Duration::from_secs(20);

/// The places below the token of a server.
pub(super) trait Site: Debug + Send + Sync {
    /// The answer at one of them.
    fn answer(&self, request: &Request, place: &str) -> Reply;

    /// Works beside the answers until it is stopped.
    fn work(&self);

    /// Ends the work, and answers that wait for a change.
    fn stop(&self);
}
