//! The address of a page on a terminal: for other devices with a QR code, and for this computer alone with one line.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::net::{IpAddr, TcpStream};
use std::process::{Child, Command, Stdio};

use rqrr::PreparedImage;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

/// White on black, whatever the colours of the terminal.
const COLOURS: &str = "\x1b[38;5;231;48;5;16m";

/// A dispatcher with a page, on a terminal of its own.
struct Shown {
    child: Child,
    terminal: File,
    text: String,
    _folder: tempfile::TempDir,
}

impl Shown {
    fn start(page: &str) -> Self {
        let terminal = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a terminal");
        grantpt(&terminal).expect("it is ours");
        unlockpt(&terminal).expect("it is ours");
        let name = ptsname(&terminal, Vec::new()).expect("it has a name");
        let end = open(&name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).expect("its end");
        let folder = tempfile::tempdir().expect("a folder");
        let child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .args([
                "dispatch",
                "--listen",
                "127.0.0.1:0",
                "--page",
                page,
                "--patch",
            ])
            .arg(folder.path().join("patch.toml"))
            .stdout(Stdio::from(end))
            .spawn()
            .expect("the tickbus program runs");
        Self {
            child,
            terminal: terminal.into(),
            text: String::new(),
            _folder: folder,
        }
    }

    /// Reads until the text has what is looked for.
    fn until<T>(&mut self, found: impl Fn(&str) -> Option<T>) -> T {
        loop {
            if let Some(found) = found(&self.text) {
                return found;
            }
            let patience = Timespec {
                tv_sec: 20,
                tv_nsec: 0,
            };
            let mut ready = [PollFd::new(&self.terminal, PollFlags::IN)];
            let count = poll(&mut ready, Some(&patience)).expect("a terminal");
            assert_eq!(count, 1, "no more than this: {}", self.text);
            let mut bytes = [0; 4096];
            let count = self.terminal.read(&mut bytes).expect(&self.text);
            self.text += &String::from_utf8_lossy(&bytes[..count]);
        }
    }
}

impl Drop for Shown {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Reads the QR code of a text as the camera of a phone sees it.
fn decoded(text: &str) -> Option<String> {
    const SIZE: usize = 6;

    let lines = text.lines().filter_map(|line| line.strip_prefix(COLOURS));
    let mut rows: Vec<Vec<bool>> = Vec::new();
    for line in lines {
        let drawn = line.trim_end().strip_suffix("\x1b[0m")?;
        rows.push(drawn.chars().map(|it| "█▀".contains(it)).collect());
        rows.push(drawn.chars().map(|it| "█▄".contains(it)).collect());
    }
    let width = rows.first()?.len();
    if rows.len() < width {
        return None;
    }
    let light = |x: usize, y: usize| if rows[y / SIZE][x / SIZE] { 255 } else { 0 };
    let mut image = PreparedImage::prepare_from_greyscale(width * SIZE, rows.len() * SIZE, light);
    let grids = image.detect_grids();
    let (_, url) = grids.first().expect(text).decode().expect("a whole code");
    Some(url)
}

/// The answer of the page at its port to a phone that has opened this URL.
fn opened(url: &str) -> (String, String) {
    let (address, token) = url
        .strip_prefix("http://")
        .and_then(|rest| rest.split_once("/#token="))
        .expect(url);
    let (_, port) = address.rsplit_once(':').expect(url);
    let mut stream = TcpStream::connect(format!("127.0.0.1:{port}")).expect("it listens");
    write!(
        stream,
        "GET /access HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {token}\r\nConnection: close\r\n\r\n"
    )
    .expect("it reads");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("an answer");
    (address.to_owned(), answer)
}

#[test]
fn a_page_for_the_network_shows_its_addresses_and_a_code_that_opens_it() {
    let mut shown = Shown::start("0.0.0.0:0");
    let alone = "this computer has no address in a network";
    let url = shown.until(|text| match decoded(text) {
        Some(url) => Some(url),
        None => text.contains(alone).then(String::new),
    });
    assert!(shown.text.contains("dispatch: page at http://localhost:"));
    let Some(line) = shown
        .text
        .lines()
        .find_map(|line| line.strip_prefix("    http://"))
    else {
        assert!(shown.text.contains(alone), "{}", shown.text);
        return;
    };
    assert_eq!(
        url,
        format!("http://{}", line.trim_end()),
        "the best one is first"
    );
    let (address, answer) = opened(&url);
    let (host, _) = address.rsplit_once(':').expect(&address);
    let ip: IpAddr = host.parse().expect(host);
    assert!(!ip.is_loopback(), "{ip}");
    assert!(answer.contains("\"may_change\":true"), "{answer}");
}

#[test]
fn a_page_of_this_computer_alone_says_how_a_phone_opens_it() {
    let mut shown = Shown::start("127.0.0.1:0");
    let hint = "for this computer alone; --page 0.0.0.0:";
    shown.until(|text| text.contains(hint).then_some(()));
    assert!(!shown.text.contains(COLOURS), "{}", shown.text);
}

#[test]
fn what_is_no_terminal_gets_one_line_without_a_code() {
    let folder = tempfile::tempdir().expect("a folder");
    let patch = folder.path().join("patch.toml");
    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["dispatch", "--listen", "127.0.0.1:0", "--page", "0.0.0.0:0"])
        .args(["--duration", "200ms", "--patch"])
        .arg(patch)
        .output()
        .expect("the tickbus program runs");
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(text.matches("http://").count(), 1, "{text}");
    assert!(!text.contains('\x1b'), "{text}");
}
