use proptest::prelude::*;

use super::*;
use crate::command::seal;
use crate::{Access, Heads, Status};

const TIMING: Timing = Timing {
    baud: 9600,
    timeout: Nanos::from_secs(1),
};

const READ: Command<'_> = Command::once(
    1,
    Access::Read {
        address: 0,
        length: 2,
    },
);

fn at(millis: i64) -> Nanos {
    Nanos::from_millis(millis)
}

fn asking(command: &Command<'_>) -> Client {
    let mut client = Client::new(CarrierType::Idc1K, TIMING);
    client.ask(at(0), command);
    let count = client.to_write().len();
    client.wrote(count);
    assert!(client.to_write().is_empty());
    client
}

fn sealed(text: &[u8]) -> Vec<u8> {
    let mut bytes = text.to_vec();
    seal(&mut bytes, 0);
    bytes
}

fn status(outcome: Option<Outcome>) -> Option<u8> {
    match outcome {
        Some(Outcome::Answered(answer)) => Some(answer.status.0),
        _ => None,
    }
}

#[test]
fn an_answer_comes_in_any_pieces() {
    let bytes = sealed(b"w00\x03\x03");
    for cut in 1..bytes.len() {
        let mut client = asking(&READ);
        client.hear(at(1), &bytes[..cut]);
        assert_eq!(client.poll(at(1)), None, "{cut}");
        client.hear(at(2), &bytes[cut..]);
        assert_eq!(status(client.poll(at(2))), Some(0));
        assert_eq!(client.data(), [3, 3]);
        assert!(!client.is_busy());
        assert_eq!((client.poll(at(9999)), client.skipped()), (None, 0));
    }
}

#[test]
fn after_noise_the_right_answer_is_found() {
    let mut client = asking(&READ);
    let right = sealed(b"w00ab");
    let mut damaged = right.clone();
    damaged[3] ^= 4;
    client.hear(
        at(1),
        &[&[0xFF, b'w', 0], &damaged[..], b"w0", &right].concat(),
    );
    assert_eq!(status(client.poll(at(1))), Some(0));
    assert_eq!(client.data(), b"ab");
    assert_eq!(client.skipped(), 3 + 7 + 2);
}

#[test]
fn what_looked_like_a_longer_answer_gives_way_when_time_is_over() {
    let mut client = asking(&Command::once(
        1,
        Access::Read {
            address: 0,
            length: 60,
        },
    ));
    // The first bytes came from noise; the error after them is the answer.
    client.hear(at(1), &[b"w00", &sealed(b"w03")[..]].concat());
    assert_eq!(client.poll(at(1)), None);
    // Silence alone does not end the command, and nobody waits for that: an adapter may hold bytes back.
    let limit = client.deadline();
    assert!(limit > TIMING.timeout, "{limit}");
    assert_eq!(status(client.poll(limit)), Some(3));
}

#[test]
fn a_silent_reader_is_given_the_time_of_its_characters_and_the_time_out() {
    let mut client = asking(&READ);
    let limit = client.deadline();
    assert!(limit > TIMING.timeout && limit < at(1020), "{limit}");
    assert_eq!(client.poll(limit - Nanos(1)), None);
    assert_eq!(client.poll(limit), Some(Outcome::Silent));
    assert_eq!(client.poll(limit), None);
    // Too late.
    client.hear(limit, &sealed(b"w00ab"));
    assert_eq!((client.poll(limit), client.skipped()), (None, 7));
}

#[test]
fn silence_ends_an_answer_of_unknown_length() {
    let mut client = asking(&Command::Version);
    let bytes = sealed(b"v001.0");
    client.hear(at(1), &bytes[..3]);
    client.hear(at(90), &bytes[3..]);
    assert_eq!(client.poll(at(90)), None);
    assert_eq!(client.deadline(), at(190));
    assert_eq!(status(client.poll(at(190))), Some(0));
    assert_eq!(client.data(), b"1.0");
    // Bytes that are still incomplete by then are no answer.
    client.ask(at(300), &Command::Version);
    client.hear(at(301), b"v0");
    assert_eq!(client.deadline(), at(401));
    assert_eq!((client.poll(at(401)), client.skipped()), (None, 2));
    assert!(client.deadline() > at(1300));
}

#[test]
fn repeated_answers_come_until_the_command_is_ended() {
    let mut client = asking(&Command::Access {
        heads: Heads::One(1),
        is_auto: true,
        access: Access::Read {
            address: 0,
            length: 1,
        },
    });
    for datum in 0..5 {
        client.hear(at(1), &sealed(&[b'W', b'0', b'0', datum]));
        assert_eq!(status(client.poll(at(1))), Some(0));
        assert_eq!(client.data(), [datum]);
        assert!(!client.is_busy());
    }
    // Half an answer, then nothing, and another one.
    client.hear(at(10), b"W0");
    assert_eq!(client.poll(client.deadline()), None);
    client.ask(at(300), &Command::EndAuto);
    client.hear(at(301), &[sealed(b"W03"), sealed(b"q")].concat());
    assert_eq!(status(client.poll(at(301))), Some(3));
    assert!(client.is_busy());
    assert_eq!(status(client.poll(at(301))), Some(0));
    assert!(!client.is_busy() && client.auto.is_none());
    assert_eq!(client.skipped(), 2);
}

#[test]
fn all_heads_answer_until_the_line_is_silent() {
    let all = Command::Access {
        heads: Heads::All,
        is_auto: false,
        access: Access::Read {
            address: 0,
            length: 1,
        },
    };
    let mut client = asking(&all);
    client.hear(at(1), &[sealed(b"w001a"), sealed(b"w083")].concat());
    let mut heads = Vec::new();
    while let Some(Outcome::Answered(Answer { head, status, .. })) = client.poll(at(1)) {
        heads.push((head, status));
    }
    assert_eq!(heads, [(Some(1), Status(0)), (Some(3), Status(8))]);
    assert_eq!(client.poll(client.deadline()), Some(Outcome::Over));
    assert!(!client.is_busy());
}

proptest! {
    /// Any input leads to an outcome, and data of a wrong length never do.
    #[test]
    fn any_bytes_lead_to_an_outcome(pieces in proptest::collection::vec(
        proptest::collection::vec(prop_oneof![Just(b'w'), Just(b'0'), Just(3), any::<u8>()], 0..20), 0..20)
    ) {
        let mut client = asking(&READ);
        for piece in pieces {
            client.hear(at(1), &piece);
            while let Some(outcome) = client.poll(at(1)) {
                if let Outcome::Answered(answer) = outcome {
                    prop_assert_eq!(answer.length, if answer.status.is_done() { 2 } else { 0 });
                    prop_assert_eq!(client.data().len(), answer.length);
                }
            }
        }
        let last = client.poll(at(5000));
        prop_assert!(!client.is_busy(), "{last:?}");
    }
}
