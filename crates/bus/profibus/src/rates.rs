//! The rates of the standard.

/// The longest slot time that a master can have, in bits: an answer must come earlier.
pub(crate) const SLOT_TIME_LIMIT: u16 = 16_383;

/// One rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rate {
    /// In bits per second.
    pub(crate) baud: u32,
    /// The longest wait before an answer, in bits.
    pub(crate) max_tsdr: u16,
    /// The name in GSD files: `<name>_supp`, `MaxTsdr_<name>`.
    pub(crate) name: &'static str,
}

const fn rate(baud: u32, max_tsdr: u16, name: &'static str) -> Rate {
    Rate {
        baud,
        max_tsdr,
        name,
    }
}

/// All rates, with the wait that the standard states.
pub(crate) const RATES: [Rate; 10] = [
    rate(9_600, 60, "9.6"),
    rate(19_200, 60, "19.2"),
    rate(45_450, 60, "45.45"),
    rate(93_750, 60, "93.75"),
    rate(187_500, 60, "187.5"),
    rate(500_000, 100, "500"),
    rate(1_500_000, 150, "1.5M"),
    rate(3_000_000, 250, "3M"),
    rate(6_000_000, 450, "6M"),
    rate(12_000_000, 800, "12M"),
];
