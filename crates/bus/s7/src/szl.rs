//! System status lists (SZL), which clients read from a CPU before anything else; among them the CPU's identity.

use super::pdu::error;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::PlcState;

/// The identity of a CPU, as in its system status lists. A client learns order number, firmware, name, plant and serial
/// number.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Order number of the module, at most 20 characters.
    pub order: String,
    /// Firmware version: three numbers.
    pub firmware: [u8; 3],
    /// Name of the module, at most 24 characters.
    pub name: String,
    /// Name of the automation system, at most 24 characters.
    pub system: String,
    /// Identification of the plant, at most 32 characters.
    pub plant: String,
    /// Serial number of the module, at most 24 characters.
    pub serial: String,
    /// Type of the module, at most 32 characters.
    pub module: String,
    /// Copyright notice, at most 26 characters.
    pub copyright: String,
}

impl Identity {
    /// The identity that our server reports.
    pub fn of_driver(name: &str) -> Self {
        let number = |text: &str| text.parse().unwrap_or(0);
        Self {
            order: "tickbus".to_owned(),
            firmware: [
                number(env!("CARGO_PKG_VERSION_MAJOR")),
                number(env!("CARGO_PKG_VERSION_MINOR")),
                number(env!("CARGO_PKG_VERSION_PATCH")),
            ],
            name: cut(name, NAME).to_owned(),
            system: cut(name, NAME).to_owned(),
            module: "tickbus, a simulated machine".to_owned(),
            copyright: "MIT OR Apache-2.0".to_owned(),
            ..Self::default()
        }
    }

    /// The identity in one line; empty if nothing is known.
    pub fn line(&self) -> String {
        let parts = [&self.order, &self.name, &self.plant, &self.serial];
        let said: Vec<&str> = parts.iter().map(|part| part.trim()).collect();
        let said: Vec<&str> = said.into_iter().filter(|part| !part.is_empty()).collect();
        said.join(" ")
    }
}

/// The contents of a server's lists.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Facts {
    /// The server's identity.
    pub identity: Identity,
    /// The longest unit that the server agrees to.
    pub pdu: u16,
    /// The number of clients served at the same time.
    pub clients: u16,
    /// The reading of the server's clock when the driver's clock read zero, as the time since 1 January 1970.
    pub epoch: Nanos,
}

impl Facts {
    /// 1 January 1994: where the clock of a CPU starts that was never set.
    pub const NEVER_SET: Nanos = Nanos::from_secs(8_766 * 86_400);

    /// The CPU's clock at `now`, as `DATE_AND_TIME`.
    pub fn clock(&self, now: Nanos) -> [u8; 8] {
        date_and_time(self.epoch + now)
    }
}

/// Lengths of texts in the lists.
pub(crate) const ORDER: usize = 20;
pub(crate) const NAME: usize = 24;
pub(crate) const LONG_NAME: usize = 32;

/// Length of a record of list 0x001C: an index, and a field of 32 bytes.
const COMPONENT: usize = 2 + LONG_NAME;
/// Length of a record of list 0x0011.
const MODULE: usize = 2 + ORDER + 6;

/// Bytes before the records of a list: id, index, length of a record, number of records.
const HEADER: usize = 8;

/// The list with the operating state of a CPU.
pub const STATE: u16 = 0x0424;

/// The lists of our server.
const LISTS: [u16; 11] = [
    0x0000, 0x0011, 0x0111, 0x0019, 0x001C, 0x011C, 0x0074, 0x0131, 0x0132, 0x0232, STATE,
];

/// Appends the list `id`, or its part `index`, with the contents at `now`.
///
/// # Errors
///
/// The error code for a list or an index that does not exist.
pub fn write(id: u16, index: u16, facts: &Facts, now: Nanos, out: &mut Vec<u8>) -> Result<(), u16> {
    let records: Vec<Vec<u8>> = match id {
        0x0000 => LISTS.iter().map(|id| id.to_be_bytes().to_vec()).collect(),
        0x0011 => modules(&facts.identity),
        0x0111 => one_of(modules(&facts.identity), index)?,
        0x001C => components(&facts.identity),
        0x011C => one_of(components(&facts.identity), index)?,
        0x0019 | 0x0074 => leds(),
        // Index 1 is about communication in general, 3 about operating and monitoring, 4 about protection.
        0x0131 if index <= 1 => vec![communication(facts)],
        0x0131 if index == 3 => vec![monitoring(facts)],
        0x0132 if index == 1 => vec![connections(facts)],
        0x0132 if index == 4 => vec![protection()],
        0x0232 if index == 4 || index == 0 => vec![protection()],
        STATE => vec![running(facts.clock(now))],
        0x0131 | 0x0132 | 0x0232 => return Err(error::NO_INDEX),
        _ => return Err(error::NO_LIST),
    };
    let length = records.first().map_or(0, Vec::len);
    for number in [id, index, short(length), short(records.len())] {
        out.extend_from_slice(&number.to_be_bytes());
    }
    out.extend(records.into_iter().flatten());
    Ok(())
}

fn one_of(records: Vec<Vec<u8>>, index: u16) -> Result<Vec<Vec<u8>>, u16> {
    let mut records = records;
    records.retain(|record| record.starts_with(&index.to_be_bytes()));
    if records.is_empty() {
        Err(error::NO_INDEX)
    } else {
        Ok(records)
    }
}

/// Order numbers and versions of the module, its hardware and its firmware.
fn modules(identity: &Identity) -> Vec<Vec<u8>> {
    let [major, minor, patch] = identity.firmware;
    let record = |index: u16, order: &str, version: [u8; 4]| {
        let mut record = index.to_be_bytes().to_vec();
        text(order, ORDER, b' ', &mut record);
        record.extend_from_slice(&[0, 0]);
        record.extend_from_slice(&version);
        record
    };
    vec![
        record(1, &identity.order, [0, 0, 0, 1]),
        record(6, &identity.order, [0, 0, 0, 1]),
        record(7, "", [b'V', major, minor, patch]),
    ]
}

/// Names of station, module and plant; copyright, serial number, type.
fn components(identity: &Identity) -> Vec<Vec<u8>> {
    let record = |(index, text_of, length): (u16, &str, usize)| {
        let mut record = index.to_be_bytes().to_vec();
        text(text_of, length, 0, &mut record);
        record.resize(COMPONENT, 0);
        record
    };
    [
        (1, identity.system.as_str(), NAME),
        (2, &identity.name, NAME),
        (3, &identity.plant, LONG_NAME),
        (4, &identity.copyright, 26),
        (5, &identity.serial, NAME),
        (7, &identity.module, LONG_NAME),
    ]
    .map(record)
    .to_vec()
}

/// PDU length, number of connections, and two bus speeds, which do not apply.
fn communication(facts: &Facts) -> Vec<u8> {
    let mut record = vec![0, 1];
    record.extend_from_slice(&facts.pdu.to_be_bytes());
    record.extend_from_slice(&facts.clients.to_be_bytes());
    record.resize(40, 0);
    record
}

/// The services that panels may request: reading once and writing once, but nothing cyclic.
fn monitoring(facts: &Facts) -> Vec<u8> {
    let mut record = vec![0, 3, 0b11, 0, 0, 0];
    // Bytes that are read consistently: the data of one PDU, without headers.
    let whole = facts.pdu.saturating_sub(18);
    record.extend_from_slice(&whole.to_be_bytes());
    record.resize(40, 0);
    record
}

/// One connection reserved for a programming device and one for a panel, neither in use, and the number of
/// free ones.
fn connections(facts: &Facts) -> Vec<u8> {
    let mut record = Vec::new();
    for word in [1, 1, 1, 0, 0, 0, 0, facts.clients] {
        record.extend_from_slice(&word.to_be_bytes());
    }
    record.resize(40, 0);
    record
}

/// The LEDs SF, RUN and STOP: number, on, flashing.
fn leds() -> Vec<Vec<u8>> {
    [[0, 1, 0, 0], [0, 4, 1, 0], [0, 5, 0, 0]]
        .map(Vec::from)
        .to_vec()
}

/// No password, key switch on RUN.
fn protection() -> Vec<u8> {
    let mut record = Vec::new();
    for word in [4_u16, 1, 0, 1, 2, 0] {
        record.extend_from_slice(&word.to_be_bytes());
    }
    record.resize(40, 0);
    record
}

/// The CPU has been running since its start.
fn running(clock: [u8; 8]) -> Vec<u8> {
    let mut record = vec![0x51, 0x44, 0xFF, 0x08, 0, 0, 0, 0, 0, 0, 0, 0];
    record.extend_from_slice(&clock);
    record
}

/// A time since 1 January 1970 as `DATE_AND_TIME`.
fn date_and_time(since: Nanos) -> [u8; 8] {
    let millis = (since.0 / 1_000_000).max(0);
    let (days, of_day) = (millis / 86_400_000, millis % 86_400_000);
    // Howard Hinnant's algorithm for civil dates; day 0 is 1 March of the year 0.
    let day = days + 719_468;
    let era = day / 146_097;
    let of_era = day % 146_097;
    let year_of_era = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * of_year + 2) / 153;
    let day_of_month = of_year - (153 * shifted + 2) / 5 + 1;
    let month = if shifted < 10 {
        shifted + 3
    } else {
        shifted - 9
    };
    let year = era * 400 + year_of_era + i64::from(month <= 2);
    let bcd = |number: i64| {
        let number = u8::try_from(number % 100).expect("two digits");
        number / 10 * 16 + number % 10
    };
    // 1 January 1970 was a Thursday, and 1 is Sunday.
    let weekday = u8::try_from((days + 4) % 7 + 1).expect("a day of the week");
    let (seconds, millis) = (of_day / 1000, of_day % 1000);
    let ones = u8::try_from(millis % 10).expect("a digit");
    [
        bcd(year),
        bcd(month),
        bcd(day_of_month),
        bcd(seconds / 3600),
        bcd(seconds / 60 % 60),
        bcd(seconds % 60),
        bcd(millis / 10),
        ones * 16 + weekday,
    ]
}

/// The operating state of a CPU in its list 0x0424; `None` if it is not stated.
///
/// The fourth byte of the record has the current state in its lower half, and the previous one in the upper.
pub fn state(list: &[u8]) -> Option<PlcState> {
    let (header, record) = list.split_first_chunk::<HEADER>()?;
    let [_, _, _, entered, ..] = *record else {
        return None;
    };
    if header[..2] != STATE.to_be_bytes() {
        return None;
    }
    Some(match entered & 0x0F {
        // Unknown.
        0 => return None,
        // RUN; for a redundant pair also RUN-R, LINK-UP and UPDATE, in which the program is executed.
        0x8 | 0x9 | 0xB | 0xC => PlcState::Run,
        // The kinds of STOP, STARTUP, HOLD, DEFECTIVE.
        _ => PlcState::Stop,
    })
}

/// Adds the contents of list 0x0011 or 0x001C to an identity. `list` starts with its id.
///
/// Fields that are missing or malformed do not change: CPUs differ, and some simulators even omit the
/// lengths.
pub fn learn(identity: &mut Identity, list: &[u8]) {
    let Some((header, records)) = list.split_first_chunk::<HEADER>() else {
        return;
    };
    let [i0, i1, _, _, l0, l1, _, _] = *header;
    let (id, length) = (u16::from_be_bytes([i0, i1]), u16::from_be_bytes([l0, l1]));
    let (least, known) = match id {
        0x0011 => (2 + ORDER, MODULE),
        0x001C => (2 + NAME, COMPONENT),
        _ => return,
    };
    let length = match usize::from(length) {
        0 => known,
        length if length < least => return,
        length => length,
    };
    for (position, record) in records.chunks_exact(length).enumerate() {
        let field = |length: usize| printable(&record[2..2 + length.min(record.len() - 2)]);
        // Simulators that omit the lengths omit the index as well.
        let index = match u16::from_be_bytes([record[0], record[1]]) {
            0 => position + 1,
            index => usize::from(index),
        };
        match (id, index) {
            (0x0011, 1) => identity.order = field(ORDER),
            (0x0011, 7) => {
                if let [.., major, minor, patch] = *record {
                    identity.firmware = [major, minor, patch];
                }
            }
            (0x001C, 2) => identity.name = field(NAME),
            (0x001C, 3) => identity.plant = field(LONG_NAME),
            (0x001C, 5) => identity.serial = field(NAME),
            _ => {}
        }
    }
}

fn text(text: &str, length: usize, filling: u8, out: &mut Vec<u8>) {
    let end = out.len() + length;
    out.extend_from_slice(cut(text, length).as_bytes());
    out.resize(end, filling);
}

/// As much of a text as fits into `length` bytes.
fn cut(text: &str, length: usize) -> &str {
    let mut end = length.min(text.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    &text[..end]
}

/// A field as one printable line.
fn printable(field: &[u8]) -> String {
    let end = field
        .iter()
        .position(|byte| *byte == 0)
        .unwrap_or(field.len());
    let text = String::from_utf8_lossy(&field[..end]);
    let plain = text.chars().map(|c| if c.is_control() { ' ' } else { c });
    plain.collect::<String>().trim().to_owned()
}

fn short(number: usize) -> u16 {
    u16::try_from(number).expect("lists are short")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts() -> Facts {
        Facts {
            identity: Identity::of_driver("Test rig"),
            pdu: 960,
            clients: 32,
            epoch: Facts::NEVER_SET,
        }
    }

    #[test]
    fn lists_are_as_long_as_they_say() {
        for id in LISTS {
            let index = match id {
                0x0111 | 0x011C | 0x0131 => 1,
                0x0132 | 0x0232 => 4,
                _ => 0,
            };
            let mut list = Vec::new();
            write(id, index, &facts(), Nanos::ZERO, &mut list).expect("it is in the list");
            let word = |at: usize| usize::from(u16::from_be_bytes([list[at], list[at + 1]]));
            assert_eq!((word(0), word(2)), (usize::from(id), usize::from(index)));
            assert_eq!(list.len(), HEADER + word(4) * word(6), "{id:04X}");
            assert!(word(6) > 0);
        }
    }

    #[test]
    fn what_there_is_not_has_the_protocols_own_error() {
        for (id, index, code) in [
            (0x00A0, 0, error::NO_LIST),
            (0x0111, 9, error::NO_INDEX),
            (0x011C, 6, error::NO_INDEX),
            (0x0131, 2, error::NO_INDEX),
            (0x0132, 2, error::NO_INDEX),
            (0x0132, 8, error::NO_INDEX),
        ] {
            let mut list = Vec::new();
            let result = write(id, index, &facts(), Nanos::ZERO, &mut list);
            assert_eq!((result, list.len()), (Err(code), 0));
        }
    }

    #[test]
    fn an_identity_is_learned_from_its_lists() {
        let told = Identity {
            order: "6ES7 515-2AM01-0AB0".to_owned(),
            firmware: [2, 9, 2],
            name: "PLC_1".to_owned(),
            plant: "Hall 7".to_owned(),
            serial: "S C-X4U421302009".to_owned(),
            ..Identity::default()
        };
        let facts = Facts {
            identity: told.clone(),
            ..facts()
        };
        let mut learned = Identity::default();
        for id in [0x0011, 0x001C] {
            let mut list = Vec::new();
            write(id, 0, &facts, Nanos::ZERO, &mut list).expect("it is there");
            for cut in 0..list.len() {
                learn(&mut Identity::default(), &list[..cut]);
            }
            learn(&mut learned, &list);
        }
        assert_eq!(learned, told);
        assert_eq!(
            learned.line(),
            "6ES7 515-2AM01-0AB0 PLC_1 Hall 7 S C-X4U421302009"
        );
        assert_eq!(Identity::of_driver("Test rig").line(), "tickbus Test rig");
        assert_eq!(Identity::default().line(), "");
    }

    #[test]
    fn an_identity_without_lengths_is_learned_too() {
        let mut list = vec![0; HEADER + 206];
        list[..2].copy_from_slice(&[0, 0x1C]);
        list[HEADER + 36..HEADER + 39].copy_from_slice(b"CPU");
        let mut learned = Identity::default();
        learn(&mut learned, &list);
        assert_eq!(learned.name, "CPU");
    }

    #[test]
    fn a_long_name_is_cut_between_two_characters() {
        let name = "Schälmaschinenfernwartüng";
        assert_eq!(Identity::of_driver(name).name, "Schälmaschinenfernwart");
        assert_eq!(cut("äöü", 3), "ä");
    }

    #[test]
    fn a_panel_is_told_that_there_are_no_cyclic_services_and_which_lamps_are_on() {
        let list = |id, index| {
            let mut list = Vec::new();
            write(id, index, &facts(), Nanos::ZERO, &mut list).expect("it is there");
            list.split_off(HEADER)
        };
        assert_eq!(list(0x0131, 3)[..8], [0, 3, 0b11, 0, 0, 0, 0x03, 0xAE]);
        assert_eq!(list(0x0132, 1)[..2], [0, 1]);
        for id in [0x0019, 0x0074] {
            assert_eq!(list(id, 0), [0, 1, 0, 0, 0, 4, 1, 0, 0, 5, 0, 0]);
        }
    }

    #[test]
    fn a_cpu_runs_if_its_list_says_so() {
        let mut list = Vec::new();
        write(STATE, 0, &facts(), Nanos::ZERO, &mut list).expect("it is there");
        assert_eq!(state(&list), Some(PlcState::Run), "as our server says it");
        for (entered, said) in [
            (0x08, Some(PlcState::Run)),
            (0x68, Some(PlcState::Run)),
            (0x09, Some(PlcState::Run)),
            (0x00, None),
            (0x03, Some(PlcState::Stop)),
            (0x04, Some(PlcState::Stop)),
            (0x84, Some(PlcState::Stop)),
            (0x06, Some(PlcState::Stop)),
            (0x0A, Some(PlcState::Stop)),
            (0x0D, Some(PlcState::Stop)),
        ] {
            list[HEADER + 3] = entered;
            assert_eq!(state(&list), said, "{entered:02X}");
        }
        for cut in 0..HEADER + 4 {
            assert_eq!(state(&list[..cut]), None, "{cut}");
        }
        list[1] = 0x25;
        assert_eq!(state(&list), None, "another list");
    }

    #[test]
    fn the_clock_of_a_cpu_that_was_never_set_begins_with_1994() {
        let facts = facts();
        assert_eq!(
            facts.clock(Nanos::ZERO),
            [0x94, 0x01, 0x01, 0, 0, 0, 0, 0x07],
            "a Saturday"
        );
        let leap = Nanos::from_secs(86_400 * (365 + 365 + 31 + 28) + 12 * 3600 + 34 * 60 + 56);
        let leap = leap + Nanos::from_millis(789);
        assert_eq!(
            facts.clock(leap),
            [0x96, 0x02, 0x29, 0x12, 0x34, 0x56, 0x78, 0x95],
            "Thursday, 29 February 1996"
        );
    }

    #[test]
    fn a_clock_that_was_set_goes_on_from_its_date() {
        // 2026-11-22 01:30:13 UTC, a Sunday.
        let facts = Facts {
            epoch: Nanos::from_secs(1_795_311_013),
            ..facts()
        };
        assert_eq!(
            facts.clock(Nanos::from_millis(250)),
            [0x26, 0x11, 0x22, 0x01, 0x30, 0x13, 0x25, 0x01]
        );
    }
}
