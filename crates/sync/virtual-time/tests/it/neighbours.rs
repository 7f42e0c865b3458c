//! Runs whose clients exchange their values directly, beside each other, with a client in a process of its own that is
//! killed, and after such a run.

use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::thread;

use tickbus_base::time::{Clock as _, Monotonic, Nanos};
use tickbus_net::Address;
use tickbus_virtual_time::{Cause, Controls, Hosting, Logic, Meeting, Settings, tcp};

use crate::common::{mixer_settings, mixers};
use crate::direct::{DIRECTLY, boxed, direct, in_this_process, run};

/// The variable that makes a client of this test program.
const MEMBER: &str = "TICKBUS_TEST_MEMBER";

#[test]
fn two_runs_at_once_whose_sockets_and_clients_share_their_names_are_both_right() {
    let expected = in_this_process(3000, 3);
    thread::scope(|scope| {
        // Each has its socket as "run" in a folder of its own.
        let both = [(); 2].map(|()| {
            scope.spawn(|| {
                run(
                    direct(mixer_settings(3000, 3)),
                    Logic::new(),
                    &Controls::default(),
                    cfg!(unix),
                    boxed(mixers(3)),
                )
            })
        });
        for one in both {
            let (outcome, ends, news) = one.join().expect("no panic");
            assert!(news.iter().any(|line| line == DIRECTLY), "{news:?}");
            assert_eq!(outcome, Ok(expected), "{news:?}");
            assert!(ends.iter().all(|end| *end == Ok(expected)), "{ends:?}");
        }
    });
}

/// Not a test of its own: the client of the test below.
#[test]
fn a_client_in_a_process_of_its_own() {
    let Ok(meeting) = std::env::var(MEMBER) else {
        return;
    };
    let mut own = mixers(2).remove(1);
    // The run ends as it may.
    let _ = join(&meeting.parse().expect("a meeting place"), &mut own);
}

fn join(
    at: &Meeting,
    client: &mut dyn tickbus_virtual_time::Participant,
) -> Result<tickbus_virtual_time::Outcome, tickbus_virtual_time::Ended> {
    match at {
        Meeting::Tcp(address) => tcp::join(address, client),
        Meeting::Unix(address) => tcp::join_local(address, client),
        Meeting::SharedMemory(_) => unreachable!("no such run here"),
    }
}

fn spawn(at: &Meeting) -> Child {
    Command::new(std::env::current_exe().expect("this program"))
        .args(["--exact", "neighbours::a_client_in_a_process_of_its_own"])
        .env(MEMBER, at.to_string())
        .stdout(Stdio::null())
        .spawn()
        .expect("it starts")
}

#[test]
fn a_client_that_is_killed_is_named_to_all_and_a_new_run_starts_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut places = vec!["127.0.0.1:0".to_owned()];
    if cfg!(unix) {
        places.push(format!("unix:{}", folder.path().join("run").display()));
    }
    let expected = in_this_process(3000, 2);
    for place in places {
        let mut at: Meeting = place.parse().expect("a meeting place");
        // The second run is at the same address.
        for is_killed in [true, false] {
            let listener = match &at {
                Meeting::Unix(address) => tcp::Listener::bind_local(address),
                Meeting::Tcp(address) => tcp::Listener::bind(address),
                Meeting::SharedMemory(_) => unreachable!("no such run here"),
            };
            let listener = listener.expect("it is free");
            if let Meeting::Tcp(_) = at {
                at = Meeting::Tcp(Address::local(listener.address().port()));
            }
            let child = Mutex::new(spawn(&at));
            let killed = Mutex::new(None);
            let settings = Settings {
                steps: (!is_killed).then_some(3000),
                ..direct(mixer_settings(0, 2))
            };
            let logic = Logic::new().on_commit(|commit| {
                if is_killed && commit.step().sequence == 2000 {
                    let mut child = child.lock().expect("no panic");
                    child.kill().map_err(|error| error.to_string())?;
                    *killed.lock().expect("no panic") = Some(Monotonic::shared().now());
                }
                Ok(())
            });
            let news = Mutex::new(Vec::new());
            let (outcome, other) = thread::scope(|scope| {
                let other = scope.spawn(|| join(&at, &mut mixers(2)[0]));
                let hosting = Hosting {
                    clock: &*Monotonic::shared(),
                    controls: &Controls::default(),
                    news: &mut |line| news.lock().expect("no panic").push(line.to_owned()),
                };
                let outcome = listener.run(settings, logic, hosting);
                (outcome, other.join().expect("no panic"))
            });
            let now = Monotonic::shared().now();
            let news = news.into_inner().expect("no panic");
            assert!(news.iter().any(|line| line == DIRECTLY), "{news:?}");
            child.into_inner().expect("no panic").wait().expect("over");
            if !is_killed {
                assert_eq!((outcome, other), (Ok(expected), Ok(expected)));
                continue;
            }
            for ended in [outcome, other].map(|end| end.expect_err("one is gone")) {
                assert_eq!(ended.cause, Cause::Lost, "{ended}");
                assert_eq!(ended.client.as_deref(), Some("m1"), "{ended}");
                assert!(ended.steps >= 2000, "{ended}");
            }
            let killed = killed.into_inner().expect("no panic");
            let took = now - killed.expect("it was killed");
            assert!(took < Nanos::from_secs(5), "{took}");
        }
    }
}
