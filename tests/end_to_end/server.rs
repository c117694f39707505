//! A command that serves pages, and what it answers.

use crate::support::Workplace;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, ExitStatus, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A command under test that serves pages; killed when it goes.
pub(crate) struct Server {
    child: Child,
    host: String,
    token: String,
    /// Reads its messages to their end.
    messages: Option<JoinHandle<Vec<Value>>>,
}

impl Server {
    /// Runs a command until it listens.
    pub(crate) fn start(place: &Workplace, arguments: &str) -> Self {
        let mut command = place.command(&format!("{arguments} --json"));
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut messages = BufReader::new(child.stdout.take().unwrap())
            .lines()
            .map(|line| serde_json::from_str::<Value>(&line.unwrap()).unwrap());
        let listening = messages.find(|message| message["message"] == "listening");
        let listening = listening.unwrap();
        let url = listening["url"].as_str().unwrap();
        let (host, token) = url
            .strip_prefix("http://")
            .unwrap()
            .split_once('/')
            .unwrap();
        Self {
            child,
            host: host.to_owned(),
            token: token.to_owned(),
            messages: Some(std::thread::spawn(|| messages.collect())),
        }
    }

    /// The body of an answer.
    pub(crate) fn text(&self, method: &str, place: &str, body: &str) -> String {
        let (host, token, length) = (&self.host, &self.token, body.len());
        let request = format!(
            "{method} /{token}{place} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\n\r\n{body}"
        );
        let mut stream = TcpStream::connect(host).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer.split_once("\r\n\r\n").unwrap().1.to_owned()
    }

    pub(crate) fn ask(&self, method: &str, place: &str, body: &str) -> Value {
        serde_json::from_str(&self.text(method, place, body)).unwrap()
    }

    pub(crate) fn act(&self, act: &Value) -> Value {
        self.ask("POST", "act", &act.to_string())
    }

    /// The scene that is shown, once its light fits.
    pub(crate) fn baked(&self) -> Value {
        let end = Instant::now() + Duration::from_secs(120);
        loop {
            let state = self.ask("GET", "state", "");
            if state["light"]["state"] == "fits" {
                return self.ask("GET", &format!("scene?id={}", state["scene"]), "");
            }
            assert!(Instant::now() < end, "{state}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Waits for its end; how that was, and all messages since it listens.
    pub(crate) fn ended(mut self) -> (ExitStatus, Vec<Value>) {
        let messages = self.messages.take().unwrap().join().unwrap();
        (self.child.wait().unwrap(), messages)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have been killed by the test.
        let _killed = self.child.kill().is_ok();
        let _ended = self.child.wait().is_ok();
    }
}
