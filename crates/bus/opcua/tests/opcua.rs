//! The OPC UA buses: the conformance suite with each of them at either end.
#![allow(
    missing_docs,
    unreachable_pub,
    dead_code,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers, and the peers of TCP are used in part"
)]

use std::io::Write;
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use tickbus_conformance as conformance;
use tickbus_conformance::conformance;

use conformance::peers::{leave, lying, own_address};
use conformance::rig::{Bus, End, Liar, await_that, logged, pass, statistic};
use tickbus_base::time::Manual;
use tickbus_bus_opcua::{ClientOptions, ServerOptions};
use tickbus_driver_cfg::{Config, Kind, Kinds};

/// The kinds of this crate.
static KINDS: Kinds = Kinds::new(&[Kind::of::<ServerOptions>(), Kind::of::<ClientOptions>()]);

conformance!(device_serves, crate::OpcUa::new("device"));
conformance!(device_is_client, crate::OpcUa::new("controller"));

/// A server and a client without protection, at an address used by one test only.
struct OpcUa {
    address: SocketAddr,
    /// The role of the server.
    server: &'static str,
}

impl OpcUa {
    fn new(server: &'static str) -> Self {
        Self {
            address: own_address(),
            server,
        }
    }
}

impl Bus for OpcUa {
    fn kinds(&self) -> &'static tickbus_driver_cfg::Kinds {
        &KINDS
    }

    fn fieldbus(&self, role: &str) -> String {
        let Self { address, server } = self;
        if role == *server {
            format!(
                "kind = \"opcua-server\"\naddress = \"{address}\"\nsecurity = \"None\"\nanonymous = true"
            )
        } else {
            // The other end is named after its role.
            format!(
                "kind = \"opcua-client\"\nurl = \"opc.tcp://{address}\"\nsecurity = \"None\"\n\
                 write_to = \"urn:tickbus:{server} tickbus\""
            )
        }
    }

    /// The peer sends bytes that are not OPC UA.
    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        let listens = self.server == "controller";
        let (cause, words) = if listens {
            ("protocol", "does not answer as an OPC UA server")
        } else {
            // A server keeps waiting for a valid client.
            ("waiting", "nobody has written yet")
        };
        Liar {
            peer: lying(self.address, listens, lie),
            cause,
            words,
        }
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            ("kind = \"opcua-client\"", "url"),
            (
                "kind = \"opcua-client\"\nurl = \"192.168.0.1:4840\"",
                "does not begin with",
            ),
            (
                "kind = \"opcua-client\"\nurl = \"opc.tcp://h\"\nsecurity = \"Basic256sha256\"",
                "did you mean \"Basic256Sha256\"",
            ),
            (
                "kind = \"opcua-client\"\nurl = \"opc.tcp://h\"\nuser = \"a\"",
                "without a password",
            ),
            (
                "kind = \"opcua-client\"\nurl = \"opc.tcp://h\"\nnode_pattern = \"ns=2;s=x\"",
                "has no {name}",
            ),
            (
                "kind = \"opcua-client\"\nurl = \"opc.tcp://h\"\nnodes = { \"t\" = \"ns=2;s=x\" }",
                "no signal is called",
            ),
            ("kind = \"opcua-server\"", "anonymous"),
            (
                "kind = \"opcua-server\"\nanonymous = false",
                "nobody may log in",
            ),
            (
                "kind = \"opcua-server\"\nanonymous = true\naddress = \"127.0.0.1\"",
                "has no port",
            ),
            (
                "kind = \"opcua-server\"\nanonymous = true\nsecurity = []",
                "names no policy",
            ),
        ]
    }
}

/// In a station that is only written, nothing can grow old except the server itself.
#[test]
fn a_station_of_which_nothing_is_read_is_fresh_while_its_server_is_there() {
    const STATIONS: &str = "[[station]]\nname = \"drive\"\n[[station]]\nname = \"display\"\n\
        [[signal]]\nname = \"speed\"\nstation = \"drive\"\naddress = \"%QW0\"\ntype = \"INT\"\n\
        [[signal]]\nname = \"shown\"\nstation = \"display\"\naddress = \"%IW0\"\ntype = \"INT\"\n";
    let clock = Manual::new();
    let bus = OpcUa::new("controller");
    let open = |role: &str| {
        let text = format!(
            "[driver]\nid = 1\nname = \"{role}\"\n[fieldbus]\n{}\nrole = \"{role}\"\ncycle = \"1ms\"\n\
             max_age = \"300ms\"\nreconnect = [\"10ms\"]\n{STATIONS}",
            bus.fieldbus(role)
        );
        End::open(&text, &clock, &KINDS)
    };
    let (mut device, mut controller) = (open("device"), open("controller"));
    let stale = |device: &End| {
        ["drive", "display"]
            .map(|name| device.statistic(&format!("station.{name}.stale")) == "true")
    };
    let mut speed = 0.0;
    // Constant changes leave the server no need for signs of life.
    let mut ticks = |device: &mut End| {
        pass(&clock, 2);
        speed = (speed + 1.0) % 1000.0;
        controller.set("speed", speed);
        controller.tick();
        device.set("shown", 7.0);
        device.tick();
        controller.get("shown") == 7.0 && device.get("speed") > 0.0
    };
    await_that("both stations are fresh", || {
        ticks(&mut device) && stale(&device) == [false, false]
    });
    // For longer than a server may be silent.
    for _ in 0..1000 {
        ticks(&mut device);
    }
    await_that("both stations are fresh still", || {
        ticks(&mut device);
        stale(&device) == [false, false]
    });
    controller.driver.close();
    await_that("both are stale", || {
        pass(&clock, 1);
        device.tick();
        stale(&device) == [true, true]
    });
}

#[test]
fn a_second_writer_is_counted_or_refused_until_the_first_one_has_left() {
    for (further, is_single) in [("", false), ("writers = 1", true)] {
        let (bus, clock) = (OpcUa::new("device"), Manual::new());
        let open = |role, further| {
            End::open(
                &conformance::rig::config(&bus, role, further),
                &clock,
                &KINDS,
            )
        };
        let (mut device, mut first) = (open("device", further), open("controller", ""));
        // The first one counts up below 100, the second one from 100 on.
        let mut count = 0.0;
        let mut turn = |device: &mut End, controllers: &mut [(&mut End, f64)]| {
            count = (count + 1.0) % 100.0;
            for (end, base) in controllers {
                end.set("speed", *base + count);
                end.tick();
            }
            pass(&clock, 3);
            device.tick();
        };
        let has_speed =
            |device: &End, base: f64| (base..base + 100.0).contains(&device.get("speed"));
        await_that("the first one writes", || {
            turn(&mut device, &mut [(&mut first, 0.0)]);
            has_speed(&device, 0.0)
        });
        logged::expect("each undoes what the other one does");
        if is_single {
            logged::expect("BadUserAccessDenied");
        }
        let mut second = open("controller", "");
        await_that("the second one is told", || {
            turn(&mut device, &mut [(&mut first, 0.0), (&mut second, 100.0)]);
            assert!(!is_single || device.get("speed") < 100.0, "it is refused");
            statistic(&device.driver, "opcua.second_writer").is_some()
                && (is_single || has_speed(&device, 100.0))
        });
        first.driver.close();
        await_that("the second one is the only one", || {
            turn(&mut device, &mut [(&mut second, 100.0)]);
            has_speed(&device, 100.0)
        });
    }
}

/// Lines of `[fieldbus.at]` that name no member of the variables in tests/peers/axes.NodeSet2.xml.
#[test]
fn a_line_that_names_no_single_value_is_a_mistake() {
    let model = include_str!("../../../../tests/peers/axes.NodeSet2.xml");
    for (places, part) in [
        (&["6005.Points[2].X"][..], "the last element is [1]"),
        (&["6005.Points[0].Z"], "the members are X, Y"),
        (&["6005.Points"], "an array is not a single value"),
        (&["6007.Place"], "a structure is not a single value"),
        (
            &["6009.Reel"],
            "the members are Whole, Real, Place, SwitchField",
        ),
        (&["6009[0]"], "a structure has members"),
        (
            &["6009.Place.X", "6009.Real"],
            "has one member at a time; give a signal to its .SwitchField, too",
        ),
        (&["6009.SwitchField"], "of type UInt32"),
    ] {
        let named = places.iter().enumerate();
        let lines = named.map(|(at, place)| format!("\"s{at}\" = \"ns=2;i={place}\"\n"));
        let signals = (0..places.len()).map(|at| {
            format!(
                "[[signal]]\nname = \"s{at}\"\naddress = \"%ID{}\"\ntype = \"REAL\"\n",
                4 * at
            )
        });
        let text = format!(
            "[driver]\nid = 1\nname = \"axes\"\n[fieldbus]\nkind = \"opcua-server\"\naddress = \"127.0.0.1:0\"\n\
             security = \"None\"\nanonymous = true\nnodeset = \"axes.NodeSet2.xml\"\n[fieldbus.at]\n{}{}",
            lines.collect::<String>(),
            signals.collect::<String>()
        );
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("driver.cfg");
        std::fs::write(&file, text).expect("it is written");
        std::fs::write(folder.path().join("axes.NodeSet2.xml"), model).expect("it is written");
        let told = Config::load(&file, &KINDS).expect_err("a mistake");
        let told = told.to_string();
        assert!(told.contains(part), "{places:?}: {told}");
    }
}

/// Sends data that are no OPC UA, and leaves properly.
fn lie(mut stream: TcpStream) {
    // The other end may have closed first.
    let _ = stream.set_nonblocking(false);
    let _ = stream.write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n");
    leave(stream);
}
