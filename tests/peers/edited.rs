//! `tickbus mirror --page --edit`: a machine as a process, whose driver.cfg the page edits.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::PathBuf;

use serde_json::{Value, json};

use crate::commands::Running;

/// The machine, and its page.
pub struct Edited {
    pub command: Running,
    /// Where the page is served.
    pub page: String,
    pub token: String,
    folder: tempfile::TempDir,
}

impl Edited {
    /// A mirror of this driver.cfg, with these further arguments.
    pub fn start(text: &str, more: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("driver.cfg");
        fs::write(&file, text).expect("there is room");
        let mut all = vec![file.to_str().expect("text"), "--page", "127.0.0.1:0"];
        all.extend(more);
        let mut command = Running::of("mirror", &all);
        let url = command.after("mirror: page at http://");
        let (page, token) = url.split_once("/#token=").expect("a token");
        Self {
            page: page.to_owned(),
            token: token.to_owned(),
            command,
            folder,
        }
    }

    pub fn file(&self) -> PathBuf {
        self.folder.path().join("driver.cfg")
    }

    pub fn text(&self) -> String {
        fs::read_to_string(self.file()).expect("it is there")
    }

    /// Sends a request with these further lines of its head; returns the status and the body.
    pub fn ask_as(&self, line: &str, head: &str, body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(&self.page).expect("it listens");
        let (page, length) = (&self.page, body.len());
        write!(
            stream,
            "{line} HTTP/1.1\r\nHost: {page}\r\nConnection: close\r\n{head}Content-Length: {length}\r\n\r\n{body}"
        )
        .expect("it reads");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("UTF-8");
        let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
        let status = head.split(' ').nth(1).and_then(|code| code.parse().ok());
        (status.expect("a status"), body.to_owned())
    }

    /// Sends a request with the token.
    pub fn ask(&self, line: &str, body: &str) -> (u16, String) {
        let head = format!("Authorization: Bearer {}\r\n", self.token);
        self.ask_as(line, &head, body)
    }

    pub fn get(&self, path: &str) -> Value {
        let (status, body) = self.ask(&format!("GET {path}"), "");
        assert_eq!(status, 200, "{path}: {body}");
        serde_json::from_str(&body).expect("JSON")
    }

    /// Changes a setting of `[fieldbus]`, and lets the line take the file.
    pub fn set(&self, key: &str, was: &str, to: &str) -> (u16, String) {
        let edit = json!({ "set": { "at": ["fieldbus", key], "was": was, "to": to } });
        let done = self.ask("PUT /studio/edit", &edit.to_string());
        assert_eq!(done.0, 200, "{}", done.1);
        self.ask("PUT /studio/line", "take")
    }

    /// The value of the signal with this index, as the page shows it.
    pub fn value(&self, index: usize) -> Value {
        self.get("/signals")["drivers"][0]["signals"][index]["value"].take()
    }

    pub fn state(&self) -> String {
        let line = self.get("/line");
        let state = &line["drivers"][0]["state"];
        state.as_str().expect("a text").to_owned()
    }
}
