//! The error codes of the CIF driver, by the names of the vendor's header.

use tickbus_fieldbus::Verdict::{Again, Broken, NoPeer, Refused};
use tickbus_fieldbus::{BusError, Failing, Meaning, Verdict};

use crate::answer::Answer;

const fn row(code: i32, name: &'static str, verdict: Verdict, words: &'static str) -> Meaning {
    Meaning::new(code.cast_unsigned(), name, verdict, words)
}

const SIZES: &str = "the signals reach beyond the card's process image; check their addresses, `write_offset` and `read_offset`";
const STATE: &str = "the driver is in another state than its order of calls says; see whether another program uses the card";

/// All codes with an individual meaning.
#[rustfmt::skip]
pub const ERRORS: &[Meaning] = &[
    row(-1, "DRV_BOARD_NOT_INITIALIZED", Broken, "the driver does not have this card; check `device`, and the card in the vendor's driver set-up"),
    row(-2, "DRV_INIT_STATE_ERROR", Broken, STATE),
    row(-3, "DRV_READ_STATE_ERROR", Broken, STATE),
    row(-4, "DRV_CMD_ACTIVE", Again, "another call uses the card; see whether another program does"),
    row(-5, "DRV_PARAMETER_UNKNOWN", Broken, Meaning::REPORT),
    row(-6, "DRV_WRONG_DRIVER_VERSION", Broken, "library and driver do not belong together; reinstall both"),
    row(-10, "DRV_DEV_DPM_ACCESS_ERROR", Broken, "the card's memory cannot be reached; see whether the card was removed, and its address in the driver set-up"),
    row(-11, "DRV_DEV_NOT_READY", Broken, "the card is not ready; it starts, or has no firmware"),
    row(-12, "DRV_DEV_NOT_RUNNING", Broken, "the card does not run; it starts, or has no configuration: load one with the vendor's tool"),
    row(-13, "DRV_DEV_WATCHDOG_FAILED", Broken, "the card's watchdog has tripped, as it was not triggered in time; lengthen its time in the card's configuration, or remove `card_watchdog`"),
    row(-14, "DRV_DEV_OS_VERSION_ERROR", Broken, "the operating system of the card has a wrong version; load a newer firmware"),
    row(-15, "DRV_DEV_SYSERR", Broken, "the card reports an error of its own; switch it off and on, and see its diagnosis"),
    row(-16, "DRV_DEV_MAILBOX_FULL", Broken, "the card's mailbox is full; see whether another program uses it"),
    row(-17, "DRV_DEV_PUT_TIMEOUT", Broken, "the card took no message in time"),
    row(-18, "DRV_DEV_GET_TIMEOUT", Broken, "the card gave no message in time"),
    row(-19, "DRV_DEV_GET_NO_MESSAGE", Broken, "the card has no message"),
    row(-20, "DRV_DEV_RESET_TIMEOUT", Broken, "the card did not come back from its reset in time"),
    row(-21, "DRV_DEV_NO_COM_FLAG", NoPeer, "the card says that its bus does not communicate (NO_COM_FLAG); check that the other end runs, its cable, and that both ends have the same configuration"),
    row(-22, "DRV_DEV_EXCHANGE_FAILED", Again, "the card still has the process data to itself; each cycle tries again"),
    row(-23, "DRV_DEV_EXCHANGE_TIMEOUT", Again, "the card did not exchange the process data in time; each cycle tries again"),
    row(-24, "DRV_DEV_COM_MODE_UNKNOWN", Refused, "the card is configured for a kind of exchange that the driver does not know; choose a buffered one in the card's configuration"),
    row(-25, "DRV_DEV_FUNCTION_FAILED", Broken, "the driver gives no reason; see the card's diagnosis"),
    row(-26, "DRV_DEV_DPMSIZE_MISMATCH", Broken, "the driver set-up has another size of the card's memory than the card; correct it there"),
    row(-27, "DRV_DEV_STATE_MODE_UNKNOWN", Broken, Meaning::REPORT),
    row(-28, "HW_PORT_USED", Broken, "something else has the hardware port of the card; see the driver set-up"),
    row(-30, "DRV_USR_OPEN_ERROR", Broken, "the vendor's driver does not run on this computer; install it, or start it"),
    row(-31, "DRV_USR_INIT_DRV_ERROR", Broken, "the driver could not be started; reinstall it"),
    row(-32, "DRV_USR_NOT_INITIALIZED", Broken, "the driver has not started this card; check `device`, and the card in the driver set-up"),
    row(-33, "DRV_USR_COMM_ERR", Broken, "library and driver do not understand each other; reinstall both"),
    row(-34, "DRV_USR_DEV_NUMBER_INVALID", Refused, "there is no card with this number; check `device`"),
    row(-35, "DRV_USR_INFO_AREA_INVALID", Broken, Meaning::REPORT),
    row(-36, "DRV_USR_NUMBER_INVALID", Broken, Meaning::REPORT),
    row(-37, "DRV_USR_MODE_INVALID", Broken, Meaning::REPORT),
    row(-38, "DRV_USR_MSG_BUF_NULL_PTR", Broken, Meaning::REPORT),
    row(-39, "DRV_USR_MSG_BUF_TOO_SHORT", Broken, Meaning::REPORT),
    row(-40, "DRV_USR_SIZE_INVALID", Refused, SIZES),
    row(-42, "DRV_USR_SIZE_ZERO", Broken, Meaning::REPORT),
    row(-43, "DRV_USR_SIZE_TOO_LONG", Refused, SIZES),
    row(-44, "DRV_USR_DEV_PTR_NULL", Broken, Meaning::REPORT),
    row(-45, "DRV_USR_BUF_PTR_NULL", Broken, Meaning::REPORT),
    row(-46, "DRV_USR_SENDSIZE_TOO_LONG", Refused, SIZES),
    row(-47, "DRV_USR_RECVSIZE_TOO_LONG", Refused, SIZES),
    row(-48, "DRV_USR_SENDBUF_PTR_NULL", Broken, Meaning::REPORT),
    row(-49, "DRV_USR_RECVBUF_PTR_NULL", Broken, Meaning::REPORT),
];

/// Ranges of codes with a common meaning, by their first and last ones.
const RANGES: [(i32, i32, Meaning); 4] = [
    (
        -83,
        -80,
        row(
            -83,
            "unknown or unsupported",
            Refused,
            "driver or card do not have what was asked for; install a newer driver",
        ),
    ),
    (
        -105,
        -100,
        row(
            -105,
            "file error",
            Broken,
            "the driver could not use a file; reinstall it",
        ),
    ),
    (
        -128,
        -110,
        row(
            -128,
            "firmware or configuration",
            Broken,
            "firmware or configuration of the card are not in order; load both with the vendor's tool",
        ),
    ),
    (
        1000,
        1255,
        row(
            1000,
            "error of the card's operating system",
            Broken,
            "what follows the 1000 is its number in the manual of the card's firmware",
        ),
    ),
];

/// The meaning of a code; `None` if tickbus does not know it.
pub fn meaning(code: i32) -> Option<&'static Meaning> {
    let together = || {
        let mut ranges = RANGES.iter();
        ranges
            .find(|(first, last, _)| (*first..=*last).contains(&code))
            .map(|(.., meaning)| meaning)
    };
    Meaning::of(ERRORS, code.cast_unsigned()).or_else(together)
}

/// `function` returned `code`.
pub(crate) fn failing(function: &str, code: i32) -> Failing {
    Failing::new(function, &code.to_string(), meaning(code))
}

/// The meaning of `code` for an exchange of data.
pub(crate) fn moved(code: i32) -> Result<Answer, BusError> {
    Answer::of(code, meaning(code), || failing("DevExchangeIO", code))
}
