//! Tests in which third-party software is the other end, in one program with a harness that reports what is not installed.
#![allow(missing_docs, reason = "tests")]

mod block;
#[cfg(feature = "mqtt")]
mod bridge;
#[cfg(unix)]
mod bridge_bus;
#[cfg(unix)]
#[path = "../peers/commands.rs"]
mod commands;
mod devices;
mod doctor;
#[cfg(all(unix, feature = "page"))]
#[path = "../peers/edited.rs"]
mod edited;
#[path = "../it/fmi/fixture.rs"]
mod fixture;
mod fmi;
mod gateway;
mod harness;
mod helics;
mod iec2c;
#[cfg(feature = "opcua")]
mod java;
#[cfg(target_os = "linux")]
mod libmodbus;
mod machines;
#[cfg(feature = "page")]
mod metrics;
mod modbus;
mod modbus_functions;
mod modbus_lines;
#[cfg(feature = "modbus-tls")]
mod modbus_tls;
#[cfg(feature = "page")]
mod observed_rig;
mod observer;
#[cfg(feature = "opcua")]
mod opcua;
#[cfg(feature = "page")]
mod page;
mod plc;
#[path = "../it/export/plcopen.rs"]
mod plcopen;
mod prepare;
#[cfg(unix)]
#[path = "../peers/pty.rs"]
mod pty;
mod s7;
mod schema;
mod second_ivi;
mod silkit;
mod st;
#[cfg(all(unix, feature = "page"))]
mod taken;
mod vcd;

use std::process::ExitCode;

fn main() -> ExitCode {
    // The longest first.
    harness::main(&[
        #[cfg(feature = "opcua")]
        ("java", java::TESTS),
        ("fmi", fmi::TESTS),
        ("prepare", prepare::TESTS),
        ("iec2c", iec2c::TESTS),
        ("block", block::TESTS),
        ("machines", machines::TESTS),
        ("s7", s7::TESTS),
        #[cfg(feature = "opcua")]
        ("opcua", opcua::TESTS),
        ("modbus", modbus::TESTS),
        #[cfg(target_os = "linux")]
        ("libmodbus", libmodbus::TESTS),
        ("modbus_functions", modbus_functions::TESTS),
        ("modbus_lines", modbus_lines::TESTS),
        #[cfg(feature = "modbus-tls")]
        ("modbus_tls", modbus_tls::TESTS),
        ("devices", devices::TESTS),
        ("doctor", doctor::TESTS),
        #[cfg(feature = "page")]
        ("observed_rig", observed_rig::TESTS),
        ("observer", observer::TESTS),
        #[cfg(feature = "mqtt")]
        ("bridge", bridge::TESTS),
        #[cfg(unix)]
        ("bridge_bus", bridge_bus::TESTS),
        #[cfg(feature = "page")]
        ("page", page::TESTS),
        #[cfg(feature = "page")]
        ("metrics", metrics::TESTS),
        #[cfg(all(unix, feature = "page"))]
        ("taken", taken::TESTS),
        ("gateway", gateway::TESTS),
        ("helics", helics::TESTS),
        ("silkit", silkit::TESTS),
        ("st", st::TESTS),
        ("vcd", vcd::TESTS),
        ("plc", plc::TESTS),
        ("second_ivi", second_ivi::TESTS),
        ("schema", schema::TESTS),
    ])
}
