//! The device identification: function 43, kind 14.

use super::{Exception, PDU_LIMIT};

/// The kind of encapsulated interface that reads the device identification.
pub(super) const READ_DEVICE_IDENTIFICATION: u8 = 14;

/// Basic identification, as a stream and object by object; [`REGULAR`] with regular identification, too.
const BASIC: u8 = 0x81;
const REGULAR: u8 = 0x82;

/// The objects of the basic identification, and all that the standard names.
const BASIC_OBJECTS: usize = 3;
pub(super) const OBJECTS: usize = 7;

/// The header of an answer: function, kind, access, conformity, more follows, next object, number of objects.
const HEADER: usize = 7;

/// The longest text of an object that fits into an answer.
pub(super) const TEXT_LIMIT: usize = PDU_LIMIT - HEADER - 2;

/// The result of taking an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// The identification is complete.
    Whole,
    /// The next answer starts with this object.
    MoreFrom(u8),
}

/// The identification of a device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identification {
    /// Vendor's name, product code, major and minor revision; then vendor's URL, names of product, model and
    /// application, which do not exist if empty.
    pub objects: [String; OBJECTS],
    /// The answer to function 17: server id, run indicator and additional data; `None` if the device does not have that
    /// function.
    pub server_id: Option<Vec<u8>>,
}

impl Identification {
    /// The identification of the driver called `name`.
    ///
    /// Without a revision: a client that may write to this driver must not lose that right by an update of tickbus.
    pub fn of_driver(name: &str) -> Self {
        let ascii = |c: char| if matches!(c, ' '..='~') { c } else { '?' };
        let name = name.chars().map(ascii).take(TEXT_LIMIT).collect();
        let mut objects: [String; OBJECTS] = Default::default();
        objects[..2].clone_from_slice(&["tickbus".to_owned(), name]);
        Self {
            objects,
            server_id: None,
        }
    }

    /// The identification in one line: vendor, product, revision.
    pub fn line(&self) -> String {
        let basic = self.objects[..BASIC_OBJECTS].iter();
        let texts = basic.map(|text| text.trim());
        let texts: Vec<&str> = texts.filter(|text| !text.is_empty()).collect();
        texts.join(" ")
    }

    /// Answers a request of function 17; `data` follows its function code.
    ///
    /// # Errors
    ///
    /// The device does not have the function, or the request has data.
    pub(super) fn answer_server_id(
        &self,
        data: &[u8],
        reply: &mut Vec<u8>,
    ) -> Result<(), Exception> {
        let id = self.server_id.as_ref().ok_or(Exception::ILLEGAL_FUNCTION)?;
        if !data.is_empty() {
            return Err(Exception::ILLEGAL_DATA_VALUE);
        }
        reply.push(u8::try_from(id.len()).expect("shorter than a PDU"));
        reply.extend_from_slice(id);
        Ok(())
    }

    /// Answers a request of function 43; `data` follows its function code.
    ///
    /// # Errors
    ///
    /// The kind of interface is another one, the access is invalid, or there is no such object.
    pub(super) fn answer(&self, data: &[u8], reply: &mut Vec<u8>) -> Result<(), Exception> {
        let (&kind, data) = data.split_first().ok_or(Exception::ILLEGAL_DATA_VALUE)?;
        if kind != READ_DEVICE_IDENTIFICATION {
            return Err(Exception::ILLEGAL_FUNCTION);
        }
        let &[access, object] = data else {
            return Err(Exception::ILLEGAL_DATA_VALUE);
        };
        let exists = |id: usize| id < BASIC_OBJECTS || !self.objects[id].is_empty();
        let has_regular = (BASIC_OBJECTS..OBJECTS).any(exists);
        let first = usize::from(object);
        let last = match access {
            1 => BASIC_OBJECTS,
            // A request for more objects than there are gets these.
            2 | 3 => OBJECTS,
            4 => first + 1,
            _ => return Err(Exception::ILLEGAL_DATA_VALUE),
        };
        let first = match (first < OBJECTS.min(last) && exists(first), access) {
            (true, _) => first,
            (false, 4) => return Err(Exception::ILLEGAL_DATA_ADDRESS),
            // A stream from an object that does not exist starts at the first one.
            (false, _) => 0,
        };
        let begin = reply.len();
        reply.extend_from_slice(&[
            super::Function::DeviceIdentification.code(),
            kind,
            access,
            if has_regular { REGULAR } else { BASIC },
            0,
            0,
            0,
        ]);
        let mut count = 0;
        let objects = (0_u8..).zip(&self.objects).take(last).skip(first);
        for (id, text) in objects.filter(|(id, _)| exists(usize::from(*id))) {
            let text = &text.as_bytes()[..text.len().min(TEXT_LIMIT)];
            if reply.len() - begin + 2 + text.len() > PDU_LIMIT {
                // More follows, starting with this one.
                reply[begin + 4..begin + 6].copy_from_slice(&[0xFF, id]);
                break;
            }
            count += 1;
            reply.push(id);
            reply.push(u8::try_from(text.len()).expect("shorter than a PDU"));
            reply.extend_from_slice(text);
        }
        reply[begin + 6] = count;
        Ok(())
    }

    /// Takes the objects of an answer; `data` follows its function code. `None` if the answer is malformed.
    pub(super) fn take(&mut self, data: &[u8]) -> Option<Taken> {
        let &[
            READ_DEVICE_IDENTIFICATION,
            _,
            _,
            more,
            next,
            count,
            ref objects @ ..,
        ] = data
        else {
            return None;
        };
        let mut rest = objects;
        for _ in 0..count {
            let (&[id, length], after) = rest.split_first_chunk::<2>()?;
            let (text, after) = after.split_at_checked(usize::from(length))?;
            rest = after;
            if let Some(object) = self.objects.get_mut(usize::from(id)) {
                // One line of printable characters, whatever the device sends.
                let printable = |byte: &u8| {
                    if matches!(byte, b' '..=b'~') {
                        char::from(*byte)
                    } else {
                        '?'
                    }
                };
                *object = text.iter().map(printable).collect();
            }
        }
        rest.is_empty().then_some(if more == 0xFF {
            Taken::MoreFrom(next)
        } else {
            Taken::Whole
        })
    }
}

/// The length of the PDU of an answer that starts like this, as soon as it is determined.
pub(super) fn length(beginning: &[u8]) -> Option<usize> {
    if beginning.first()? & super::function::EXCEPTION_BIT != 0 {
        return Some(2);
    }
    let count = *beginning.get(HEADER - 1)?;
    let mut end = HEADER;
    for _ in 0..count {
        end += 2 + usize::from(*beginning.get(end + 1)?);
    }
    Some(end)
}
