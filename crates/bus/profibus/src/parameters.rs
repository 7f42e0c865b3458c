//! The parameters that a master sends to a station: `Set_Prm`.

use tickbus_base::time::Nanos;

/// The octets before the user's parameters.
const HEAD: usize = 7;

/// The content of `Set_Prm`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "the standard's own flags, independent of each other"
)]
pub(crate) struct Parameters<'a> {
    pub(crate) lock: bool,
    pub(crate) unlock: bool,
    pub(crate) sync: bool,
    pub(crate) freeze: bool,
    /// `WD_On`, and the product of the two factors.
    pub(crate) watchdog: Option<i64>,
    /// In bit times; 0 keeps the current value.
    pub(crate) min_tsdr: u8,
    pub(crate) ident: u16,
    pub(crate) group: u8,
    pub(crate) user: &'a [u8],
}

impl<'a> Parameters<'a> {
    /// Reads the data of the request; `None` if there are too few octets.
    pub(crate) fn read(data: &'a [u8]) -> Option<Self> {
        let (&[status, first, second, min_tsdr, high, low, group], user) =
            data.split_first_chunk::<HEAD>()?;
        let has = |bit: u8| status & (1 << bit) != 0;
        Some(Self {
            lock: has(7),
            unlock: has(6),
            sync: has(5),
            freeze: has(4),
            watchdog: has(3).then(|| i64::from(first) * i64::from(second)),
            min_tsdr,
            ident: u16::from_be_bytes([high, low]),
            group,
            user,
        })
    }

    /// The watchdog's time; `dpv1` tells whether the station has the parameter octets of DPV1.
    pub(crate) fn watchdog(&self, dpv1: bool) -> Option<Nanos> {
        let in_milliseconds = dpv1 && self.user.first().is_some_and(|octet| octet & 0x04 != 0);
        let unit = if in_milliseconds { 1 } else { 10 };
        self.watchdog.map(|count| Nanos::from_millis(count * unit))
    }

    /// True if the master uses the acyclic services that come with the parameters.
    pub(crate) fn enables_dpv1(&self, dpv1: bool) -> bool {
        dpv1 && self.user.first().is_some_and(|octet| octet & 0x80 != 0)
    }

    /// The octets of DPV1 with the types of alarms that the master enables, and how many it takes at a time.
    pub(crate) fn alarms(&self) -> Option<[u8; 2]> {
        self.user.get(1..3)?.try_into().ok()
    }

    /// True if the master signals CLEAR by telegrams without outputs, according to the parameter octets of DPV1.
    pub(crate) fn fail_safe(&self, dpv1: bool) -> bool {
        dpv1 && self.user.first().is_some_and(|octet| octet & 0x40 != 0)
    }
}
