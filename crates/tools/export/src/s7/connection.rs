//! The description of a TCP connection, `TCON_IP_v4`.

use std::net::IpAddr;

use tickbus_net::{Address, Host};

/// A placeholder for the address of the simulator's computer, which the user has to replace.
const SOMEBODY: [u8; 4] = [192, 168, 0, 20];

/// Statements that fill in `#Connection` once; `address` is the one in the driver.cfg.
pub(super) fn lines(address: &Address, plc_dials: bool, notes: &mut Vec<String>) -> Vec<String> {
    let port = address.port;
    let stated = address;
    let (address, remark) = match (&stated.host, plc_dials) {
        (_, false) => ([0; 4], "the simulation's driver connects: any address"),
        (Host::Ip(IpAddr::V4(ip)), true) if !ip.is_unspecified() && !ip.is_loopback() => {
            (ip.octets(), "the simulator's computer, as in driver.cfg")
        }
        _ => {
            notes.push(format!(
                "driver.cfg listens on {}, which is no address that a PLC can dial: the source has {} in its place; put in \
                 that of the simulator's computer, and let the driver listen on \"0.0.0.0:{port}\"",
                stated,
                SOMEBODY.map(|byte| byte.to_string()).join(".")
            ));
            (SOMEBODY, "put the address of the simulator's computer here")
        }
    };
    let mut code = vec![
        "// The connection is described once.".to_owned(),
        "IF NOT #Is_prepared THEN".to_owned(),
        "   #Connection.InterfaceId := 64;   // the first PROFINET interface of the CPU".to_owned(),
        "   #Connection.ID := 1;   // not used by another connection of this CPU".to_owned(),
        "   #Connection.ConnectionType := 16#0B;   // TCP".to_owned(),
        format!(
            "   #Connection.ActiveEstablished := {};   // {}",
            if plc_dials { "TRUE" } else { "FALSE" },
            if plc_dials {
                "the PLC dials"
            } else {
                "the PLC waits"
            }
        ),
    ];
    for (number, byte) in address.iter().enumerate() {
        let remark = if number == 0 {
            format!("   // {remark}")
        } else {
            String::new()
        };
        code.push(format!(
            "   #Connection.RemoteAddress.ADDR[{}] := {byte};{remark}",
            number + 1
        ));
    }
    let (remote, local) = if plc_dials { (port, 0) } else { (0, port) };
    code.extend([
        format!("   #Connection.RemotePort := {remote};"),
        format!("   #Connection.LocalPort := {local};"),
        "   #Is_prepared := TRUE;".to_owned(),
        "END_IF;".to_owned(),
    ]);
    code
}
