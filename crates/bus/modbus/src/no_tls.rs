//! The same as `tls`, in a build without TLS: nothing can be loaded, so nothing else is reached.

use std::convert::Infallible;
use std::path::Path;

use tickbus_base::Mistake;
use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::examine::Wire;
use tickbus_fieldbus::tcp::{Call, Caller};
use tickbus_fieldbus::{BusError, OpenError, Port};
use tickbus_net::{Address, Stream};

use crate::restricts::Restricts;
use crate::tls_options::Tls;

#[derive(Clone, Debug)]
pub(crate) struct ServerSide(Infallible);

#[derive(Clone, Debug)]
pub(crate) struct ClientSide(Infallible);

#[allow(clippy::unnecessary_wraps, reason = "the same signature as with TLS")]
pub(crate) fn check(_tls: &Tls, _folder: &Path, _is_server: bool) -> Result<(), Mistake> {
    Ok(())
}

fn not_in_this_build() -> OpenError {
    OpenError::Unsupported(
        "TLS for Modbus is not in this build of tickbus; use the library of a `make dist`, which has it, or build with \
         `cargo build --release --features modbus-tls`"
            .to_owned(),
    )
}

pub(crate) fn serve<S: Restricts>(
    side: &ServerSide,
    _write_roles: Option<&[String]>,
    _service: S,
    _address: &Address,
    _port: &mut Port,
    _stop: &Stop,
) -> Result<(), BusError> {
    match side.0 {}
}

pub(crate) fn call<S: Stream>(
    side: &ClientSide,
    _call: &mut Call<S>,
    _caller: &mut impl Caller,
    _peer: (String, Nanos),
    _port: &mut Port,
    _stop: &Stop,
) -> Result<(), BusError> {
    match side.0 {}
}

pub(crate) fn open(side: &ClientSide, _wire: Wire) -> Result<Wire, (&'static str, String)> {
    match side.0 {}
}

impl ServerSide {
    pub(crate) fn load(_tls: &Tls, _folder: &Path) -> Result<Self, OpenError> {
        Err(not_in_this_build())
    }
}

impl ClientSide {
    pub(crate) fn load(_tls: &Tls, _address: &Address, _folder: &Path) -> Result<Self, OpenError> {
        Err(not_in_this_build())
    }
}
