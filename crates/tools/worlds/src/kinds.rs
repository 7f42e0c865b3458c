//! The kinds of bus that worlds have.

use tickbus_bus_dispatcher as dispatcher;
use tickbus_bus_modbus as modbus;
use tickbus_bus_profibus as profibus;
use tickbus_bus_s7 as s7;
use tickbus_bus_sdsp as sdsp;
use tickbus_bus_socket as socket;
use tickbus_driver_cfg::{Kind, Kinds};

pub(crate) static KINDS: Kinds = Kinds::new(&[
    Kind::of::<socket::Options>(),
    Kind::of::<modbus::ServerOptions>(),
    Kind::of::<modbus::ClientOptions>(),
    Kind::of::<s7::ServerOptions>(),
    Kind::of::<s7::ClientOptions>(),
    Kind::of::<sdsp::Options>(),
    Kind::of::<dispatcher::Options>(),
    Kind::of::<profibus::Options>(),
    Kind::of::<crate::master::Options>(),
]);
