//! Tests of driver.cfg files that name the kinds of the list.

mod overlay;
mod rig;

use std::collections::BTreeSet;

#[cfg(not(feature = "opcua"))]
use tickbus_base::time::Manual;
#[cfg(not(feature = "opcua"))]
use tickbus_driver::{Code, Driver};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::Events;

use crate::KINDS;

#[test]
fn no_two_kinds_have_one_name() {
    let names = KINDS.names();
    assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len());
}

#[test]
fn single_writes_are_events_where_the_bus_learns_of_them() {
    for (kind, may) in [
        ("modbus-server", true),
        ("s7-server", true),
        ("opcua-server\"\nanonymous = true\nhost = \"a", true),
        ("loopback\"\nlink = \"cell", false),
        ("socket", false),
    ] {
        let read = |events: &str| {
            let text = format!(
                "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\nkind = \"{kind}\"\n{events}\n\
                 [[signal]]\nname = \"A\"\naddress = \"%QW0\"\n"
            );
            Config::parse("test.cfg", &text, &KINDS).map(|config| config.events)
        };
        assert_eq!(read(""), Ok(Events::None), "{kind}");
        assert_eq!(read("events = false"), Ok(Events::None), "{kind}");
        assert_eq!(read("events = true"), Ok(Events::Changes), "{kind}");
        let writes = read("events = \"writes\"");
        assert_eq!(writes.ok(), may.then_some(Events::Writes), "{kind}");
    }
}

#[cfg(not(feature = "opcua"))]
#[test]
fn a_bus_that_is_not_in_this_build_says_how_to_get_it() {
    for table in [
        "kind = \"opcua-client\"\nurl = \"opc.tcp://127.0.0.1\"",
        "kind = \"opcua-server\"\nanonymous = true",
    ] {
        let text = format!(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\n{table}\n\
             [[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n"
        );
        let config = Config::parse("driver.cfg", &text, &KINDS).expect("a right file");
        let error = Driver::open(config, Manual::new()).expect_err("it is not there");
        assert_eq!(error.code(), Code::Unsupported);
        let told = error.to_string();
        for part in ["driver.cfg: ", "opcua-", "--features opcua", "make dist"] {
            assert!(told.contains(part), "\"{part}\" in {told}");
        }
    }
}
