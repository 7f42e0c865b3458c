//! The plug-in bus: the conformance suite over the UDP example, and libraries that misbehave.
#![cfg(all(target_os = "linux", not(no_cc)))]
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

mod fixture;
mod isolation;

use std::fs;
use std::net::UdpSocket;
use std::path::Path;
use std::process::Command;
use tickbus_conformance as conformance;
use tickbus_conformance::conformance;

use conformance::rig::{CYCLE, End, await_that, eventually, logged};
use fixture::{HELPER, Misbehaving, Udp, build, misbehaving, until, until_by, until_it_echoes};
use tickbus::driver::{Code, Driver};
use tickbus::driver_cfg::Config;
use tickbus::fieldbus::{Events, plugin};
use tickbus::time::{Manual, Monotonic, Nanos};

conformance!(plain, crate::Udp::new(false));
conformance!(isolated, crate::Udp::new(true));

const BOTH: [bool; 2] = [false, true];

#[test]
fn each_error_of_open_and_exchange_has_its_cause_and_its_words() {
    for isolated in BOTH {
        for function in ["open", "exchange"] {
            for (what, cause, words) in [
                (
                    "link",
                    "link",
                    "the link failed: libmisbehave.so: no cable; next",
                ),
                (
                    "protocol",
                    "protocol",
                    "the protocol was broken: libmisbehave.so: no cable",
                ),
                ("refused", "refused", "refused: libmisbehave.so: no cable"),
                ("config", "refused", "refused: libmisbehave.so: no cable"),
                (
                    "unsupported",
                    "refused",
                    "refused: libmisbehave.so: no cable",
                ),
                (
                    "-77",
                    "protocol",
                    "returned -77 (no cable), which include/tickbus_fieldbus.h",
                ),
                ("64", "protocol", "returned 64"),
            ] {
                let options = format!("{function} = \"{what}\", text = \"no cable\"");
                let clock = Manual::new();
                let mut end = Misbehaving::new(isolated, &options).open(&clock);
                let reason = until(&end, &clock, "failed", cause);
                assert!(reason.contains(words), "{function} {what}: {reason}");
                assert!(reason.contains("; next attempt in 1s"), "{reason}");
                assert_eq!(end.tick().code, Code::Stale);
                end.driver.close();
            }
        }
    }
}

#[test]
fn a_line_that_failed_once_comes_back() {
    for isolated in BOTH {
        for function in ["open", "exchange"] {
            let plugin = Misbehaving::once(isolated, &format!("{function} = \"link\""));
            let clock = Manual::new();
            let mut end = plugin.open(&clock);
            until(&end, &clock, "failed", "link");
            until_it_echoes(&mut end, &clock, 7.0);
            assert_eq!(end.statistic("state"), "running");
        }
    }
}

/// A machine by hand at the other end of the UDP example, until the controller says good-bye: returns its last received
/// image.
fn last_image(socket: &UdpSocket) -> Vec<u8> {
    const HEADER: usize = 20;
    let (mut datagram, mut last) = ([0; 100], Vec::new());
    loop {
        let (size, controller) = socket.recv_from(&mut datagram).expect("a datagram");
        match datagram[7] {
            1 => {
                last = datagram[HEADER..size].to_vec();
                // The answer has the session and the sequence of the request.
                datagram[7] = 2;
                datagram[HEADER + 2..HEADER + 4].copy_from_slice(&last[2..4]);
                socket
                    .send_to(&datagram[..size], controller)
                    .expect("it is there");
            }
            _ => return last,
        }
    }
}

#[test]
fn a_controller_that_closes_leaves_its_fail_safe_values_behind() {
    for isolated in BOTH {
        for (further, speed) in [("", -1_i16), ("at_close = \"hold\"", 10)] {
            let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
            let address = socket.local_addr().expect("bound");
            let machine = std::thread::spawn(move || last_image(&socket));
            let bus = Udp::at(isolated, &address.to_string());
            let text =
                conformance::rig::config(&bus, "controller", further).replace("300ms", "20s");
            let mut end = End::open(&text, &Monotonic::shared(), &tickbus::KINDS);
            end.set("speed", 10.0);
            eventually("the machine runs", || {
                end.tick();
                (end.get("position") == 10.0).then_some(())
            });
            end.driver.close();
            let last = machine.join().expect("no panic");
            assert_eq!(last[2..4], speed.to_be_bytes(), "{isolated} {further}");
        }
    }
}

#[test]
fn a_peer_that_left_is_waited_for_without_a_pause() {
    for isolated in BOTH {
        let options = "exchange = \"left\", text = \"gone home\", good = 3";
        let clock = Manual::new();
        let plugin = Misbehaving::once(isolated, options);
        let mut end = plugin.open(&clock);
        await_that("the peer is back", || {
            clock.advance(CYCLE);
            end.statistic("link.running") == "2"
        });
        let statistics = end.driver.statistics();
        assert!(statistics.contains("\ncause.left=1\n"), "{statistics}");
        assert!(!statistics.contains("\ncause.link="), "{statistics}");
        until_it_echoes(&mut end, &clock, 8.0);
    }
}

#[test]
fn silence_is_waiting_at_first_and_stale_later() {
    for isolated in BOTH {
        let clock = Manual::new();
        let end = Misbehaving::new(isolated, "exchange = \"silent\"").open(&clock);
        await_that("the bus is open", || {
            clock.advance(CYCLE);
            end.statistic("reason") == "the bus is open; waiting for the peer"
        });
        let mut end = Misbehaving::new(isolated, "exchange = \"silent\", good = 3").open(&clock);
        until(&end, &clock, "running", "running");
        until(&end, &clock, "stale", "silent");
        assert_eq!(end.tick().code, Code::Stale);
    }
}

#[test]
fn signs_of_life_without_data_keep_the_line_running() {
    let clock = Manual::new();
    let mut end = Misbehaving::new(false, "exchange = \"alive\", good = 3").open(&clock);
    until(&end, &clock, "running", "running");
    let mut unchanged = 0;
    await_that("there was life for a long time", || {
        clock.advance(CYCLE);
        unchanged += u32::from(end.tick().code == Code::Unchanged);
        unchanged > 1000
    });
    assert_eq!(end.statistic("state"), "running");
}

/// Longer than a call may take without being counted, and shorter than one that hangs.
const SLOW: Nanos = Nanos::from_millis(50);

#[test]
fn calls_that_are_longer_than_the_cycle_leave_cycles_out() {
    for isolated in BOTH {
        let clock = Manual::new();
        let mut end = Misbehaving::new(isolated, "exchange = \"slow\", ms = 3").open(&clock);
        await_that("slow calls are counted", || {
            // One step is enough for a call in progress.
            clock.advance(SLOW);
            end.tick();
            let statistics = end.driver.statistics();
            statistics.contains("\nplugin.slow_calls=")
        });
        until_it_echoes(&mut end, &clock, 3.0);
        end.driver.close();
    }
}

#[test]
fn writing_behind_out_is_told_as_the_librarys_mistake() {
    for isolated in BOTH {
        let options = "exchange = \"beyond\", bytes = 9, good = 2";
        let clock = Manual::new();
        let end = Misbehaving::new(isolated, options).open(&clock);
        let reason = until(&end, &clock, "failed", "protocol");
        let words = "tickbus_exchange wrote at least 9 bytes behind the 6 bytes of `out`";
        assert!(reason.contains(words), "{reason}");
    }
}

/// True if `library` is mapped into this process.
fn is_loaded(library: &Path) -> bool {
    let maps = fs::read_to_string("/proc/self/maps").expect("the system tells");
    maps.contains(library.to_str().expect("UTF-8"))
}

#[test]
fn a_plain_call_that_never_returns_is_told_and_closing_leaves_it_behind_with_its_library() {
    logged::expect("and its thread is left behind");
    for function in ["open", "exchange", "close"] {
        let mut plugin = Misbehaving::new(false, "").with_own_library();
        let release = plugin.file("release");
        plugin.options = format!("{function} = \"hang\", release = \"{}\"", release.display());
        plugin.extra =
            "open_timeout = \"5s\"\ncall_timeout = \"5s\"\nclose_timeout = \"20ms\"\n".to_owned();
        let clock = Manual::new();
        let end = plugin.open(&clock);
        // On a busy machine loading takes some time, which the test's clock must not count.
        await_that("the library is loaded", || is_loaded(&plugin.library));
        if function == "close" {
            until(&end, &clock, "running", "running");
        } else {
            let words = format!("tickbus_{function}() of libown.so has not returned for");
            // The test's clock does not wait for the end of loading either, which may seem to hang for a moment.
            await_that(&words, || {
                until_by(Nanos::from_secs(1), &end, &clock, "stale", "hung").contains(&words)
            });
        }
        end.driver.close();
        assert!(is_loaded(&plugin.library), "its code is still running");
        fs::write(release, "").expect("written");
        await_that(
            "the call returns, and the thread unloads the library",
            || !is_loaded(&plugin.library),
        );
    }
}

#[test]
fn a_plain_call_that_never_returns_is_told_though_nobody_asks() {
    let told = "is stale: tickbus_exchange() of libown.so has not returned";
    logged::expect(told);
    let mut plugin = Misbehaving::new(false, "").with_own_library();
    let release = plugin.file("release");
    plugin.options = format!("exchange = \"hang\", release = \"{}\"", release.display());
    plugin.extra = "call_timeout = \"5s\"\nclose_timeout = \"20ms\"\n".to_owned();
    let clock = Manual::new();
    let end = plugin.open(&clock);
    await_that("the log tells it", || {
        clock.advance(Nanos::from_secs(1));
        logged::times(told) > 0
    });
    fs::write(release, "").expect("written");
    end.driver.close();
}

#[test]
fn a_closed_driver_has_unloaded_its_library() {
    let plugin = Misbehaving::new(false, "").with_own_library();
    let clock = Manual::new();
    let mut end = plugin.open(&clock);
    until_it_echoes(&mut end, &clock, 2.0);
    assert!(is_loaded(&plugin.library));
    end.driver.close();
    assert!(!is_loaded(&plugin.library));
}

#[track_caller]
fn refused(plugin: &Misbehaving) -> String {
    let config =
        Config::parse("cell/driver.cfg", &plugin.text(), &tickbus::KINDS).expect("a right file");
    let error = Driver::open(config, Manual::new()).expect_err("refused");
    assert_eq!(error.code(), Code::BadConfig);
    error.to_string()
}

#[test]
fn a_library_or_helper_that_is_not_there_is_refused_with_the_path_that_was_looked_for() {
    let mut plugin = Misbehaving::new(false, "");
    plugin.library = "libnone.so".into();
    let error = refused(&plugin);
    let path = std::path::absolute("cell/libnone.so").expect("a path");
    let words = format!(
        "cell/driver.cfg: there is no library {}; check",
        path.display()
    );
    assert!(error.starts_with(&words), "{error}");

    let mut plugin = Misbehaving::new(false, "");
    plugin.extra += "isolated = true\nhelper = \"/no/such/tickbus\"\n";
    let error = refused(&plugin);
    assert!(
        error.contains("`helper` in the driver.cfg (/no/such/tickbus is not there"),
        "{error}"
    );
}

#[test]
fn what_cannot_be_loaded_is_told_in_the_loaders_words_and_tried_again() {
    for isolated in BOTH {
        let mut plugin = Misbehaving::new(isolated, "");
        plugin.library = plugin.file("libown.so");
        fs::write(&plugin.library, "no library").expect("written");
        let clock = Manual::new();
        let mut end = plugin.open(&clock);
        let reason = until(&end, &clock, "failed", "link");
        assert!(reason.contains("libown.so cannot be loaded: "), "{reason}");
        fs::remove_file(&plugin.library).expect("removed");
        fs::copy(misbehaving(), &plugin.library).expect("copied");
        until_it_echoes(&mut end, &clock, 4.0);
    }
}

#[test]
fn a_library_that_is_no_plug_in_is_told_so() {
    for isolated in BOTH {
        for (switch, words) in [
            (
                "-DVERSION=2",
                "is made for version 2 of the plug-in interface, this tickbus has version 1",
            ),
            ("-DWITHOUT_EXCHANGE", "does not export tickbus_exchange"),
        ] {
            let name = format!("lib{}{isolated}.so", &switch[2..6].to_lowercase());
            let mut plugin = Misbehaving::new(isolated, "");
            plugin.library = build("tests/plugins/misbehave.c", &[switch], &name);
            let clock = Manual::new();
            let end = plugin.open(&clock);
            let reason = until(&end, &clock, "failed", "protocol");
            assert!(reason.contains(words), "{reason}");
        }
    }
}

#[test]
fn the_table_reads_whole_and_has_defaults() {
    let parse = |lines: &str| {
        let text = format!(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"plugin\"\nlibrary = \"libx.so\"\n{lines}\n\
             [[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n"
        );
        let config = Config::parse("driver.cfg", &text, &tickbus::KINDS).expect("right");
        let options: Option<&plugin::Options> = config.bus.downcast_ref();
        (options.expect("a plug-in").clone(), config.events)
    };
    let (millis, seconds) = (Nanos::from_millis, Nanos::from_secs);
    let mut expected = plugin::Options {
        library: "libx.so".into(),
        options: Vec::new(),
        timeout: None,
        open_timeout: seconds(10),
        call_timeout: seconds(1),
        close_timeout: seconds(2),
        isolated: false,
        helper: None,
    };
    assert_eq!(parse(""), (expected.clone(), Events::None));
    let lines = "options = { sync = true, card = 1_000, mask = 0x1F, baud = 1.5e6, \"a b\" = \"ä\" }\n\
                 timeout = \"5ms\"\nopen_timeout = \"6ms\"\ncall_timeout = \"7ms\"\n\
                 close_timeout = \"8ms\"\nisolated = true\nhelper = \"bin/tickbus\"\nevents = true";
    let options = [
        ("a b", "ä"),
        ("baud", "1.5e6"),
        ("card", "1000"),
        ("mask", "0x1F"),
        ("sync", "true"),
    ];
    expected.options = options
        .map(|(key, value)| (key.to_owned(), value.to_owned()))
        .into();
    expected.timeout = Some(millis(5));
    expected.open_timeout = millis(6);
    expected.call_timeout = millis(7);
    expected.close_timeout = millis(8);
    expected.isolated = true;
    expected.helper = Some("bin/tickbus".into());
    assert_eq!(parse(lines), (expected, Events::Changes));
}

#[test]
fn check_tells_what_the_bus_is() {
    let plugin = Misbehaving::new(true, "card = 1");
    let file = plugin.file("driver.cfg");
    fs::write(&file, plugin.text()).expect("written");
    let output = Command::new(HELPER).arg("check").arg(file).output();
    let printed = String::from_utf8(output.expect("runs").stdout).expect("text");
    let library = misbehaving().display();
    let bus = format!("bus       plugin, library {library}, in a helper process, card 1\n");
    assert!(printed.contains(&bus), "{printed}");
}

#[test]
fn the_smallest_plug_in_of_the_docs_works() {
    let docs = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/plugin.md"));
    let docs = docs.expect("the docs");
    let (_, code) = docs.split_once("```c\n").expect("a plug-in in C");
    let (code, _) = code.split_once("```").expect("its end");
    let mut plugin = Misbehaving::new(false, "");
    let source = plugin.file("smallest.c");
    fs::write(&source, code).expect("written");
    plugin.library = build(&source, &[], "libsmallest.so");
    let clock = Manual::new();
    until_it_echoes(&mut plugin.open(&clock), &clock, 9.0);
}
