use super::*;
use crate::client::plan::Field;
use crate::item::Object;
use crate::{Tsap, hex};
use tickbus_fieldbus::PlcState;

const PATIENCE: Nanos = Nanos::from_millis(100);

/// Station 0 writes 2 bytes at DB 1 byte 2 and reads 4 at DB 1 byte 0, as in the captured conversation.
fn session(asks_who: bool) -> ClientSession {
    session_of(asks_who, &[(2, 2)], &[(0, 4)])
}

/// Station 0 writes and reads these numbers of bytes at these bytes of DB 1.
fn session_of(
    asks_who: bool,
    written: &[(usize, usize)],
    read: &[(usize, usize)],
) -> ClientSession {
    let field = |byte: usize, length: usize| Field {
        station: 0,
        frame: 0,
        object: Object::Block(1),
        first: byte * 8,
        bits: length * 8,
    };
    let terms = ConnectionParameters {
        calling: Tsap::new(&[1, 0]),
        called: Tsap::of_slot(0, 1),
        pdu: 480,
        patience: PATIENCE,
        asks_who,
    };
    let frames = FrameFields {
        written: written
            .iter()
            .map(|(byte, length)| field(*byte, *length))
            .collect(),
        read: read
            .iter()
            .map(|(byte, length)| field(*byte, *length))
            .collect(),
        lengths: vec![[2, 4]],
    };
    frames.session(terms, Nanos::ZERO)
}

/// The bytes that the session sends.
fn said(session: &mut ClientSession) -> Vec<u8> {
    let said = session.to_write().to_vec();
    session.wrote(said.len());
    said
}

#[track_caller]
fn says(session: &mut ClientSession, expected: &str) {
    assert_eq!(said(session), hex(expected));
}

fn hears(session: &mut ClientSession, text: &str) -> Result<Option<SessionEvent>, End> {
    session.hear(Nanos::ZERO, &hex(text))
}

const CONFIRM: &str = "03 00 00 16 11 d0 0001 0001 00 c0 01 0a c1 02 0100 c2 02 0101";
const AGREED: &str = "03 00 00 1b 02 f0 80 32 03 0000 0001 0008 0000 00 00 f0 00 0001 0001 01e0";
const WRITTEN: &str = "03 00 00 16 02 f0 80 32 03 0000 0002 0002 0001 00 00 05 01 ff";
const READ: &str = "03 00 00 1d 02 f0 80 32 03 0000 0003 0002 0008 00 00 04 01 ff 04 0020 01020304";

/// A session that may write, before its first cycle.
fn met() -> ClientSession {
    meet(session(false))
}

fn meet(mut session: ClientSession) -> ClientSession {
    said(&mut session);
    assert_eq!(hears(&mut session, CONFIRM), Ok(None));
    said(&mut session);
    assert_eq!(
        hears(&mut session, AGREED),
        Ok(Some(SessionEvent::Met(480, None)))
    );
    session.allow(true);
    session
}

#[test]
fn the_captured_conversation_goes_as_it_went() {
    let mut session = session(false);
    says(
        &mut session,
        "03 00 00 16 11 e0 0000 0001 00 c1 02 0100 c2 02 0101 c0 01 0a",
    );
    assert_eq!(hears(&mut session, CONFIRM), Ok(None));
    says(
        &mut session,
        // But for the number of jobs at once: the client that was captured had one.
        "03 00 00 19 02 f0 80 32 01 0000 0001 0008 0000 f0 00 0008 0008 01e0",
    );
    assert_eq!(
        hears(&mut session, AGREED),
        Ok(Some(SessionEvent::Met(480, None)))
    );
    session.allow(true);
    session.frame_to_write(0).copy_from_slice(&[0xAA, 0xBB]);
    assert_eq!(session.begin(Nanos::ZERO), None);
    says(
        &mut session,
        "03 00 00 25 02 f0 80 32 01 0000 0002 000e 0006 05 01 12 0a 10 02 0002 0001 84 000010 \
         00 04 0010 aa bb",
    );
    assert_eq!(hears(&mut session, WRITTEN), Ok(None));
    says(
        &mut session,
        "03 00 00 1f 02 f0 80 32 01 0000 0003 000e 0000 04 01 12 0a 10 02 0004 0001 84 000000",
    );
    assert_eq!(hears(&mut session, READ), Ok(Some(SessionEvent::Done)));
    assert_eq!(session.frame_read(0), [1, 2, 3, 4]);
    assert!(session.is_idle() && session.to_write().is_empty());
}

#[test]
fn answers_come_in_any_pieces() {
    let whole = [hex(WRITTEN), hex(READ)].concat();
    for cut in 0..=whole.len() {
        let mut session = met();
        session.begin(Nanos::ZERO);
        // The second answer arrives before its request was written, which does not matter here.
        let mut news = session.hear(Nanos::ZERO, &whole[..cut]).expect("right");
        if news.is_none() {
            news = session.hear(Nanos::ZERO, &whole[cut..]).expect("right");
        }
        assert_eq!(news, Some(SessionEvent::Done), "{cut}");
    }
    let mut session = met();
    session.begin(Nanos::ZERO);
    let (first, second) = (hex(WRITTEN)[7..].to_vec(), hex(READ)[7..].to_vec());
    for message in [first, second] {
        for (index, byte) in message.iter().enumerate() {
            let last = index + 1 == message.len();
            let end = if last { 0x80 } else { 0 };
            let news = session.hear(Nanos::ZERO, &[3, 0, 0, 8, 2, 0xF0, end, *byte]);
            assert!(news.is_ok(), "{news:?}");
        }
    }
    assert!(session.is_idle());
}

/// Takes a new session to its first cycle, before a CPU that allows this many jobs at once in each direction.
fn met_with(session: ClientSession, calling: u16, called: u16) -> ClientSession {
    let mut session = session;
    said(&mut session);
    assert_eq!(hears(&mut session, CONFIRM), Ok(None));
    said(&mut session);
    let agreed = AGREED.replace("0001 0001", &format!("{calling:04x} {called:04x}"));
    assert_eq!(
        hears(&mut session, &agreed),
        Ok(Some(SessionEvent::Met(480, None)))
    );
    session.allow(true);
    session
}

/// The functions of the requests in these bytes.
fn functions(mut said: &[u8]) -> Vec<u8> {
    let mut functions = Vec::new();
    while let [3, 0, high, low, ..] = *said {
        functions.push(said[17]);
        said = &said[usize::from(u16::from_be_bytes([high, low]))..];
    }
    functions
}

#[test]
fn as_many_jobs_are_pending_as_the_cpu_allows_and_their_answers_come_in_any_order() {
    for (allowed, at_once) in [
        ([2, 2], 2),
        ([1, 8], 1),
        ([8, 1], 1),
        ([0, 0], 1),
        ([99, 99], 2),
    ] {
        let mut session = met_with(session(false), allowed[0], allowed[1]);
        assert_eq!(session.begin(Nanos::ZERO), None);
        let requests = functions(&said(&mut session));
        assert_eq!(requests, [function::WRITE, function::READ][..at_once]);
    }
    for order in [[WRITTEN, READ], [READ, WRITTEN]] {
        let mut session = met_with(session(false), 2, 2);
        session.begin(Nanos::ZERO);
        assert_eq!(hears(&mut session, order[0]), Ok(None));
        assert!(!session.is_idle());
        assert_eq!(
            hears(&mut session, order[0]),
            Err(End::Broken(ProtocolError::NotAsked)),
            "twice"
        );
        assert_eq!(hears(&mut session, order[1]), Ok(Some(SessionEvent::Done)));
        assert_eq!(session.frame_read(0), [1, 2, 3, 4]);
        assert_eq!(session.deadline(), Nanos::MAX);
    }
}

#[test]
fn the_next_job_follows_the_first_answer() {
    // Twenty items per job.
    let written: Vec<_> = (0..41).map(|index| (200 * index, 2)).collect();
    let mut session = met_with(session_of(false, &written, &[(0, 4)]), 2, 2);
    session.begin(Nanos::ZERO);
    assert_eq!(functions(&said(&mut session)), [function::WRITE; 2]);
    let codes = "ff".repeat(20);
    let answer = format!("03 00 00 29 02 f0 80 32 03 0000 0002 0002 0014 00 00 05 14 {codes}");
    assert_eq!(hears(&mut session, &answer), Ok(None));
    assert_eq!(functions(&said(&mut session)), [function::WRITE]);
}

#[test]
fn each_pending_answer_has_its_whole_time_since_the_one_before() {
    let mut session = met_with(session(false), 2, 2);
    session.begin(Nanos::ZERO);
    let later = PATIENCE - Nanos(1);
    assert_eq!(session.hear(later, &hex(WRITTEN)), Ok(None));
    assert_eq!(session.check(later + PATIENCE), Ok(()));
    assert_eq!(
        session.check(session.deadline()),
        Err(End::Silent(PATIENCE))
    );
}

#[test]
fn a_peer_that_answers_one_of_several_items_is_asked_again_when_all_answers_have_come() {
    let mut session = met_with(session_of(false, &[(0, 2), (200, 2)], &[(0, 4)]), 8, 8);
    session.begin(Nanos::ZERO);
    assert_eq!(
        functions(&said(&mut session)),
        [function::WRITE, function::READ]
    );
    assert_eq!(hears(&mut session, WRITTEN), Ok(None));
    assert_eq!(said(&mut session), [], "the other answer is pending");
    assert_eq!(hears(&mut session, READ), Ok(None));
    assert_eq!(
        functions(&said(&mut session)),
        [function::WRITE, function::WRITE, function::READ]
    );
    for (answer, from, to) in [(WRITTEN, "0002", "0004"), (WRITTEN, "0002", "0005")] {
        let answer = answer.replacen(from, to, 1);
        assert_eq!(hears(&mut session, &answer), Ok(None));
    }
    let read = READ.replacen("0003", "0006", 1);
    assert_eq!(hears(&mut session, &read), Ok(Some(SessionEvent::Done)));
    assert_eq!(session.refusal(0), None);
}

#[test]
fn nothing_is_written_until_it_is_allowed() {
    let mut session = met();
    session.allow(false);
    session.begin(Nanos::ZERO);
    let job = said(&mut session);
    assert_eq!(job[7 + 10], function::READ);
}

#[test]
fn a_cpu_is_asked_who_it_is_and_may_have_nothing_to_say() {
    let mut session = session(true);
    said(&mut session);
    hears(&mut session, CONFIRM).expect("right");
    said(&mut session);
    assert_eq!(hears(&mut session, AGREED), Ok(None));
    assert!(session.asks_who());
    says(
        &mut session,
        "03 00 00 21 02 f0 80 32 07 0000 0002 0008 0008 0001120411440100 ff 09 0004 0011 0000",
    );
    // The list arrives in two PDUs; the first has the order number.
    let order = "0011 0000 001c 0001 0001 36455337203531352d32414d30312d3041423020";
    hears(
        &mut session,
        &format!(
            "03 00 00 3f 02 f0 80 32 07 0000 0002 000c 0022 0001120812840101 07 01 0000 ff 09 001e {order}"
        ),
    )
    .expect("right");
    says(
        &mut session,
        "03 00 00 21 02 f0 80 32 07 0000 0003 000c 0004 0001120812440101 00000000 0a 00 0000",
    );
    hears(
        &mut session,
        "03 00 00 27 02 f0 80 32 07 0000 0003 000c 000a 0001120812840101 07 00 0000 ff 09 0006 000000000000",
    )
    .expect("right");
    // The CPU does not have the other list.
    let news = {
        said(&mut session);
        hears(
            &mut session,
            "03 00 00 21 02 f0 80 32 07 0000 0004 000c 0004 0001120812840101 00 00 d401 0a 00 0000",
        )
    };
    let Ok(Some(SessionEvent::Met(480, Some(identity)))) = news else {
        panic!("{news:?}");
    };
    assert_eq!(identity.line(), "6ES7 515-2AM01-0AB0");
}

#[test]
fn a_refusal_ends_the_connection_and_is_told() {
    let refused = |session: &mut ClientSession, text: &str| match hears(session, text) {
        Err(End::Refused(refusal)) => refusal,
        other => panic!("{other:?}"),
    };
    let mut early = session(false);
    assert_eq!(
        refused(&mut early, "03 00 00 0b 06 80 0000 0001 03"),
        Refusal::Connection(3)
    );
    let mut working = met();
    working.begin(Nanos::ZERO);
    assert_eq!(
        refused(
            &mut working,
            "03 00 00 13 02 f0 80 32 02 0000 0002 0000 0000 81 04"
        ),
        Refusal::Job(error::NO_FUNCTION)
    );
}

#[test]
fn an_item_that_is_refused_is_told_and_the_rest_of_the_cycle_is_done() {
    let mut session = met();
    session.begin(Nanos::ZERO);
    hears(
        &mut session,
        "03 00 00 16 02 f0 80 32 03 0000 0002 0002 0001 00 00 05 01 0a",
    )
    .expect("right");
    assert_eq!(hears(&mut session, READ), Ok(Some(SessionEvent::Done)));
    let Some(Refusal::Item {
        written,
        item,
        code,
    }) = session.refusal(0)
    else {
        panic!("an item was refused");
    };
    assert_eq!(
        (*written, item.range(), *code),
        (true, 2..4, ReturnCode::MISSING)
    );
    assert_eq!(session.frame_read(0), [1, 2, 3, 4]);

    let mut session = met();
    session.begin(Nanos::ZERO);
    hears(&mut session, WRITTEN).expect("right");
    let refused = "03 00 00 19 02 f0 80 32 03 0000 0003 0002 0004 00 00 04 01 05 00 0000";
    assert_eq!(hears(&mut session, refused), Ok(Some(SessionEvent::Done)));
    assert!(matches!(
        session.refusal(0),
        Some(Refusal::Item {
            written: false,
            code: ReturnCode::ADDRESS,
            ..
        })
    ));
    // An excluded station transfers nothing; included again, it does as before.
    session.suspend(0, true);
    assert_eq!(session.begin(Nanos::ZERO), Some(SessionEvent::Done));
    assert_eq!(session.refusal(0), None);
    session.suspend(0, false);
    assert_eq!(session.begin(Nanos::ZERO), None);
}

const RUNS: &str = "03 00 00 3d 02 f0 80 32 07 0000 0002 000c 0020 0001120812840100 00 00 0000 \
    ff 09 001c 0424 0000 0014 0001 5144ff08 0000000000000000 9401010000000007";

#[test]
fn a_cpu_is_asked_whether_it_runs() {
    let ask = |answer: &str| {
        let mut session = met();
        session.ask_state(Nanos::ZERO);
        assert!(session.asks_state() && !session.asks_who() && !session.is_idle());
        says(
            &mut session,
            "03 00 00 21 02 f0 80 32 07 0000 0002 0008 0008 0001120411440100 ff 09 0004 0424 0000",
        );
        let news = hears(&mut session, answer);
        assert!(session.is_idle());
        news
    };
    assert_eq!(
        ask(RUNS),
        Ok(Some(SessionEvent::State(Some(PlcState::Run))))
    );
    let stops = RUNS.replace("5144ff08", "4302ff84");
    assert_eq!(
        ask(&stops),
        Ok(Some(SessionEvent::State(Some(PlcState::Stop))))
    );
    for refuses in [
        "03 00 00 21 02 f0 80 32 07 0000 0002 000c 0004 0001120812840100 00 00 d401 0a 00 0000",
        "03 00 00 13 02 f0 80 32 02 0000 0002 0000 0000 81 04",
    ] {
        assert_eq!(ask(refuses), Ok(Some(SessionEvent::State(None))));
    }
}

/// As the server of python-snap7 3 does.
#[test]
fn a_peer_that_answers_one_of_several_items_is_asked_for_one_at_a_time() {
    let mut session = meet(session_of(false, &[(0, 2), (200, 2)], &[(0, 4)]));
    assert_eq!(session.begin(Nanos::ZERO), None);
    assert_eq!(said(&mut session)[17..19], [5, 2]);
    assert_eq!(hears(&mut session, WRITTEN), Ok(None));
    for reference in ["0003", "0004"] {
        assert_eq!(said(&mut session)[17..19], [5, 1]);
        let written = WRITTEN.replace("0000 0002 0002", &format!("0000 {reference} 0002"));
        assert_eq!(hears(&mut session, &written), Ok(None));
    }
    assert_eq!(said(&mut session)[17..19], [4, 1]);
    let read = READ.replace("0003", "0005");
    assert_eq!(hears(&mut session, &read), Ok(Some(SessionEvent::Done)));
    assert_eq!(session.refusal(0), None);
    session.begin(Nanos::ZERO);
    assert_eq!(said(&mut session)[17..19], [5, 1], "on this connection");
}

#[test]
fn what_is_no_answer_to_what_was_asked_ends_the_connection() {
    for text in [
        // Wrong reference, function, number of items or codes; a request instead; an answer sent twice.
        "03 00 00 16 02 f0 80 32 03 0000 0009 0002 0001 00 00 05 01 ff",
        "03 00 00 16 02 f0 80 32 03 0000 0002 0002 0001 00 00 04 01 ff",
        "03 00 00 17 02 f0 80 32 03 0000 0002 0002 0002 00 00 05 02 ffff",
        "03 00 00 17 02 f0 80 32 03 0000 0002 0002 0002 00 00 05 01 ffff",
        "03 00 00 11 02 f0 80 32 01 0000 0002 0000 0000",
        "03 00 00 11 02 f0 80 32 07 0000 0002 0000 0000",
        CONFIRM,
        "03 00 00 09 04 70 0001 03",
        "03 00 00 0b 06 80 0000 0001 00",
        "47 45 54",
    ] {
        let mut session = met();
        session.begin(Nanos::ZERO);
        let Err(End::Broken(fault)) = hears(&mut session, text) else {
            panic!("{text} was taken");
        };
        assert!(!fault.to_string().is_empty());
    }
    let mut session = met();
    assert_eq!(
        hears(&mut session, WRITTEN),
        Err(End::Broken(ProtocolError::NotAsked))
    );
    for (length, right) in [
        ("003f", false),
        ("0040", true),
        ("03c1", false),
        ("ffff", false),
    ] {
        let mut session = self::session(false);
        hears(&mut session, CONFIRM).expect("right");
        let text = AGREED.replace("01e0", length);
        assert_eq!(hears(&mut session, &text).is_ok(), right, "{length}");
    }
}

#[test]
fn an_answer_that_takes_too_long_is_not_waited_for() {
    let mut session = met();
    assert_eq!(session.deadline(), Nanos::MAX);
    let begin = Nanos::from_secs(7);
    session.begin(begin);
    assert_eq!(session.deadline(), begin + PATIENCE + Nanos(1));
    assert_eq!(session.check(begin + PATIENCE), Ok(()));
    assert_eq!(
        session.check(session.deadline()),
        Err(End::Silent(PATIENCE))
    );
}
