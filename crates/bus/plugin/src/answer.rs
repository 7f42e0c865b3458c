//! Messages from a helper to its host.

use serde::{Deserialize, Serialize, Serializer};

use super::Outcome;
use tickbus_fieldbus::BusError;
use tickbus_net::Message;

/// The longest text in an answer, in bytes.
const TEXT_LIMIT: usize = 8000;

/// A message from a helper to its host.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Answer {
    /// Hello: sent first, unrequested; carries the protocol version.
    Hello {
        /// The version of the helper's tickbus; both ends must have the same.
        version: String,
    },
    /// The library is loaded and its bus is open.
    Opened,
    /// The exchange is complete; the received data are in the shared memory.
    Done(Outcome),
    /// The last request failed in the library.
    Failed(#[serde(with = "Failure")] BusError),
}

/// [`BusError`] as it is sent.
#[derive(Serialize, Deserialize)]
#[serde(remote = "BusError")]
enum Failure {
    Link(#[serde(serialize_with = "shortened")] String),
    Left(#[serde(serialize_with = "shortened")] String),
    Protocol(#[serde(serialize_with = "shortened")] String),
    Refused(#[serde(serialize_with = "shortened")] String),
}

impl Answer {
    /// The name in messages.
    pub(super) const fn name(&self) -> &'static str {
        match self {
            Self::Hello { .. } => "a hello",
            Self::Opened => "\"opened\"",
            Self::Done(_) => "\"done\"",
            Self::Failed(_) => "\"failed\"",
        }
    }
}

/// As much of a text as an answer can hold, in whole characters.
fn shortened<S: Serializer>(text: &str, into: S) -> Result<S::Ok, S::Error> {
    let mut end = text.len().min(TEXT_LIMIT);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    into.serialize_str(&text[..end])
}

impl Message for Answer {
    const MOST: usize = TEXT_LIMIT + 4;
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tickbus_net::{Inbox, WireError};

    fn answers() -> impl Strategy<Value = Answer> {
        prop_oneof![
            ".{0,40}".prop_map(|version| Answer::Hello { version }),
            Just(Answer::Opened),
            (0..8).prop_map(|code| Answer::Done(Outcome::from_code(code).expect("a sum of flags"))),
            (0..4_usize, ".{0,200}").prop_map(|(fault, text)| {
                let kinds: [fn(String) -> BusError; 4] = [
                    BusError::Link,
                    BusError::Protocol,
                    BusError::Refused,
                    BusError::Left,
                ];
                let kind = kinds[fault];
                Answer::Failed(kind(text))
            }),
        ]
    }

    /// All messages in `bytes`, passed in pieces of `piece` bytes.
    fn read(bytes: &[u8], piece: usize) -> Result<Vec<Answer>, WireError> {
        let (mut inbox, mut found) = (Inbox::new(), Vec::new());
        for piece in bytes.chunks(piece) {
            inbox.push(piece);
            while let Some(answer) = inbox.take()? {
                found.push(answer);
            }
        }
        Ok(found)
    }

    proptest! {
        #[test]
        fn answers_arrive_as_they_were_sent_in_pieces_of_any_size(
            sent in prop::collection::vec(answers(), 0..6), piece in 1..50_usize,
        ) {
            let bytes: Vec<u8> = sent.iter().flat_map(Message::write).collect();
            prop_assert_eq!(read(&bytes, piece), Ok(sent));
        }

        #[test]
        fn a_truncated_answer_is_none_yet(answer in answers(), cut in any::<prop::sample::Index>()) {
            let bytes = answer.write();
            prop_assert_eq!(read(&bytes[..cut.index(bytes.len())], 1000), Ok(vec![]));
        }

        #[test]
        fn a_flipped_bit_makes_another_answer_or_none(
            answer in answers(), bit in any::<prop::sample::Index>(),
        ) {
            let mut bytes = answer.write();
            let bit = bit.index(bytes.len() * 8);
            bytes[bit / 8] ^= 1 << (bit % 8);
            if let Ok(found) = read(&bytes, 1000) {
                prop_assert_ne!(found, vec![answer]);
            }
        }

        #[test]
        fn any_bytes_are_answers_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..100)) {
            if let Ok(found) = read(&bytes, 7) {
                for answer in found {
                    prop_assert_eq!(read(&answer.write(), 1000), Ok(vec![answer]));
                }
            }
        }
    }

    #[test]
    fn what_is_no_answer_is_told_apart() {
        let error = |bytes: &[u8]| read(bytes, 100).expect_err("no answer").to_string();
        assert_eq!(
            error(&[0xFF, 0xFF, 0, 0]),
            "a message of 65535 bytes, expected at most 8004"
        );
        let unreadable: [&[u8]; 5] = [
            &[0, 0, 0, 0],
            &[1, 0, 0, 0, 9],
            &[1, 0, 0, 0, 2],
            &[2, 0, 0, 0, 2, 8],
            &[3, 0, 0, 0, 0, 1, 0xFF],
        ];
        for bytes in unreadable {
            let text = error(bytes);
            assert!(
                text.starts_with("a message that cannot be read ("),
                "{text}"
            );
        }
        assert_eq!(error(&[2, 0, 0, 0, 1, 0]), "a message with bytes left over");
    }

    #[test]
    fn a_text_that_is_too_long_is_shortened() {
        let answer = Answer::Failed(BusError::Link("ä".repeat(TEXT_LIMIT)));
        let read = read(&answer.write(), 100).expect("an answer");
        let [Answer::Failed(BusError::Link(text))] = &read[..] else {
            panic!("{read:?}");
        };
        assert_eq!(text.len(), TEXT_LIMIT);
    }
}
