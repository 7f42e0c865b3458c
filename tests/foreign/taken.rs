//! A machine that runs goes from one foreign PLC to another, because its page has edited its driver.cfg.

use serde_json::json;
use tickbus_conformance::rig::eventually;

use crate::edited::Edited;
use crate::harness::{Absent, Test};
use crate::observer::{Server, free_port};

pub(crate) const TESTS: &[(&str, Test)] = &[(
    "a_machine_goes_from_one_pymodbus_to_another_without_a_restart",
    pymodbus,
)];

fn await_speed(machine: &Edited, speed: i32) {
    eventually("it has the speed of this PLC", || {
        (machine.value(0) == json!(speed)).then_some(())
    });
}

fn pymodbus() -> Result<(), Absent> {
    let ports = [free_port(), free_port()];
    let [mut first, mut second] = [
        Server::start("modbus", ports[0])?,
        Server::start("modbus", ports[1])?,
    ];
    let [here, there] = ports.map(|port| format!("127.0.0.1:{port}"));
    let text = format!(
        "[driver]\nid = 7\nname = \"Cell\"\n[fieldbus]\nkind = \"modbus-client\"\naddress = \"{here}\"\n\
         cycle = \"5ms\"\nreconnect = [\"20ms\"]\n[[signal]]\nname = \"Speed\"\naddress = \"%QW2\"\ntype = \"INT\"\n"
    );
    let machine = Edited::start(&text, &["--edit"]);
    first.obey("0 11");
    second.obey("0 22");
    await_speed(&machine, 11);
    let (status, why) = machine.set("address", &here, &there);
    assert_eq!(status, 200, "{why}");
    await_speed(&machine, 22);
    first.obey("0 12");
    second.obey("0 23");
    await_speed(&machine, 23);
    let (status, why) = machine.set("address", &there, &here);
    assert_eq!(status, 200, "{why}");
    await_speed(&machine, 12);
    // A simulated machine writes into no PLC unless "write_to" names it.
    assert_eq!((first.obey("count"), second.obey("count")), (0, 0));
    let (last, code) = machine.command.interrupt();
    assert!(last.starts_with("mirror: ok"), "{last}");
    assert_eq!(code, Some(0));
    Ok(())
}
