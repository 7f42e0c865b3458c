//! A libmodbus server.

use std::ffi::{CString, c_char, c_int, c_void};
use std::net::SocketAddr;

use libloading::{Library, Symbol};

type New = unsafe extern "C" fn(*const c_char, c_int) -> *mut c_void;
type Mapping = unsafe extern "C" fn(c_int, c_int, c_int, c_int) -> *mut c_void;
type Listen = unsafe extern "C" fn(*mut c_void, c_int) -> c_int;
type Accept = unsafe extern "C" fn(*mut c_void, *mut c_int) -> c_int;
type Receive = unsafe extern "C" fn(*mut c_void, *mut u8) -> c_int;
type Reply = unsafe extern "C" fn(*mut c_void, *const u8, c_int, *mut c_void) -> c_int;

/// The longest telegram over TCP.
const LONGEST: usize = 260;

/// Prints the address, and serves one client of it until that leaves; returns at once if libmodbus is not installed.
pub(crate) fn serve(address: SocketAddr) {
    // SAFETY: libmodbus runs no code when it is loaded.
    let Ok(library) = (unsafe { Library::new("libmodbus.so.5") }) else {
        return;
    };
    let host = CString::new(address.ip().to_string()).expect("digits");
    let port = c_int::from(address.port());
    // SAFETY: the types are those of modbus.h and modbus-tcp.h, and the library outlives its functions.
    // The context and the mapping belong to the library; libmodbus
    // guarantees that a request fits into the buffer.
    unsafe {
        let symbol = |name: &[u8]| -> Symbol<'_, *const ()> {
            library.get(name).expect("a function of libmodbus")
        };
        let new: New = std::mem::transmute(*symbol(b"modbus_new_tcp"));
        let mapping: Mapping = std::mem::transmute(*symbol(b"modbus_mapping_new"));
        let listen: Listen = std::mem::transmute(*symbol(b"modbus_tcp_listen"));
        let accept: Accept = std::mem::transmute(*symbol(b"modbus_tcp_accept"));
        let receive: Receive = std::mem::transmute(*symbol(b"modbus_receive"));
        let reply: Reply = std::mem::transmute(*symbol(b"modbus_reply"));
        let context = new(host.as_ptr(), port);
        let tables = mapping(0, 0, 2048, 2048);
        assert!(!context.is_null() && !tables.is_null());
        let mut socket = listen(context, 1);
        assert!(socket >= 0);
        println!("{address}");
        accept(context, &raw mut socket);
        let mut query = [0; LONGEST];
        loop {
            let length = receive(context, query.as_mut_ptr());
            if length < 0 {
                break;
            }
            reply(context, query.as_ptr(), length, tables);
        }
    }
}
