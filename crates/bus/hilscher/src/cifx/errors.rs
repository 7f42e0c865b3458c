//! The error codes of the cifX driver.

use tickbus_fieldbus::Verdict::{Again, Broken, NoPeer, Refused};
use tickbus_fieldbus::{BusError, Failing, Meaning};

use crate::answer::Answer;

/// All codes that tickbus knows.
#[rustfmt::skip]
pub const ERRORS: &[Meaning] = &[
    Meaning::new(0x800A_0001, "CIFX_INVALID_POINTER", Broken, Meaning::REPORT),
    Meaning::new(0x800A_0002, "CIFX_INVALID_BOARD", Broken, "there is no such board; check `board`, and that the vendor's tools see the card"),
    Meaning::new(0x800A_0003, "CIFX_INVALID_CHANNEL", Refused, "the board has no such channel; check `channel`, and that a firmware is loaded"),
    Meaning::new(0x800A_0004, "CIFX_INVALID_HANDLE", Broken, Meaning::REPORT),
    Meaning::new(0x800A_0005, "CIFX_INVALID_PARAMETER", Refused, "the channel has no area of process data in this direction, or the driver refuses the call; check the card's configuration"),
    Meaning::new(0x800A_0006, "CIFX_INVALID_COMMAND", Broken, Meaning::REPORT),
    Meaning::new(0x800A_0007, "CIFX_INVALID_BUFFERSIZE", Broken, Meaning::REPORT),
    Meaning::new(0x800A_0008, "CIFX_INVALID_ACCESS_SIZE", Refused, "the signals reach beyond the card's process image; check their addresses, `write_offset` and `read_offset`"),
    Meaning::new(0x800A_0009, "CIFX_FUNCTION_FAILED", Broken, "the driver gives no reason; see its log"),
    Meaning::new(0x800A_0011, "CIFX_FUNCTION_NOT_AVAILABLE", Refused, "the card's firmware does not have this function; check `channel`, and `card_watchdog` if it is set"),
    Meaning::new(0x800B_0001, "CIFX_DRV_NOT_INITIALIZED", Broken, "the driver was not started; check its installation"),
    Meaning::new(0x800B_0004, "CIFX_DRV_CMD_ACTIVE", Again, "another call uses the card; see whether another program does"),
    Meaning::new(0x800B_0030, "CIFX_DRV_DRIVER_NOT_LOADED", Broken, "the vendor's driver does not run on this computer; install it, or start it"),
    Meaning::new(0x800B_0031, "CIFX_DRV_INIT_ERROR", Broken, "the driver could not start the card; see its log"),
    Meaning::new(0x800B_0032, "CIFX_DRV_CHANNEL_NOT_INITIALIZED", Broken, "the channel is not initialised; load firmware and configuration into the card"),
    Meaning::new(0x800B_0034, "CIFX_DRV_NOT_OPENED", Broken, "the driver is not open; see whether the card was removed"),
    Meaning::new(0x800C_0011, "CIFX_DEV_NOT_READY", Broken, "the card is not ready; it starts, or has no firmware"),
    Meaning::new(0x800C_0012, "CIFX_DEV_NOT_RUNNING", Broken, "the card does not run; it starts, or has no configuration: load one with the vendor's tool"),
    Meaning::new(0x800C_0013, "CIFX_DEV_WATCHDOG_FAILED", Broken, "the card's watchdog has tripped, as it was not triggered in time; lengthen its time in the card's configuration, or remove `card_watchdog`"),
    Meaning::new(0x800C_0015, "CIFX_DEV_SYSERR", Broken, "the card reports an error of its own; switch it off and on, and see its diagnosis"),
    Meaning::new(0x800C_0016, "CIFX_DEV_MAILBOX_FULL", Broken, "the card's mailbox is full; see whether another program uses it"),
    Meaning::new(0x800C_0017, "CIFX_DEV_PUT_TIMEOUT", Broken, "the card took no message in time"),
    Meaning::new(0x800C_0018, "CIFX_DEV_GET_TIMEOUT", Broken, "the card gave no message in time"),
    Meaning::new(0x800C_0019, "CIFX_DEV_GET_NO_PACKET", Broken, "the card has no message"),
    Meaning::new(0x800C_0020, "CIFX_DEV_RESET_TIMEOUT", Broken, "the card did not come back from its reset in time"),
    Meaning::new(0x800C_0021, "CIFX_DEV_NO_COM_FLAG", NoPeer, "the card says that its bus does not communicate (NO_COM_FLAG); check that the other end runs, its cable, and that both ends have the same configuration"),
    Meaning::new(0x800C_0022, "CIFX_DEV_EXCHANGE_FAILED", Again, "the card still has the process data to itself; each cycle tries again"),
    Meaning::new(0x800C_0023, "CIFX_DEV_EXCHANGE_TIMEOUT", Again, "the card did not exchange the process data in time; each cycle tries again"),
    Meaning::new(0x800C_0025, "CIFX_DEV_FUNCTION_FAILED", Broken, "the card gives no reason; see its diagnosis"),
    Meaning::new(0x800C_002B, "CIFX_DEV_HOST_STATE_SET_TIMEOUT", Broken, "the card did not take note in time that this program is ready; it starts, or is busy"),
    Meaning::new(0x800C_002C, "CIFX_DEV_HOST_STATE_CLEAR_TIMEOUT", Broken, "the card did not take note in time that this program ends"),
    Meaning::new(0x800C_002D, "CIFX_DEV_INITIALIZATION_TIMEOUT", Broken, "the card was not initialised in time"),
    Meaning::new(0x800C_002E, "CIFX_DEV_BUS_STATE_ON_TIMEOUT", Broken, "the card did not switch its bus on in time; check its configuration, and `bus_on_timeout`"),
    Meaning::new(0x800C_002F, "CIFX_DEV_BUS_STATE_OFF_TIMEOUT", Broken, "the card did not switch its bus off in time"),
];

/// `function` returned `code`.
pub(crate) fn failing(function: &str, code: u32) -> Failing {
    Failing::new(
        function,
        &format!("0x{code:08X}"),
        Meaning::of(ERRORS, code),
    )
}

/// The meaning of `code` for data that `function` was to move.
pub(crate) fn moved(function: &str, code: u32) -> Result<Answer, BusError> {
    let told = || failing(function, code);
    Answer::of(code.cast_signed(), Meaning::of(ERRORS, code), told)
}
