//! Modbus/TCP Security with pymodbus at the other end, and certificates by openssl.
#![allow(missing_docs, clippy::float_cmp, reason = "a test")]

use std::net::TcpListener;
use std::path::Path;
use std::process::Command;

use crate::harness::{self, Absent, Test};
use crate::modbus::{ALLOWED, Server, loop_through, open, words};
use tickbus::fieldbus::LinkState;
use tickbus_conformance::rig::logged;

pub(crate) const TESTS: &[(&str, Test)] = &[
    (
        "pymodbus_writes_by_the_role_in_its_certificate",
        pymodbus_has_roles,
    ),
    ("our_client_drives_pymodbus_over_tls", our_client_over_tls),
];

/// An authority, and certificates: of a server at 127.0.0.1, of clients with and without a role, and of a stranger.
pub(crate) fn make_certificates(folder: &Path) -> Result<(), Absent> {
    const CURVE: &str = "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 30";
    const BY_CA: &str = "-CA ca.pem -CAkey ca.key -addext basicConstraints=CA:FALSE";
    const ROLE: &str = "-addext 1.3.6.1.4.1.50316.802.1=ASN1:UTF8String";
    harness::command_with("openssl", "version", "openssl")?;
    for (name, arguments) in [
        ("ca", String::new()),
        ("stranger", String::new()),
        (
            "server",
            format!("{BY_CA} -addext subjectAltName=IP:127.0.0.1"),
        ),
        ("guest", BY_CA.to_owned()),
        ("viewer", format!("{BY_CA} {ROLE}:Viewer")),
        ("operator", format!("{BY_CA} {ROLE}:Operator")),
    ] {
        let all = format!(
            "req -x509 {CURVE} -keyout {name}.key -out {name}.pem -subj /CN={name} {arguments}"
        );
        let mut openssl = Command::new("openssl");
        openssl.current_dir(folder).args(all.split_whitespace());
        let output = openssl.output().expect("it runs");
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{told}");
    }
    Ok(())
}

/// The table of an end with this certificate.
pub(crate) fn tls(folder: &Path, own: &str, authority: &str, more: &str) -> String {
    let at = |name: String| folder.join(name).display().to_string();
    let (own, key) = (at(format!("{own}.pem")), at(format!("{own}.key")));
    let authority = at(format!("{authority}.pem"));
    format!(
        "tls = {{ certificate_file = {own:?}, private_key_file = {key:?}, ca_file = {authority:?}{more} }}\n"
    )
}

fn pymodbus_has_roles() -> Result<(), Absent> {
    let mut python = harness::python_with("main", &["pymodbus"])?;
    let folder = tempfile::tempdir().expect("a folder");
    make_certificates(folder.path())?;
    let server = "kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\nmax_age = \"1h\"\n";
    let certificates = tls(
        folder.path(),
        "server",
        "ca",
        ", write_roles = [\"Operator\"]",
    );
    let mut machine = open(&format!("{server}{certificates}"), &words(4));
    let port = machine.address().port().to_string();
    python.current_dir(folder.path()).args([
        "-c",
        "import ssl, sys\n\
         from pymodbus.client import ModbusTlsClient\n\
         from pymodbus.exceptions import ModbusException\n\
         def client(own, version=None):\n\
         \x20   secured = ssl.create_default_context(cafile='ca.pem')\n\
         \x20   secured.check_hostname = False\n\
         \x20   if version: secured.maximum_version = version\n\
         \x20   if own: secured.load_cert_chain(f'{own}.pem', f'{own}.key')\n\
         \x20   made = ModbusTlsClient('127.0.0.1', port=int(sys.argv[1]), sslctx=secured, retries=0, timeout=5)\n\
         \x20   return made\n\
         for version in (ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3):\n\
         \x20   operator = client('operator', version)\n\
         \x20   assert operator.connect()\n\
         \x20   assert not operator.write_registers(0, [7, 8]).isError()\n\
         \x20   assert operator.read_holding_registers(0, count=2).registers == [7, 8]\n\
         \x20   operator.close()\n\
         for other in ('viewer', 'guest'):\n\
         \x20   reader = client(other)\n\
         \x20   assert reader.connect()\n\
         \x20   assert reader.read_holding_registers(0, count=2).registers == [7, 8]\n\
         \x20   assert reader.write_register(0, 9).exception_code == 1\n\
         \x20   assert reader.read_holding_registers(0, count=1).registers == [7]\n\
         \x20   reader.close()\n\
         for other in ('stranger', None):\n\
         \x20   refused = client(other)\n\
         \x20   try:\n\
         \x20       answer = refused.connect() and refused.read_holding_registers(0, count=1)\n\
         \x20       assert not answer or answer.isError(), f'{other} was served'\n\
         \x20   except (ModbusException, ssl.SSLError, OSError):\n\
         \x20       pass\n\
         \x20   refused.close()\n",
        &port,
    ]);
    machine.until_the_end_of(python, crate::harness::machine::Machine::tick);
    machine.until("the write is through", |machine| machine.get("q 0") == 7.0);
    machine.until("the reason is known", |machine| {
        machine.driver.link().reason.contains("certificate")
    });
    assert_eq!(machine.statistic("modbus-server.illegal_function"), "2");
    Ok(())
}

fn our_client_over_tls() -> Result<(), Absent> {
    let folder = tempfile::tempdir().expect("a folder");
    make_certificates(folder.path())?;
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("it is bound");
    drop(listener);
    let (ip, port) = (address.ip().to_string(), address.port().to_string());
    let certificates = folder.path().display().to_string();
    let _server = Server::start(&["tls", &ip, &port, &certificates])?;
    let client = format!("kind = \"modbus-client\"\naddress = \"{address}\"\n{ALLOWED}\n");
    let own = tls(folder.path(), "operator", "ca", "");
    for (keys, count) in [
        ("inputs = \"offset:0\"", 64),
        ("inputs = \"offset:1000\"\noutputs = \"401001\"", 300),
    ] {
        let machine = loop_through(&format!("{client}{own}{keys}"), count);
        machine.end.driver.close();
    }
    // The server does not trust this client; this client does not trust the server; the server has another name.
    logged::expect("127.0.0.1");
    for (tls, reason) in [
        (
            tls(folder.path(), "stranger", "ca", ""),
            "let it trust the authority of certificate_file",
        ),
        (
            tls(folder.path(), "operator", "stranger", ""),
            "is not signed by an authority of ca_file",
        ),
        (
            tls(folder.path(), "operator", "ca", ", server_name = \"plc-7\""),
            "its certificate is for another name",
        ),
    ] {
        let mut machine = open(&format!("{client}{tls}inputs = \"offset:0\""), &words(2));
        machine.until(reason, |machine| {
            let link = machine.driver.link();
            link.state != LinkState::Running && link.reason.contains(reason)
        });
        machine.end.driver.close();
    }
    Ok(())
}
