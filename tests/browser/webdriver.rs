//! A headless Chromium, controlled by the W3C `WebDriver` protocol through chromedriver.

use std::fs;
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::{Value, json};

/// A browser, which ends when this is dropped.
pub(crate) struct Browser {
    driver: Child,
    port: u16,
    session: String,
    /// Holds everything that they leave in the folder for temporary files.
    _folder: tempfile::TempDir,
}

impl Browser {
    /// Starts a browser with a window of this many CSS pixels.
    pub(crate) fn start(width: u32, height: u32) -> Self {
        let folder = tempfile::tempdir().expect("there is room for a browser");
        // chromedriver looks for a port that is free for IPv4, and ends if another program has it for IPv6 by then.
        let (driver, port) = (0..5)
            .find_map(|_| start_driver(folder.path()))
            .expect("chromedriver tells its port");
        let mut browser = Self {
            driver,
            port,
            session: String::new(),
            _folder: folder,
        };
        let arguments = [
            "--headless=new".to_owned(),
            // As root, and in containers, the sandbox does not work.
            "--no-sandbox".to_owned(),
            "--disable-dev-shm-usage".to_owned(),
            "--force-device-scale-factor=1".to_owned(),
            format!("--window-size={width},{height}"),
        ];
        let session = browser.call(
            "POST",
            "/session",
            &json!({"capabilities": {"alwaysMatch": {
                "goog:chromeOptions": {"args": arguments},
                "goog:loggingPrefs": {"browser": "ALL"},
                "timeouts": {"script": 120_000, "pageLoad": 120_000},
            }}}),
        );
        session["sessionId"]
            .as_str()
            .expect("a session has a name")
            .clone_into(&mut browser.session);
        browser.resize(width, height);
        browser
    }

    /// Leaves the page, for a window of this many CSS pixels: faster than starting another browser.
    pub(crate) fn resize(&self, width: u32, height: u32) {
        self.go("about:blank");
        // Headless windows have a frame, whatever their initial size, unless the size is set like this.
        let metrics = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 640});
        self.devtools("Emulation.setDeviceMetricsOverride", &metrics);
    }

    /// Opens a file, and waits until it is loaded.
    pub(crate) fn open(&self, file: &Path) {
        let file = file.canonicalize().expect("the page is there");
        self.go(&format!("file://{}", file.display()));
    }

    /// Opens another tab, which becomes the current one.
    pub(crate) fn new_tab(&self) {
        let tab = self.command("window/new", &json!({"type": "tab"}));
        self.command("window", &json!({"handle": tab["handle"]}));
    }

    /// Returns to the first tab.
    pub(crate) fn first_tab(&self) {
        let path = format!("/session/{}/window/handles", self.session);
        let tabs = self.call("GET", &path, &json!({}));
        self.command("window", &json!({"handle": tabs[0]}));
    }

    /// Opens an address, and waits until it is loaded.
    pub(crate) fn go(&self, url: &str) {
        self.command("url", &json!({"url": url}));
    }

    /// Runs a function body in the page, which may wait, and returns its result.
    pub(crate) fn run(&self, body: &str) -> Value {
        let script = format!(
            "const done = arguments[arguments.length - 1];\
             (async () => {{ {body} }})().then((value) => done({{value}}), (error) => done({{error: String(error)}}));"
        );
        let mut answer = self.command("execute/async", &json!({"script": script, "args": []}));
        assert!(answer["error"].is_null(), "{body}: {}", answer["error"]);
        answer["value"].take()
    }

    /// Waits until a condition in the page holds.
    pub(crate) fn wait(&self, condition: &str) {
        let body =
            format!("while (!({condition})) await new Promise((go) => requestAnimationFrame(go));");
        self.run(&body);
    }

    /// Types into the focused element.
    pub(crate) fn keys(&self, keys: &str) {
        let strokes = keys.chars().flat_map(|key| {
            let key = key.to_string();
            [
                json!({"type": "keyDown", "value": key}),
                json!({"type": "keyUp", "value": key}),
            ]
        });
        let strokes: Vec<Value> = strokes.collect();
        self.command(
            "actions",
            &json!({"actions": [{"type": "key", "id": "keys", "actions": strokes}]}),
        );
    }

    /// Performs actions of pointers, wheels and keys, as defined in the protocol.
    pub(crate) fn act(&self, actions: &Value) {
        self.command("actions", &json!({"actions": actions}));
    }

    /// A command of Chromium's own protocol.
    pub(crate) fn devtools(&self, command: &str, parameters: &Value) -> Value {
        self.command(
            "goog/cdp/execute",
            &json!({"cmd": command, "params": parameters}),
        )
    }

    /// The errors and warnings logged by the page.
    pub(crate) fn complaints(&self) -> Vec<String> {
        let log = self.command("se/log", &json!({"type": "browser"}));
        let entries = log.as_array().expect("a log is a list").iter();
        entries.map(|entry| entry["message"].to_string()).collect()
    }

    fn command(&self, command: &str, body: &Value) -> Value {
        self.call(
            "POST",
            &format!("/session/{}/{command}", self.session),
            body,
        )
    }

    #[track_caller]
    fn call(&self, method: &str, path: &str, body: &Value) -> Value {
        let mut answer = self
            .answer(method, path, body)
            .expect("chromedriver answers");
        let error = &answer["value"]["error"];
        assert!(
            !error.is_string() || path.ends_with("async"),
            "{path}: {}",
            answer["value"]
        );
        answer["value"].take()
    }

    fn answer(&self, method: &str, path: &str, body: &Value) -> io::Result<Value> {
        let body = body.to_string();
        let mut stream = TcpStream::connect(("127.0.0.1", self.port))?;
        stream.set_read_timeout(Some(Duration::from_secs(300)))?;
        write!(
            stream,
            "{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Type: application/json\r\n\
             Content-Length: {}\r\nConnection: close\r\n\r\n{body}",
            self.port,
            body.len()
        )?;
        let mut reader = BufReader::new(stream);
        let mut length = 0;
        loop {
            let mut line = String::new();
            reader.read_line(&mut line)?;
            let line = line.trim().to_lowercase();
            if let Some(value) = line.strip_prefix("content-length:") {
                length = value.trim().parse().map_err(io::Error::other)?;
            }
            if line.is_empty() {
                break;
            }
        }
        let mut answer = vec![0; length];
        reader.read_exact(&mut answer)?;
        serde_json::from_slice(&answer).map_err(io::Error::other)
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // Also after a failed test: killing the driver would leave its browser behind.
        if !self.session.is_empty() {
            let session = format!("/session/{}", self.session);
            let _ = self.answer("DELETE", &session, &json!({}));
        }
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}

/// Takes a picture of the page, or of its visible part, if there is a folder for it.
pub(crate) fn shoot(browser: &Browser, folder: Option<&Path>, name: &str, whole: bool) {
    let shot = browser.devtools(
        "Page.captureScreenshot",
        &json!({"captureBeyondViewport": whole}),
    );
    save(folder, name, &shot["data"]);
}

/// Saves the browser's base64 data.
pub(crate) fn save(folder: Option<&Path>, name: &str, data: &Value) {
    let data = data.as_str().expect("base64");
    let Some(folder) = folder else { return };
    let digit = |byte: u8| match byte {
        b'A'..=b'Z' => u32::from(byte - b'A'),
        b'a'..=b'z' => u32::from(byte - b'a') + 26,
        b'0'..=b'9' => u32::from(byte - b'0') + 52,
        b'+' => 62,
        _ => 63,
    };
    let digits: Vec<u32> = data.trim_end_matches('=').bytes().map(digit).collect();
    let mut bytes = Vec::new();
    for group in digits.chunks(4) {
        let bits = group.iter().fold(0, |bits, digit| bits << 6 | digit) << (6 * (4 - group.len()));
        bytes.extend_from_slice(&bits.to_be_bytes()[1..group.len()]);
    }
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(folder.join(name), bytes))
        .expect("screenshots can be saved");
}

/// Starts chromedriver with a folder for its temporary files, and takes the port from its output. If chromedriver ends
/// at once, its output is in the test's output.
fn start_driver(folder: &Path) -> Option<(Child, u16)> {
    let started = Command::new("chromedriver")
        .env("TMPDIR", folder)
        .arg("--port=0")
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn();
    let mut driver = started.expect("chromedriver is there (Debian's package chromium-driver)");
    let lines = BufReader::new(driver.stdout.take().expect("it is piped")).lines();
    let mut said = Vec::new();
    for line in lines {
        let line = line.expect("it writes text");
        if let Some((_, port)) = line.split_once("started successfully on port ") {
            let port = port.trim_end_matches('.').parse();
            return Some((driver, port.expect("a port is a number")));
        }
        said.push(line);
    }
    let ended = driver.wait().expect("it can be waited for");
    eprintln!("chromedriver ended ({ended}): {}", said.join("\n"));
    None
}
