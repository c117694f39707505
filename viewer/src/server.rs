//! A server of one page for browsers of this machine.
//!
//! It knows these places, all below a token that nobody can guess, and no file of the disk but the
//! stills it has made:
//!
//! | place | |
//! |---|---|
//! | `GET /TOKEN/` | the page |
//! | `GET /TOKEN/state?after=N` | the state of the edit, as soon as its revision is not N |
//! | `GET /TOKEN/scene?id=N` | the scene that is shown, packed, if it is still N |
//! | `GET /TOKEN/still?index=N` | a path-traced picture |
//! | `POST /TOKEN/act` | an act, as JSON |
//! | `POST /TOKEN/select` | which Gaussians a selector selects |
//! | `POST /TOKEN/light` | `"stop"` or `"bake"`, of the light after an edit |
//! | `POST /TOKEN/still` | a picture to be made |
//!
//! That of a [`Training`] has less, and changes nothing.
//!
//! Requests have to name the address of the server as their host: a page of another site that has
//! its name point here is refused. Requests are small, and have some seconds to arrive.

mod board;
mod editor;
mod places;
mod reply;
mod request;
mod site;
mod training;
mod work;

#[cfg(test)]
mod tests;

pub use editor::Served;
pub use training::Training;

use crate::error::{Result, ViewerError};
use editor::Editor;
use reply::{Reply, refused};
use request::{Refused, Request};
use site::Site;
use std::io::Write;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use training::Watched;

/// Most connections at once: each page waits with one for a change.
const MAX_CONNECTIONS: usize = 64;
/// Time for a request to arrive, and for an answer to leave.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often it is looked whether to stop.
const STOP_INTERVAL: Duration = Duration::from_millis(50);

/// The sources that a page may load from and connect to: itself.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
    img-src 'self' data: blob:; worker-src blob:; connect-src 'self'; base-uri 'none'; \
    form-action 'none'; frame-ancestors 'none'";

/// Longest time for answers under way when a server stops.
const LAST_ANSWERS: Duration = Duration::from_secs(3);

/// A server that listens.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    token: String,
    site: Arc<dyn Site>,
    num_connections: Arc<AtomicUsize>,
}

impl Server {
    /// Listens at `address` for pages that show `served.page` and act on `served.edit`; port 0 is
    /// any that is free.
    ///
    /// # Errors
    /// [`ViewerError::Address`] if it cannot listen there, [`ViewerError::Token`] if the system has
    /// no random numbers, [`ViewerError::Unfit`] if a scene that was edited before cannot be
    /// packed.
    pub fn bind(address: SocketAddr, served: Served) -> Result<Self> {
        Self::over(listen(address)?, Arc::new(Editor::new(served)?))
    }

    /// Takes a listener for pages that show `page` and watch `training`.
    ///
    /// # Errors
    /// [`ViewerError::Token`] if the system has no random numbers.
    pub fn watching(listener: TcpListener, page: String, training: &Arc<Training>) -> Result<Self> {
        let training = Arc::clone(training);
        Self::over(listener, Arc::new(Watched { page, training }))
    }

    fn over(listener: TcpListener, site: Arc<dyn Site>) -> Result<Self> {
        let address = listener.local_addr().map_err(|error| {
            let address = SocketAddr::from(([0, 0, 0, 0], 0));
            ViewerError::Address { address, error }
        })?;
        Ok(Self {
            address,
            listener,
            token: token()?,
            site,
            num_connections: Arc::default(),
        })
    }

    /// Address of the page, token included.
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// Serves until `stop` is set, and ends a job that is under way.
    ///
    /// # Errors
    /// [`ViewerError::Address`] if it cannot listen any longer.
    pub fn run(&self, stop: &AtomicBool) -> Result<()> {
        let ended = std::thread::scope(|scope| {
            scope.spawn(|| self.site.work());
            let ended = self.listen(stop);
            self.site.stop();
            ended
        });
        let end = Instant::now() + LAST_ANSWERS;
        while self.num_connections.load(Ordering::Relaxed) > 0 && Instant::now() < end {
            std::thread::sleep(STOP_INTERVAL);
        }
        ended
    }

    fn listen(&self, stop: &AtomicBool) -> Result<()> {
        while !stop.load(Ordering::Relaxed) {
            match self.listener.accept() {
                Ok((stream, _)) => self.take(stream),
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {
                    std::thread::sleep(STOP_INTERVAL);
                }
                // A client that went before it was heard is no fault of the server.
                Err(error) if error.kind() == std::io::ErrorKind::ConnectionAborted => {}
                Err(error) => {
                    let address = self.address;
                    return Err(ViewerError::Address { address, error });
                }
            }
        }
        Ok(())
    }

    /// Answers a connection in a thread of its own, unless there are too many.
    fn take(&self, stream: TcpStream) {
        let (site, num) = (Arc::clone(&self.site), Arc::clone(&self.num_connections));
        if num.fetch_add(1, Ordering::Relaxed) >= MAX_CONNECTIONS {
            num.fetch_sub(1, Ordering::Relaxed);
            return;
        }
        let (token, address) = (self.token.clone(), self.address);
        std::thread::spawn(move || {
            // Who hangs up needs no answer.
            if let Err(error) = serve(stream, site.as_ref(), &token, address) {
                tracing::debug!("connection: {error}");
            }
            num.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

/// Listens at `address`; port 0 is any that is free.
///
/// # Errors
/// [`ViewerError::Address`] if it cannot.
pub fn listen(address: SocketAddr) -> Result<TcpListener> {
    let failed = |error| ViewerError::Address { address, error };
    let listener = TcpListener::bind(address).map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    Ok(listener)
}

/// 128 random bits as text.
fn token() -> Result<String> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes).map_err(|e| ViewerError::Token(e.to_string()))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

fn serve(
    mut stream: TcpStream,
    site: &dyn Site,
    token: &str,
    address: SocketAddr,
) -> std::io::Result<()> {
    // Some systems hand the listener's mode on.
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let reply = match request::read(&mut stream) {
        Ok(request) => answer(&request, site, token, address),
        Err(Refused { status, problem }) => refused(status, problem),
    };
    let head = format!(
        "HTTP/1.1 {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\n\
         Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n\
         Referrer-Policy: no-referrer\r\nContent-Security-Policy: {POLICY}\r\n\r\n",
        reply.status,
        reply.kind,
        reply.body.len(),
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(&reply.body)?;
    stream.flush()
}

fn answer(request: &Request, site: &dyn Site, token: &str, address: SocketAddr) -> Reply {
    let is_host = |host: &str| is_host(host, address);
    if !request.host.as_deref().is_some_and(is_host) {
        return refused("403 Forbidden", "the host is not this server's");
    }
    // Scripts of other sites say where they come from.
    let is_ours = |origin: &str| origin.strip_prefix("http://").is_some_and(is_host);
    if !request.origin.as_deref().is_none_or(is_ours) {
        return refused("403 Forbidden", "the request comes from another site");
    }
    let place = request
        .path
        .strip_prefix('/')
        .and_then(|path| path.split_once('/'));
    let Some((_, place)) = place.filter(|(given, _)| is_same(given, token)) else {
        return refused("403 Forbidden", "the token is not this server's");
    };
    site.answer(request, place)
}

/// Whether a host is this server's. A name is never that of a machine of a network: only who has a
/// name's DNS knows where it will point.
fn is_host(host: &str, address: SocketAddr) -> bool {
    let port = address.port();
    let given: Option<SocketAddr> = host.parse().ok();
    if address.ip().is_loopback() {
        return given == Some(address) || host == format!("localhost:{port}");
    }
    given.is_some_and(|given| given.port() == port)
}

/// Compares in a time that does not tell how much is the same.
fn is_same(given: &str, token: &str) -> bool {
    let pairs = given.bytes().zip(token.bytes());
    given.len() == token.len() && pairs.fold(0, |all, (a, b)| all | (a ^ b)) == 0
}
