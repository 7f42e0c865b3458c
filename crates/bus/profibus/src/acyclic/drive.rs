//! The parameters of a drive, as the profile of drives has them: record 47 takes a request for several parameters, and
//! then has the answer.

use super::machine::Machine;
use super::pdu::Refusal;

/// The index of the record in each slot.
pub(crate) const INDEX: u8 = 47;

/// The most elements of a parameter that a request can name.
pub(crate) const ELEMENT_LIMIT: usize = 117;

/// The octets of a request or an answer before its parameters.
const HEAD: usize = 4;

/// The octets of a parameter's address.
const ADDRESS: usize = 6;

/// The octets of a parameter's error in an answer.
const ERROR: usize = 4;

const READ: u8 = 1;
const CHANGE: u8 = 2;
/// In the answer's identifier: at least one parameter has an error.
const FAILED: u8 = 0x80;

/// The attribute of a parameter's values.
const VALUE: u8 = 0x10;

/// The format of a parameter that was changed.
const ZERO: u8 = 0x40;
/// The format of an error.
const ERROR_FORMAT: u8 = 0x44;

/// The format of a parameter's values, by its number in the profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(missing_docs, reason = "their names say it")]
pub enum Format {
    Boolean = 1,
    Integer8 = 2,
    Integer16 = 3,
    Integer32 = 4,
    Unsigned8 = 5,
    Unsigned16 = 6,
    Unsigned32 = 7,
    FloatingPoint = 8,
}

impl Format {
    /// All formats, with their names.
    pub const ALL: [(&'static str, Self); 8] = [
        ("Boolean", Self::Boolean),
        ("Integer8", Self::Integer8),
        ("Integer16", Self::Integer16),
        ("Integer32", Self::Integer32),
        ("Unsigned8", Self::Unsigned8),
        ("Unsigned16", Self::Unsigned16),
        ("Unsigned32", Self::Unsigned32),
        ("FloatingPoint", Self::FloatingPoint),
    ];

    /// The octets of a value.
    pub const fn octets(self) -> usize {
        match self {
            Self::Boolean | Self::Integer8 | Self::Unsigned8 => 1,
            Self::Integer16 | Self::Unsigned16 => 2,
            Self::Integer32 | Self::Unsigned32 | Self::FloatingPoint => 4,
        }
    }
}

/// The octets of a value in a request; `None` for an unknown format. Requests can also have plain bytes, words and
/// double words.
fn octets_of(format: u8) -> Option<usize> {
    match format {
        0x41 => Some(1),
        0x42 => Some(2),
        0x43 => Some(4),
        _ => {
            let mut all = Format::ALL.iter();
            let own = all.find(|(_, own)| *own as u8 == format);
            own.map(|(_, own)| own.octets())
        }
    }
}

/// A parameter of a drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// The number, 1 to 65535.
    pub number: u16,
    /// The format of its values.
    pub format: Format,
    /// The parameter has elements, counted from 0; otherwise it has one value.
    pub is_array: bool,
    /// The octets of all values at power-on, big-endian.
    pub octets: Vec<u8>,
    /// Masters may change the parameter.
    pub is_writable: bool,
}

/// Why a parameter cannot be read or changed, by the numbers of the profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
enum Wrong {
    Number = 0x00,
    ReadOnly = 0x01,
    Subindex = 0x03,
    NoArray = 0x04,
    Format = 0x05,
    NoText = 0x0F,
    TooLong = 0x15,
    Address = 0x16,
    UnknownFormat = 0x17,
    Count = 0x18,
}

/// The address of a parameter in a request.
struct Address {
    attribute: u8,
    elements: u8,
    number: u16,
    subindex: u16,
}

/// Serves a request; returns the answer that the master reads next, of at most `limit` octets. `first` is the number of
/// the first parameter among the records of the machine.
pub(super) fn serve(
    request: &[u8],
    all: &mut [Parameter],
    first: usize,
    limit: usize,
    machine: &mut impl Machine,
) -> Result<Vec<u8>, Refusal> {
    let (&[reference, service, axis, count], rest) =
        request.split_first_chunk::<HEAD>().ok_or(Refusal::Range)?;
    let length = ADDRESS * usize::from(count);
    let (addresses, mut values) = rest.split_at_checked(length).ok_or(Refusal::Range)?;
    if count == 0 || !matches!(service, READ | CHANGE) || service == READ && !values.is_empty() {
        return Err(Refusal::Range);
    }
    if service == CHANGE {
        // A request that is not well formed changes nothing.
        let mut rest = values;
        for _ in 0..count {
            if take(&mut rest)?.is_none() {
                break;
            }
        }
    }
    let mut blocks = Vec::new();
    let mut has_failed = false;
    let mut is_lost = false;
    for (number, address) in addresses.chunks_exact(ADDRESS).enumerate() {
        let address = Address {
            attribute: address[0],
            elements: address[1],
            number: u16::from_be_bytes([address[2], address[3]]),
            subindex: u16::from_be_bytes([address[4], address[5]]),
        };
        // Room for the errors of all parameters that follow.
        let reserved = HEAD + ERROR * (usize::from(count) - number - 1);
        let room = limit.saturating_sub(reserved + blocks.len());
        let served = if service == READ {
            read(&address, all, first, room, machine, &mut blocks)
        } else if is_lost {
            Err(Wrong::UnknownFormat)
        } else if let Some(new) = take(&mut values)? {
            change(&address, new, all, first, machine).map(|()| blocks.extend([ZERO, 0]))
        } else {
            // The values behind those of an unknown length cannot be found.
            is_lost = true;
            Err(Wrong::UnknownFormat)
        };
        if let Err(why) = served {
            has_failed = true;
            blocks.extend([ERROR_FORMAT, 1]);
            blocks.extend((why as u16).to_be_bytes());
        }
    }
    let failed = if has_failed { FAILED } else { 0 };
    let mut answer = vec![reference, service | failed, axis, count];
    if service == READ || has_failed {
        answer.append(&mut blocks);
    }
    Ok(answer)
}

/// The values of a parameter in a request: their format, number, and octets.
type Values<'a> = (u8, u8, &'a [u8]);

/// Takes the next values; `None` if their format is unknown.
fn take<'a>(rest: &mut &'a [u8]) -> Result<Option<Values<'a>>, Refusal> {
    let (&[format, count], behind) = rest.split_first_chunk().ok_or(Refusal::Range)?;
    let Some(octets) = octets_of(format) else {
        return Ok(None);
    };
    let length = octets * usize::from(count);
    let (values, behind) = behind.split_at_checked(length).ok_or(Refusal::Range)?;
    // An octet fills up an odd number; at the end it may be left out.
    *rest = behind.get(length % 2..).unwrap_or_default();
    Ok(Some((format, count, values)))
}

/// The parameter at `address`, and the octets that the address means.
fn find(address: &Address, all: &[Parameter]) -> Result<(usize, std::ops::Range<usize>), Wrong> {
    let found = all.iter().position(|own| own.number == address.number);
    let found = found.ok_or(Wrong::Number)?;
    let own = &all[found];
    match address.attribute & 0xF0 {
        VALUE => {}
        0x30 => return Err(Wrong::NoText),
        _ => return Err(Wrong::Address),
    }
    if !own.is_array && address.subindex != 0 {
        return Err(Wrong::NoArray);
    }
    if !own.is_array && address.elements > 1 || own.is_array && address.elements == 0 {
        return Err(Wrong::Address);
    }
    let octets = own.format.octets();
    let begin = octets * usize::from(address.subindex);
    let range = begin..begin + octets * usize::from(address.elements.max(1));
    if range.end > own.octets.len() {
        return Err(Wrong::Subindex);
    }
    Ok((found, range))
}

fn read(
    address: &Address,
    all: &[Parameter],
    first: usize,
    room: usize,
    machine: &mut impl Machine,
    blocks: &mut Vec<u8>,
) -> Result<(), Wrong> {
    let (found, range) = find(address, all)?;
    let length = range.len().next_multiple_of(2);
    if 2 + length > room {
        return Err(Wrong::TooLong);
    }
    let mut octets = all[found].octets.clone();
    machine.read(first + found, &mut octets);
    blocks.extend([all[found].format as u8, address.elements.max(1)]);
    let end = blocks.len() + length;
    blocks.extend_from_slice(&octets[range]);
    blocks.resize(end, 0);
    Ok(())
}

fn change(
    address: &Address,
    (format, count, values): Values<'_>,
    all: &mut [Parameter],
    first: usize,
    machine: &mut impl Machine,
) -> Result<(), Wrong> {
    let (found, range) = find(address, all)?;
    let own = &mut all[found];
    if !own.is_writable {
        return Err(Wrong::ReadOnly);
    }
    if count != address.elements.max(1) {
        return Err(Wrong::Count);
    }
    let is_plain = format > ZERO && octets_of(format) == Some(own.format.octets());
    if format != own.format as u8 && !is_plain {
        return Err(Wrong::Format);
    }
    own.octets[range].copy_from_slice(values);
    machine.written(first + found, &own.octets);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::acyclic::RECORD_LIMIT;

    #[derive(Default)]
    struct Kept {
        written: Vec<(usize, Vec<u8>)>,
    }

    impl Machine for Kept {
        fn read(&mut self, record: usize, octets: &mut [u8]) {
            if record == 102 {
                octets[0] = 0x11;
            }
        }

        fn written(&mut self, record: usize, octets: &[u8]) {
            self.written.push((record, octets.to_vec()));
        }

        fn refused(&mut self, _: bool, _: u8, _: u8, _: Refusal) {}
    }

    fn parameters() -> Vec<Parameter> {
        let own = |number, format, is_array, octets: &[u8], is_writable| Parameter {
            number,
            format,
            is_array,
            octets: octets.to_vec(),
            is_writable,
        };
        let mut faults = 1355_u16.to_be_bytes().to_vec();
        faults.resize(16, 0);
        vec![
            own(945, Format::Unsigned16, true, &faults, false),
            own(1121, Format::FloatingPoint, false, &[0; 4], true),
            own(10, Format::Unsigned8, true, &[1, 2, 3], true),
            own(11, Format::Unsigned32, true, &[0; 4 * 60], false),
        ]
    }

    fn serve(all: &mut [Parameter], machine: &mut Kept, request: &[u8]) -> Vec<u8> {
        super::serve(request, all, 100, RECORD_LIMIT, machine).expect("a request")
    }

    /// "Reading the fault buffer" of the manuals of SINAMICS S120 and DCM.
    #[test]
    fn the_makers_example_of_reading_eight_faults() {
        let request = [0x25, 0x01, 0x02, 0x01, 0x10, 0x08, 0x03, 0xB1, 0, 0];
        let answer = serve(&mut parameters(), &mut Kept::default(), &request);
        let mut expected = vec![0x25, 0x01, 0x02, 0x01, 0x06, 0x08, 0x05, 0x4B];
        expected.resize(22, 0);
        assert_eq!(answer, expected);
    }

    /// "Set p1121 = 12.15" of the manual of SINAMICS G120X.
    #[test]
    fn the_makers_example_of_changing_a_time() {
        let request = [
            0x80, 0x02, 0x01, 0x01, 0x10, 0x01, 0x04, 0x61, 0, 0, 0x08, 0x01, 0x41, 0x42, 0x66,
            0x66,
        ];
        let (mut all, mut machine) = (parameters(), Kept::default());
        assert_eq!(serve(&mut all, &mut machine, &request), [0x80, 2, 1, 1]);
        assert_eq!(machine.written, [(101, 12.15_f32.to_be_bytes().to_vec())]);
        let request = [7, 0x01, 0x01, 0x01, 0x10, 0x00, 0x04, 0x61, 0, 0];
        let answer = serve(&mut all, &mut machine, &request);
        assert_eq!(answer, [7, 1, 1, 1, 8, 1, 0x41, 0x42, 0x66, 0x66]);
    }

    #[test]
    fn several_parameters_are_served_each_with_its_own_error() {
        let (mut all, mut machine) = (parameters(), Kept::default());
        let request = [
            1, 1, 0, 3, 0x10, 3, 0, 10, 0, 0, 0x10, 1, 0, 99, 0, 0, 0x10, 1, 0, 10, 0, 2,
        ];
        assert_eq!(
            serve(&mut all, &mut machine, &request),
            [
                1, 0x81, 0, 3, 5, 3, 0x11, 2, 3, 0, 0x44, 1, 0, 0, 5, 1, 3, 0
            ]
        );
        // An odd number of octets, then words of the right size, then one that cannot be changed.
        let request = [
            2, 2, 0, 3, 0x10, 1, 0, 10, 0, 1, 0x10, 1, 0x04, 0x61, 0, 0, 0x10, 1, 0x03, 0xB1, 0, 0,
            5, 1, 9, 0, 0x43, 1, 1, 2, 3, 4, 6, 1, 0, 0,
        ];
        assert_eq!(
            serve(&mut all, &mut machine, &request),
            [2, 0x82, 0, 3, 0x40, 0, 0x40, 0, 0x44, 1, 0, 1]
        );
        let changed = [(102, vec![1, 9, 3]), (101, vec![1, 2, 3, 4])];
        assert_eq!(machine.written, changed);
    }

    #[test]
    fn each_mistake_has_its_number() {
        for (address, code) in [
            ([0x10, 1, 0, 99, 0, 0], 0x00),
            ([0x10, 1, 0, 10, 0, 3], 0x03),
            ([0x10, 4, 0, 10, 0, 0], 0x03),
            ([0x10, 1, 0x04, 0x61, 0, 1], 0x04),
            ([0x10, 2, 0x04, 0x61, 0, 0], 0x16),
            ([0x10, 0, 0, 10, 0, 0], 0x16),
            ([0x20, 1, 0, 10, 0, 0], 0x16),
            ([0x30, 1, 0, 10, 0, 0], 0x0F),
            ([0x10, 60, 0, 11, 0, 0], 0x15),
        ] {
            let mut request = vec![1, 1, 0, 1];
            request.extend(address);
            let answer = serve(&mut parameters(), &mut Kept::default(), &request);
            assert_eq!(answer, [1, 0x81, 0, 1, 0x44, 1, 0, code], "{address:02X?}");
        }
        let address = [0x10, 1, 0, 10, 0, 0];
        for (values, code) in [
            (&[6, 1, 0, 0][..], 0x05),
            (&[0x42, 1, 0, 0], 0x05),
            (&[5, 2, 0, 0], 0x18),
            (&[0x40, 0], 0x17),
            (&[9, 1, 0, 0], 0x17),
        ] {
            let mut request = vec![1, 2, 0, 1];
            request.extend(address);
            request.extend(values);
            let answer = serve(&mut parameters(), &mut Kept::default(), &request);
            assert_eq!(answer, [1, 0x82, 0, 1, 0x44, 1, 0, code], "{values:02X?}");
        }
    }

    #[test]
    fn a_request_without_its_form_is_refused_and_an_answer_always_fits() {
        let mut machine = Kept::default();
        for request in [
            &[][..],
            &[1, 1, 0],
            &[1, 1, 0, 0],
            &[1, 3, 0, 1, 0x10, 1, 0, 10, 0, 0],
            &[1, 1, 0, 2, 0x10, 1, 0, 10, 0, 0],
            &[1, 1, 0, 1, 0x10, 1, 0, 10, 0, 0, 5, 1, 1],
            &[1, 2, 0, 1, 0x10, 1, 0, 10, 0, 0],
            &[1, 2, 0, 1, 0x10, 1, 0, 10, 0, 0, 5, 1],
        ] {
            let served = super::serve(request, &mut parameters(), 100, RECORD_LIMIT, &mut machine);
            assert_eq!(served, Err(Refusal::Range), "{request:02X?}");
        }
        // The values of the second parameter are missing: the first one stays, too.
        let request = [
            1, 2, 0, 2, 0x10, 1, 0, 10, 0, 0, 0x10, 1, 0, 10, 0, 1, 5, 1, 9, 0,
        ];
        let mut all = parameters();
        let served = super::serve(&request, &mut all, 100, RECORD_LIMIT, &mut machine);
        assert_eq!((served, all), (Err(Refusal::Range), parameters()));
        assert_eq!(machine.written, []);
        let mut request = vec![1, 1, 0, 39];
        for _ in 0..39 {
            request.extend([0x10, 20, 0, 11, 0, 0]);
        }
        let answer = serve(&mut parameters(), &mut machine, &request);
        assert!(answer.len() <= RECORD_LIMIT);
        assert_eq!(answer[4..6], [7, 20]);
        assert_eq!(answer[answer.len() - 4..], [0x44, 1, 0, 0x15]);
    }
}
