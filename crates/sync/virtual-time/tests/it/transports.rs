//! A run is the same in this process and over every transport, in any order of arrival.

use std::sync::Arc;
use std::thread;

use crate::common::{client, mixer_settings, mixers, settings};
use tickbus_base::time::{Clock, Monotonic, Nanos, Stop};
use tickbus_net::Address;
#[cfg(unix)]
use tickbus_virtual_time::shared_memory;
use tickbus_virtual_time::{
    Cause, Controls, Ended, Hosting, Logic, Outcome, Participant, Settings, in_process, tcp,
};

fn clock() -> Arc<dyn Clock> {
    Monotonic::shared()
}

/// A run over TCP, with a thread for each client; the results of the server, and of the clients in their order.
fn over_tcp(
    settings: Settings,
    clients: Vec<Box<dyn Participant + Send>>,
) -> (Result<Outcome, Ended>, Vec<Result<Outcome, Ended>>) {
    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let address = Address::local(listener.address().port());
    thread::scope(|scope| {
        let joined: Vec<_> = clients
            .into_iter()
            .map(|mut client| {
                let address = &address;
                scope.spawn(move || tcp::join(address, &mut *client))
            })
            .collect();
        let outcome = serve(listener, settings, &Controls::default());
        let ends = joined
            .into_iter()
            .map(|client| client.join().expect("no panic"));
        (outcome, ends.collect())
    })
}

#[test]
fn a_browser_is_refused_in_words() {
    use std::io::{Read as _, Write as _};

    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let address = listener.address();
    let controls = Controls::default();
    let mut news = Vec::new();
    thread::scope(|scope| {
        let controls = &controls;
        scope.spawn(move || {
            let mut browser = std::net::TcpStream::connect(address).expect("it listens");
            let request = b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\nany bytes";
            browser.write_all(request).expect("it reads");
            let mut answer = Vec::new();
            // The way of closing does not matter.
            let _ = browser.read_to_end(&mut answer);
            controls.send(tickbus_virtual_time::server::Control::Stop);
        });
        let hosting = Hosting {
            clock: &*Monotonic::shared(),
            controls,
            news: &mut |line| news.push(line.to_owned()),
        };
        let outcome = listener.run(settings(1, &["a"]), Logic::new(), hosting);
        outcome.expect_err("nobody has joined");
    });
    let refused = news.iter().find(|line| line.contains("was refused"));
    assert!(
        refused.is_some_and(|line| line.contains("is an HTTP request")),
        "{news:?}"
    );
}

/// A Unix socket in a folder of its own.
#[cfg(unix)]
fn socket(folder: &tempfile::TempDir) -> tickbus_net::LocalAddress {
    let path = format!("unix:{}", folder.path().join("run").display());
    path.parse().expect("a path")
}

#[cfg(unix)]
#[test]
fn a_run_over_unix_sockets_is_the_one_in_this_process_and_leaves_no_file() {
    let expected = in_this_process(500, 4);
    let folder = tempfile::tempdir().expect("a folder");
    let address = socket(&folder);
    for turn in 0..4 {
        let mut clients = mixers(4);
        clients.rotate_left(turn);
        let listener = tcp::Listener::bind_local(&address).expect("a free path");
        assert_eq!(listener.place(), address.to_string());
        let (outcome, ends) = thread::scope(|scope| {
            let join = |mut mixer| {
                let address = &address;
                scope.spawn(move || tcp::join_local(address, &mut mixer))
            };
            let joined: Vec<_> = clients.into_iter().map(join).collect();
            let outcome = serve(listener, mixer_settings(500, 4), &Controls::default());
            let ends = joined.into_iter().map(|end| end.join().expect("no panic"));
            (outcome, ends.collect::<Vec<_>>())
        });
        assert_eq!(outcome, Ok(expected));
        assert!(ends.iter().all(|end| *end == outcome), "{ends:?}");
        assert!(!address.path().exists(), "the socket is removed");
    }
}

#[cfg(unix)]
#[test]
fn a_client_at_a_unix_socket_without_a_server_is_told_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let address = socket(&folder);
    let mut one = client("one", 1, &[], &[], |_, _, _| Ok(()));
    // No file, and the file of a server that was killed.
    for leftover in [false, true] {
        if leftover {
            drop(std::os::unix::net::UnixListener::bind(address.path()).expect("a free path"));
        }
        let ended = tcp::join_local(&address, &mut one).expect_err("nobody is there");
        let begin = format!("no server can be reached at {address} (");
        assert!(ended.reason.starts_with(&begin), "{ended}");
        assert!(
            ended
                .reason
                .ends_with("start it first, or correct the address"),
            "{ended}"
        );
    }
}

fn serve(
    listener: tcp::Listener,
    settings: Settings,
    controls: &Controls,
) -> Result<Outcome, Ended> {
    let hosting = Hosting {
        clock: &*Monotonic::shared(),
        controls,
        news: &mut |_| {},
    };
    listener.run(settings, Logic::new(), hosting)
}

/// Like [`over_tcp`], through shared memory.
#[cfg(unix)]
fn through_memory(
    settings: Settings,
    clients: Vec<Box<dyn Participant + Send>>,
) -> (Result<Outcome, Ended>, Vec<Result<Outcome, Ended>>) {
    let name = fresh_name();
    let listener = shared_memory::Listener::bind(&name, &settings).expect("a free name");
    thread::scope(|scope| {
        let joined: Vec<_> = clients
            .into_iter()
            .map(|mut client| {
                let name = &name;
                scope.spawn(move || shared_memory::join(name, &mut *client))
            })
            .collect();
        let outcome = serve_memory(listener, settings);
        let ends = joined
            .into_iter()
            .map(|client| client.join().expect("no panic"));
        (outcome, ends.collect())
    })
}

#[cfg(unix)]
fn serve_memory(listener: shared_memory::Listener, settings: Settings) -> Result<Outcome, Ended> {
    let hosting = Hosting {
        clock: &*Monotonic::shared(),
        controls: &Controls::default(),
        news: &mut |_| {},
    };
    listener.run(settings, Logic::new(), hosting)
}

/// A unique name for shared memory.
#[cfg(unix)]
fn fresh_name() -> String {
    use std::sync::atomic::{AtomicU32, Ordering};

    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    format!("test-{}-{number}", std::process::id())
}

fn in_this_process(steps: u64, count: u32) -> Outcome {
    let mut mixers = mixers(count);
    let clients = mixers.iter_mut().map(|mixer| mixer as _).collect();
    in_process::run(mixer_settings(steps, count), clients, Logic::new()).expect("it runs")
}

#[test]
fn a_run_over_tcp_is_the_one_in_this_process_whoever_comes_first() {
    let expected = in_this_process(500, 4);
    for turn in 0..4 {
        let mut clients: Vec<Box<dyn Participant + Send>> = Vec::new();
        for mixer in mixers(4) {
            clients.push(Box::new(mixer));
        }
        clients.rotate_left(turn);
        let (outcome, ends) = over_tcp(mixer_settings(500, 4), clients);
        assert_eq!(outcome, Ok(expected));
        assert!(ends.iter().all(|end| *end == outcome), "{ends:?}");
    }
}

#[cfg(unix)]
#[test]
fn a_run_through_shared_memory_is_the_one_in_this_process_whoever_comes_first() {
    let expected = in_this_process(2000, 3);
    for turn in 0..3 {
        let mut clients: Vec<Box<dyn Participant + Send>> = Vec::new();
        for mixer in mixers(3) {
            clients.push(Box::new(mixer));
        }
        clients.rotate_left(turn);
        let (outcome, ends) = through_memory(mixer_settings(2000, 3), clients);
        assert_eq!(outcome, Ok(expected));
        assert!(ends.iter().all(|end| *end == outcome), "{ends:?}");
    }
}

#[cfg(unix)]
#[test]
fn clients_on_the_server_s_thread_change_nothing() {
    let expected = in_this_process(2000, 3);
    for is_tcp in [true, false] {
        let mut clients = mixers(3);
        let mut remote = clients.pop().expect("the third");
        let settings = mixer_settings(2000, 3);
        let locals = clients.iter_mut().map(|mixer| mixer as _).collect();
        let hosting = Hosting {
            clock: &*Monotonic::shared(),
            controls: &Controls::default(),
            news: &mut |_| {},
        };
        let (outcome, end) = thread::scope(|scope| {
            if is_tcp {
                let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
                let address = Address::local(listener.address().port());
                let joined = scope.spawn(move || tcp::join(&address, &mut remote));
                let outcome = listener.run_with(settings, Logic::new(), hosting, locals);
                (outcome, joined.join().expect("no panic"))
            } else {
                let name = fresh_name();
                let listener = shared_memory::Listener::bind(&name, &settings).expect("free");
                let joined = scope.spawn(move || shared_memory::join(&name, &mut remote));
                let outcome = listener.run_with(settings, Logic::new(), hosting, locals);
                (outcome, joined.join().expect("no panic"))
            }
        });
        assert_eq!(outcome, Ok(expected), "over TCP: {is_tcp}");
        assert_eq!(end, outcome);
    }
}

#[cfg(unix)]
#[test]
fn who_comes_late_or_second_to_shared_memory_is_refused() {
    let settings = settings(20, &["first"]);
    let name = fresh_name();
    let listener = shared_memory::Listener::bind(&name, &settings).expect("a free name");
    let second = shared_memory::Listener::bind(&name, &settings).expect_err("it is taken");
    assert_eq!(second.kind(), std::io::ErrorKind::AddrInUse);
    let late = name.clone();
    let mut first = client("first", 1, &[], &[], move |step, _, _| {
        if step.sequence == 3 {
            let mut late_one = client("late", 1, &[], &[], |_, _, _| Ok(()));
            let ended = shared_memory::join(&late, &mut late_one).expect_err("it is late");
            assert_eq!(ended.cause, Cause::Refused);
            assert!(ended.reason.contains("is at step 3"), "{ended}");
        }
        Ok(())
    });
    thread::scope(|scope| {
        let joined = scope.spawn(|| shared_memory::join(&name, &mut first));
        let outcome = serve_memory(listener, settings);
        assert_eq!(outcome.as_ref().map(|outcome| outcome.steps), Ok(20));
        assert_eq!(joined.join().expect("no panic"), outcome);
    });
    let gone = client("first", 1, &[], &[], |_, _, _| Ok(()));
    let ended = shared_memory::join(&name, &mut { gone }).expect_err("the server is gone");
    assert_eq!(ended.cause, Cause::Lost);
}

/// Not a test, but the server that the next test starts.
#[cfg(unix)]
#[test]
fn a_server_that_kills_itself_in_step_5() {
    let Ok(name) = std::env::var("TICKBUS_TEST_SERVER") else {
        return;
    };
    let settings = settings(20, &["one"]);
    let listener = shared_memory::Listener::bind(&name, &settings).expect("a free name");
    let logic = Logic::new().on_time(|access| {
        if access.step().sequence == 5 {
            std::process::abort();
        }
        Ok(())
    });
    let hosting = Hosting {
        clock: &*Monotonic::shared(),
        controls: &Controls::default(),
        news: &mut |_| {},
    };
    let _ = listener.run(settings, logic, hosting);
}

#[cfg(unix)]
#[test]
fn a_server_that_crashes_at_shared_memory_is_noticed_and_replaced() {
    let name = fresh_name();
    let own = std::env::current_exe().expect("a path");
    let mut child = std::process::Command::new(own)
        .args([
            "--exact",
            "transports::a_server_that_kills_itself_in_step_5",
        ])
        .env("TICKBUS_TEST_SERVER", &name)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .expect("it starts");
    let mut steps = 0;
    let mut one = client("one", 1, &[], &[], |step, _, _| {
        steps = step.sequence;
        Ok(())
    });
    let ended = loop {
        let ended = shared_memory::join(&name, &mut one).expect_err("it crashes");
        if !ended.reason.contains("no server offers") {
            break ended;
        }
        assert_eq!(child.try_wait().expect("it was started"), None);
        thread::yield_now();
    };
    assert_eq!(
        (ended.cause, &*ended.reason),
        (Cause::Lost, "the server was lost: its process has ended")
    );
    assert_eq!(steps, 4);
    // The client does not know that the fourth step was committed.
    assert_eq!(ended.steps, 3);
    assert!(!child.wait().expect("it was started").success());
    // The file of the killed server is still there.
    let settings = settings(1, &["one"]);
    shared_memory::Listener::bind(&name, &settings).expect("it is replaced");
}

/// Not a test, but the client that the next test kills.
#[cfg(unix)]
#[test]
fn a_child_that_kills_itself_in_step_5() {
    let Ok(name) = std::env::var("TICKBUS_TEST_MEMORY") else {
        return;
    };
    let mut victim = client("victim", 1, &[], &[], |step, _, _| {
        if step.sequence == 5 {
            std::process::abort();
        }
        Ok(())
    });
    let _ = shared_memory::join(&name, &mut victim);
}

#[cfg(unix)]
#[test]
fn a_process_that_crashes_at_shared_memory_is_named() {
    let settings = settings(20, &["good", "victim"]);
    let name = fresh_name();
    let listener = shared_memory::Listener::bind(&name, &settings).expect("a free name");
    let mut good = client("good", 1, &[], &[], |_, _, _| Ok(()));
    thread::scope(|scope| {
        let joined = scope.spawn(|| shared_memory::join(&name, &mut good));
        let own = std::env::current_exe().expect("a path");
        let mut child = std::process::Command::new(own)
            .args(["--exact", "transports::a_child_that_kills_itself_in_step_5"])
            .env("TICKBUS_TEST_MEMORY", &name)
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::null())
            .spawn()
            .expect("it starts");
        let ended = serve_memory(listener, settings).expect_err("it crashes");
        assert_eq!(
            ended.to_string(),
            "the run ended after 4 steps: client \"victim\" was lost: its process has ended"
        );
        assert_eq!(joined.join().expect("no panic"), Err(ended));
        assert!(!child.wait().expect("it was started").success());
    });
}

#[test]
fn a_late_joiner_is_refused_with_the_reason_and_the_run_goes_on() {
    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let address = Address::local(listener.address().port());
    let late = Address::local(listener.address().port());
    let mut first = client("first", 1, &[], &[], move |step, _, _| {
        if step.sequence == 3 {
            let mut late_one = client("late", 1, &[], &[], |_, _, _| Ok(()));
            let ended = tcp::join(&late, &mut late_one).expect_err("it is late");
            assert_eq!(ended.cause, Cause::Refused);
            assert_eq!(ended.client.as_deref(), Some("late"));
            assert!(ended.reason.contains("is at step 3"), "{ended}");
        }
        Ok(())
    });
    thread::scope(|scope| {
        let joined = scope.spawn(|| tcp::join(&address, &mut first));
        let outcome = serve(listener, settings(5, &["first"]), &Controls::default());
        assert_eq!(outcome.as_ref().map(|outcome| outcome.steps), Ok(5));
        assert_eq!(joined.join().expect("no panic"), outcome);
    });
}

#[test]
fn a_client_that_hangs_is_named_and_everyone_learns_it() {
    let mut settings = settings(50, &["good", "stuck"]);
    settings.hang = Nanos::from_millis(300);
    let mut good = client("good", 1, &[], &[], |_, _, _| Ok(()));
    let (sender, receiver) = std::sync::mpsc::channel::<()>();
    let mut stuck = client("stuck", 1, &[], &[], move |step, _, _| {
        if step.sequence == 7 {
            // Until the other end is dropped, when the run has ended.
            let _ = receiver.recv();
        }
        Ok(())
    });
    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let address = Address::local(listener.address().port());
    thread::scope(|scope| {
        let joined = scope.spawn(|| tcp::join(&address, &mut good));
        let hung = scope.spawn(|| tcp::join(&address, &mut stuck));
        let ended = serve(listener, settings, &Controls::default()).expect_err("it hangs");
        drop(sender);
        assert_eq!(
            ended.to_string(),
            "the run ended after 6 steps: client \"stuck\" has not finished step 7 within 300ms"
        );
        for end in [joined, hung] {
            assert_eq!(end.join().expect("no panic"), Err(ended.clone()));
        }
    });
}

#[test]
fn a_client_that_goes_is_named_and_the_others_learn_it() {
    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let address = Address::local(listener.address().port());
    let mut good = client("good", 1, &[], &[], |_, _, _| Ok(()));
    let gone = client("gone", 1, &[], &[], |_, _, _| Ok(())).declaration;
    thread::scope(|scope| {
        let joined = scope.spawn(|| tcp::join(&address, &mut good));
        scope.spawn(|| {
            let gone = tickbus_virtual_time::client::Client::new(gone).expect("it is right");
            let mut gone =
                tcp::connect(&address, gone, &clock(), &Stop::new()).expect("it listens");
            gone.wait(Nanos::MAX).expect("it starts");
            gone.answer(&[]);
            gone.wait(Nanos::MAX).expect("the first step");
        });
        let ended = serve(
            listener,
            settings(50, &["good", "gone"]),
            &Controls::default(),
        );
        let ended = ended.expect_err("it is gone");
        assert_eq!((ended.cause, ended.steps), (Cause::Lost, 0));
        assert_eq!(ended.client.as_deref(), Some("gone"));
        assert_eq!(joined.join().expect("no panic"), Err(ended));
    });
}

#[test]
fn a_stop_ends_the_run_between_two_steps() {
    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let address = Address::local(listener.address().port());
    let controls = Controls::default();
    let asked = controls.clone();
    let mut one = client("one", 1, &[], &[], move |step, _, _| {
        if step.sequence == 100 {
            asked.send(tickbus_virtual_time::server::Control::Stop);
        }
        Ok(())
    });
    let mut settings = settings(0, &["one"]);
    settings.steps = None;
    thread::scope(|scope| {
        let joined = scope.spawn(|| tcp::join(&address, &mut one));
        let outcome = serve(listener, settings, &controls);
        assert!(
            outcome.as_ref().is_ok_and(|outcome| outcome.steps >= 100),
            "{outcome:?}"
        );
        assert_eq!(joined.join().expect("no panic"), outcome);
    });
}

#[test]
fn a_client_waits_for_a_silent_server_no_longer_than_its_limit() {
    // Nobody accepts, but the system lets the client connect anyway.
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = Address::local(listener.local_addr().expect("it is bound").port());
    let client = client("one", 1, &[], &[], |_, _, _| Ok(())).declaration;
    let client = tickbus_virtual_time::client::Client::new(client).expect("it is right");
    let mut client = tcp::connect(&address, client, &clock(), &Stop::new()).expect("it listens");
    let ended = client
        .wait(Nanos::from_millis(120))
        .expect_err("nobody answers");
    assert_eq!(ended.cause, Cause::Hung);
    let stop = Stop::new();
    stop.stop();
    let declaration = client.client().declaration().clone();
    let again = tickbus_virtual_time::client::Client::new(declaration).expect("it is right");
    let mut again = tcp::connect(&address, again, &clock(), &stop).expect("it listens");
    let ended = again.wait(Nanos::MAX).expect_err("it was stopped");
    assert_eq!(ended.cause, Cause::Stopped);
}
