//! Requests, read with limits.

use super::reply::{Reply, refused};
use std::io::{ErrorKind, Read};
use std::str::FromStr;
use std::time::{Duration, Instant};

/// Most bytes of the lines before a body.
const MAX_HEAD: usize = 16 * 1024;
/// Most lines of these.
const MAX_LINES: usize = 64;
/// Most bytes of a body.
const MAX_BODY: usize = 64 * 1024;
/// Time for all of a request, also for one that comes byte by byte.
const LONGEST: Duration = Duration::from_secs(20);

/// A request that arrived whole.
#[derive(Debug, PartialEq)]
pub(super) struct Request {
    pub(super) method: String,
    pub(super) path: String,
    /// Behind the question mark.
    pub(super) query: String,
    pub(super) host: Option<String>,
    pub(super) origin: Option<String>,
    pub(super) body: Vec<u8>,
}

impl Request {
    /// The number that the query gives `name`; `None` where there is no query.
    ///
    /// # Errors
    /// The refusal of a query that says something else.
    pub(super) fn number<T: FromStr>(&self, name: &str) -> Result<Option<T>, Reply> {
        if self.query.is_empty() {
            return Ok(None);
        }
        let value = self.query.strip_prefix(name);
        let value = value.and_then(|rest| rest.strip_prefix('=')?.parse().ok());
        let problem = || refused("400 Bad Request", &format!("the query is not {name}=N"));
        value.map(Some).ok_or_else(problem)
    }
}

/// A request that is not listened to.
#[derive(Debug, PartialEq)]
pub(super) struct Refused {
    pub(super) status: &'static str,
    pub(super) problem: &'static str,
}

const BROKEN: Refused = Refused {
    status: "400 Bad Request",
    problem: "this is no request of HTTP/1.1",
};
const LATE: Refused = Refused {
    status: "408 Request Timeout",
    problem: "the request did not arrive in time",
};
const LARGE_HEAD: Refused = Refused {
    status: "431 Request Header Fields Too Large",
    problem: "too many lines, or too long",
};
const LARGE_BODY: Refused = Refused {
    status: "413 Content Too Large",
    problem: "the body is larger than an act is",
};

/// Reads a request.
///
/// # Errors
/// [`Refused`] if it is broken, too large or too slow.
pub(super) fn read(stream: &mut impl Read) -> Result<Request, Refused> {
    let end = Instant::now() + LONGEST;
    let mut bytes = Vec::new();
    let (mut request, head_len, body_len) = loop {
        if bytes.len() > MAX_HEAD {
            return Err(LARGE_HEAD);
        }
        receive(stream, &mut bytes, end)?;
        if let Some(parsed) = parse_head(&bytes)? {
            break parsed;
        }
    };
    while bytes.len() < head_len + body_len {
        receive(stream, &mut bytes, end)?;
    }
    request.body = bytes[head_len..head_len + body_len].to_vec();
    Ok(request)
}

fn receive(stream: &mut impl Read, bytes: &mut Vec<u8>, end: Instant) -> Result<(), Refused> {
    if Instant::now() > end {
        return Err(LATE);
    }
    let mut piece = [0; 4096];
    match stream.read(&mut piece) {
        Ok(0) => Err(BROKEN),
        Ok(num) => {
            bytes.extend_from_slice(&piece[..num]);
            Ok(())
        }
        Err(error) if error.kind() == ErrorKind::Interrupted => Ok(()),
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
            Err(LATE)
        }
        Err(_) => Err(BROKEN),
    }
}

/// The request without its body, and the lengths of head and body; `None` as long as it is not
/// complete.
fn parse_head(bytes: &[u8]) -> Result<Option<(Request, usize, usize)>, Refused> {
    let mut lines = [httparse::EMPTY_HEADER; MAX_LINES];
    let mut head = httparse::Request::new(&mut lines);
    let head_len = match head.parse(bytes) {
        Ok(httparse::Status::Complete(length)) => length,
        Ok(httparse::Status::Partial) => return Ok(None),
        Err(httparse::Error::TooManyHeaders) => return Err(LARGE_HEAD),
        Err(_) => return Err(BROKEN),
    };
    if head_len > MAX_HEAD {
        return Err(LARGE_HEAD);
    }
    let value_of = |name: &str| {
        let mut values = head
            .headers
            .iter()
            .filter(|line| line.name.eq_ignore_ascii_case(name));
        match (values.next(), values.next()) {
            (None, _) => Ok(None),
            (Some(line), None) => match std::str::from_utf8(line.value) {
                Ok(value) => Ok(Some(value.trim().to_owned())),
                Err(_) => Err(BROKEN),
            },
            // Two hosts or lengths are an attempt to be read in two ways.
            _ => Err(BROKEN),
        }
    };
    if value_of("transfer-encoding")?.is_some() {
        return Err(BROKEN);
    }
    let body_len = match value_of("content-length")? {
        None => 0,
        Some(text) => text.parse::<u64>().map_err(|_| BROKEN)?,
    };
    if body_len > MAX_BODY as u64 {
        return Err(LARGE_BODY);
    }
    let (Some(method), Some(target)) = (head.method, head.path) else {
        return Err(BROKEN);
    };
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let request = Request {
        method: method.to_owned(),
        path: path.to_owned(),
        query: query.to_owned(),
        host: value_of("host")?,
        origin: value_of("origin")?,
        body: Vec::new(),
    };
    Ok(Some((request, head_len, body_len as usize)))
}
