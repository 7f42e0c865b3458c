//! An empty co-simulation of HELICS: its broker and its federates as separate processes. They use its C interface, so
//! no interpreter slows them down.

use std::ffi::{CStr, CString, c_char, c_void};
use std::io::{BufRead as _, BufReader, Read as _};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use libloading::Library;

/// As fast as HELICS's other way over TCP, and faster than its default, `ZeroMQ`; and only the broker has a port.
const CORE: &str = "tcpss";

/// For connecting and measuring; federates have been seen to wait forever.
const PATIENCE: Duration = Duration::from_secs(30);

/// As in `helics_api.h`.
#[repr(C)]
struct Mistake {
    code: i32,
    message: *const c_char,
}

impl Mistake {
    fn check(&self, what: &str) {
        if self.code != 0 {
            // SAFETY: the message belongs to the library, and is valid until its next call on this thread.
            let message = unsafe { CStr::from_ptr(self.message) };
            panic!("HELICS cannot {what}: {message:?}");
        }
    }
}

type Initialize = unsafe extern "C" fn() -> Mistake;
type CreateBroker =
    unsafe extern "C" fn(*const c_char, *const c_char, *const c_char, *mut Mistake) -> *mut c_void;
type CreateFederate = unsafe extern "C" fn(*const c_char, *mut Mistake) -> *mut c_void;
type EnterExecutingMode = unsafe extern "C" fn(*mut c_void, *mut Mistake);
type RequestTime = unsafe extern "C" fn(*mut c_void, f64, *mut Mistake) -> f64;

/// The library, where `tools/peers --bench` has installed it.
fn path() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../target/peers/helics/lib");
    std::fs::read_dir(root).ok()?.flatten().find_map(|python| {
        let package = python.path().join("site-packages/helics/install");
        Some(package.join("lib64/libhelics.so")).filter(|library| library.exists())
    })
}

/// True if HELICS is installed; prints a note if not.
pub(crate) fn installed() -> bool {
    let installed = path().is_some();
    if !installed {
        eprintln!("lockstep: there is no HELICS (tools/peers --bench installs it)");
    }
    installed
}

/// The processes of HELICS: the broker, then the federates. None of them ends on its own.
struct Processes(Vec<Child>);

impl Processes {
    fn start(&mut self, arguments: &[&str]) -> &mut Child {
        let own = std::env::current_exe().expect("a path");
        let mut command = Command::new(own);
        command.args(["--client", "helics"]).args(arguments);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        self.0.push(command.spawn().expect("it starts"));
        self.0.last_mut().expect("just added")
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        for child in &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// The next line that a process prints, unless it takes too long.
fn line(child: &mut Child) -> Option<String> {
    let printed = child.stdout.take().expect("a pipe");
    let (sender, line) = mpsc::channel();
    std::thread::spawn(move || {
        let line = BufReader::new(printed).lines().next();
        let _ = sender.send(line?.ok()?);
        Some(())
    });
    line.recv_timeout(PATIENCE).ok()
}

/// Steps per second of this many federates; `None`, with a message, if they do not run.
pub(crate) fn steps(count: usize, span: Duration) -> Option<f64> {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = listener.local_addr().expect("it is bound").port();
    drop(listener);
    let (port, federates) = (port.to_string(), count.to_string());
    let seconds = span.as_secs_f64().to_string();
    let mut processes = Processes(Vec::new());
    let mut run = || {
        line(processes.start(&["broker", &port, &federates, &seconds]))?;
        for at in 1..count {
            processes.start(&[&at.to_string(), &port, &federates, &seconds]);
        }
        line(processes.start(&["0", &port, &federates, &seconds]))
    };
    let rate = run().and_then(|rate| rate.parse().ok());
    if rate.is_none() {
        eprintln!("lockstep: {count} federates of HELICS do not run");
    }
    rate
}

/// A process of HELICS: the broker or a federate by its number.
pub(crate) fn client(arguments: &[String]) {
    let [role, port, count, seconds] = arguments else {
        panic!("unexpected arguments {arguments:?}");
    };
    // End with the bench, however that ends.
    std::thread::spawn(|| {
        let _ = std::io::stdin().read(&mut [0]);
        std::process::exit(0);
    });
    // SAFETY: its initializers only set up the library itself.
    let library = unsafe { Library::new(path().expect("it is installed")) }.expect("it loads");
    if role == "broker" {
        broker(&library, port, count);
    }
    federate(
        &library,
        role.parse().expect("a number"),
        port,
        count.parse().expect("a number"),
        Duration::from_secs_f64(seconds.parse().expect("a number")),
    );
}

fn broker(library: &Library, port: &str, count: &str) -> ! {
    let text = |text: String| CString::new(text).expect("no zero in it");
    let (core, name) = (text(CORE.to_owned()), text(String::new()));
    let options = text(format!("--federates={count} --port={port} --loglevel=none"));
    // SAFETY: the types are those of helics_api.h, and the texts outlive the call.
    let mistake = unsafe {
        let initialize = library.get::<Initialize>(b"helicsErrorInitialize");
        let create = library.get::<CreateBroker>(b"helicsCreateBroker");
        let mut mistake = initialize.expect("a function of HELICS")();
        create.expect("a function of HELICS")(
            core.as_ptr(),
            name.as_ptr(),
            options.as_ptr(),
            &raw mut mistake,
        );
        mistake
    };
    mistake.check("start a broker");
    println!("ready");
    loop {
        std::thread::park();
    }
}

/// Federates without links do not wait for each other: link each with the first one, both ways. More links would cost
/// more messages per step.
fn description(at: usize, port: &str, count: usize) -> String {
    let others = if at == 0 { 1..count } else { 0..1 };
    let links: Vec<String> = others
        .map(|other| format!(r#"{{"key":"v{other}"}}"#))
        .collect();
    format!(
        r#"{{"name":"c{at}","coreType":"{CORE}","period":1.0,
             "coreInitString":"--federates=1 --broker_address=127.0.0.1 --brokerport={port} --loglevel=none",
             "publications":[{{"key":"v{at}","type":"double","global":true}}],
             "subscriptions":[{}]}}"#,
        links.join(",")
    )
}

/// Steps forever; the first federate also prints the steps per second in `span`, after the first 100.
fn federate(library: &Library, at: usize, port: &str, count: usize, span: Duration) -> ! {
    let description = CString::new(description(at, port, count)).expect("no zero in it");
    // SAFETY: the types are those of helics_api.h, the text outlives the call, and the federate is used by
    // this thread only.
    let (mut mistake, federate, request) = unsafe {
        let initialize = library.get::<Initialize>(b"helicsErrorInitialize");
        let create = library.get::<CreateFederate>(b"helicsCreateValueFederateFromConfig");
        let enter = library.get::<EnterExecutingMode>(b"helicsFederateEnterExecutingMode");
        let request = library.get::<RequestTime>(b"helicsFederateRequestTime");
        let mut mistake = initialize.expect("a function of HELICS")();
        let create = create.expect("a function of HELICS");
        let federate = create(description.as_ptr(), &raw mut mistake);
        mistake.check("create a federate");
        enter.expect("a function of HELICS")(federate, &raw mut mistake);
        (mistake, federate, request.expect("a function of HELICS"))
    };
    mistake.check("begin");
    let mut time = 0.0;
    let mut step = || {
        time += 1.0;
        // SAFETY: as above.
        let granted = unsafe { request(federate, time, &raw mut mistake) };
        mistake.check("step");
        assert!((granted - time).abs() < 0.5, "granted {granted} for {time}");
    };
    for _ in 0..100 {
        step();
    }
    let (begun, mut steps) = (Instant::now(), 0_u32);
    let mut printed = at != 0;
    loop {
        step();
        steps += 1;
        // Reading the clock costs nothing measurable here, and our client and the bare coordinator do it, too.
        let elapsed = begun.elapsed();
        if !printed && elapsed >= span {
            println!("{}", f64::from(steps) / elapsed.as_secs_f64());
            printed = true;
        }
    }
}
