mod edits;

use super::*;
use crate::live::Edit;
use crate::pack::Pack;
use crate::testing::lit_cloud;
use crate::workshop::Workshop;
use eagpt_scene::dataset::{SplitRule, Subset};
use eagpt_trace::Device;
use eagpt_train::bake::gaussians::GaussianBake;
use eagpt_train::bake::{BakeMethod, BakeOptions};
use serde_json::Value;
use std::io::Read;
use std::thread::JoinHandle;
use tempfile::TempDir;

/// A server under test, which stops when this goes.
struct Running {
    address: SocketAddr,
    token: String,
    dir: TempDir,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<()>>>,
}

impl Running {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let original = lit_cloud(&["ceiling-1"]);
        let pack = Pack::new(&original.gaussians, &original.lamps, None).unwrap();
        let served = Served {
            page: "the page".to_owned(),
            order: pack.order,
            edit: Edit::open(&dir.path().join("edit.toml"), original).unwrap(),
            workshop: Workshop {
                device: Device::Cpu,
                cameras: None,
                options: BakeOptions {
                    method: BakeMethod::Gaussians(GaussianBake {
                        num_samples: Some(1),
                    }),
                    max_bounces: 1,
                    seed: 0,
                    split: SplitRule::default(),
                    subset: Subset::All,
                },
                stills: dir.path().join("stills"),
            },
        };
        let any = SocketAddr::from(([127, 0, 0, 1], 0));
        let server = Server::bind(any, served).unwrap();
        let (address, token) = (server.address, server.token.clone());
        assert_eq!(server.url(), format!("http://{address}/{token}/"));
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let thread = Some(std::thread::spawn(move || server.run(&flag)));
        Self {
            address,
            token,
            dir,
            stop,
            thread,
        }
    }

    /// Sends bytes as they are; the whole answer.
    fn send(&self, bytes: &[u8]) -> String {
        let mut stream = TcpStream::connect(self.address).unwrap();
        // The server may answer and hang up before it has read all of a huge request.
        let _sent = stream.write_all(bytes).is_ok();
        let mut answer = Vec::new();
        let _read = stream.read_to_end(&mut answer).is_ok();
        String::from_utf8_lossy(&answer).into_owned()
    }

    fn request(&self, method: &str, place: &str, host: &str, more: &str, body: &str) -> String {
        let length = body.len();
        self.send(
            format!("{method} {place} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\n{more}\r\n{body}")
                .as_bytes(),
        )
    }

    fn own(&self, method: &str, place: &str, body: &str) -> String {
        let path = format!("/{}/{place}", self.token);
        self.request(method, &path, &self.address.to_string(), "", body)
    }

    fn told(&self, method: &str, place: &str, body: &str) -> Value {
        let answer = self.own(method, place, body);
        serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap()
    }

    fn act(&self, body: &str) -> Value {
        self.told("POST", "act", body)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap().unwrap();
    }
}

#[track_caller]
fn is(answer: &str, status: &str) {
    let first = answer.lines().next().unwrap_or("nothing");
    assert!(first.starts_with(&format!("HTTP/1.1 {status} ")), "{first}");
}

#[test]
fn the_page_is_there_for_those_who_know_the_token() {
    let server = Running::new();
    let answer = server.own("GET", "", "");
    is(&answer, "200");
    assert!(answer.ends_with("\r\n\r\nthe page"), "{answer}");
    assert!(answer.contains("Content-Security-Policy: default-src 'none'"));
    assert_eq!(server.token.len(), 32);
    assert_ne!(server.token, Running::new().token);
}

#[test]
fn strangers_are_refused() {
    let server = Running::new();
    let (host, token) = (server.address.to_string(), server.token.clone());
    let get = |path: &str, host: &str, more: &str| server.request("GET", path, host, more, "");
    let page = format!("/{token}/");
    // Another name of this address, as a site would have after a change of its DNS.
    is(&get(&page, "example.org", ""), "403");
    is(
        &get(&page, &format!("example.org:{}", server.address.port()), ""),
        "403",
    );
    is(
        &server.send(format!("GET {page} HTTP/1.1\r\n\r\n").as_bytes()),
        "403",
    );
    is(&get(&page, &host, "Origin: http://example.org\r\n"), "403");
    is(&get(&page, &host, "Origin: null\r\n"), "403");
    is(
        &get(&page, &host, &format!("Origin: http://{host}\r\n")),
        "200",
    );
    for path in [
        "/",
        "//",
        "/x/",
        "/state",
        &format!("/{}/", &token[1..]),
        &format!("/{token}"),
    ] {
        is(&get(path, &host, ""), "403");
    }
    for place in [
        "../edit.toml",
        "../../etc/passwd",
        "%2e%2e/edit.toml",
        "edit.toml",
        "/",
    ] {
        is(&server.own("GET", place, ""), "404");
    }
    is(&get(&format!("/../{token}/"), &host, ""), "403");
    is(&server.own("DELETE", "act", ""), "405");
    is(&server.own("POST", "", "{}"), "405");
}

#[test]
fn a_host_is_an_address_and_never_a_name_of_others() {
    let at = |text: &str| text.parse::<SocketAddr>().unwrap();
    let (local, open) = (at("127.0.0.1:80"), at("0.0.0.0:80"));
    assert!(is_host("127.0.0.1:80", local) && is_host("localhost:80", local));
    for host in [
        "127.0.0.1",
        "127.0.0.1:81",
        "localhost",
        "example.org:80",
        "192.168.0.2:80",
    ] {
        assert!(!is_host(host, local), "{host}");
    }
    assert!(is_host("192.168.0.2:80", open) && is_host("[::1]:80", at("[::1]:80")));
    assert!(!is_host("example.org:80", open) && !is_host("192.168.0.2:81", open));
}

#[test]
fn broken_and_huge_requests_are_refused() {
    let server = Running::new();
    let long = "x".repeat(40_000);
    is(&server.send(b"\x00\x01\x02\r\n\r\n"), "400");
    is(&server.send(b"GET\r\n\r\n"), "400");
    is(
        &server.request("GET", &format!("/{long}"), "h", "", ""),
        "431",
    );
    is(
        &server.request("GET", "/", "h", &"A: b\r\n".repeat(100), ""),
        "431",
    );
    is(
        &server.request("GET", "/", "h", "Host: other\r\n", ""),
        "400",
    );
    is(
        &server.request("POST", "/", "h", "Transfer-Encoding: chunked\r\n", ""),
        "400",
    );
    is(
        &server.send(b"POST / HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n"),
        "413",
    );
    is(
        &server.send(b"POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n"),
        "400",
    );
    is(&server.own("POST", "act", &"[".repeat(60_000)), "400");
    is(&server.own("POST", "act", "{\"set-light\":{}}"), "400");
    is(&server.own("POST", "act", "\"remove-everything\""), "400");
    is(&server.own("GET", "state?after=x", ""), "400");
    is(&server.own("GET", "", ""), "200");
    assert!(!server.dir.path().join("edit.toml").exists());
}

#[test]
fn two_pages_agree() {
    let server = Running::new();
    // One waits while the other acts.
    let (address, token) = (server.address, server.token.clone());
    let waiting = std::thread::spawn(move || {
        let mut stream = TcpStream::connect(address).unwrap();
        let request = format!("GET /{token}/state?after=0 HTTP/1.1\r\nHost: {address}\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        serde_json::from_str::<Value>(answer.split_once("\r\n\r\n").unwrap().1).unwrap()
    });
    let act = r#"{"set-light":{"name":"ceiling-1","factor":[0.5,0.25,0]}}"#;
    let told = server.act(act);
    assert_eq!(
        told["factors"]["ceiling-1"],
        serde_json::json!([0.5, 0.25, 0.0])
    );
    assert_eq!(waiting.join().unwrap(), told);
    let written = std::fs::read_to_string(server.dir.path().join("edit.toml")).unwrap();
    assert_eq!(told["script"], written);
    let undone = server.act("\"undo\"");
    assert_eq!(
        undone["factors"]["ceiling-1"],
        serde_json::json!([1.0, 1.0, 1.0])
    );
    let nothing = server.own("POST", "act", "\"undo\"");
    is(&nothing, "422");
    assert!(nothing.contains("nothing to undo"));
}
