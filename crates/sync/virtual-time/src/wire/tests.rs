use proptest::prelude::*;

use super::*;
use crate::Variable;

fn declaration() -> impl Strategy<Value = Declaration> {
    let name = "[a-zä%.]{1,40}";
    let variable = (name, proptest::sample::select(&DataType::ALL[..]));
    let variable = variable.prop_map(|(name, data_type)| Variable { name, data_type });
    (
        name,
        1..=u32::MAX,
        proptest::option::of(1..=i64::MAX),
        proptest::collection::vec(variable, 0..9),
        proptest::collection::vec(name, 0..9),
    )
        .prop_map(|(name, multiple, interval, writes, reads)| Declaration {
            name,
            multiple: multiple.try_into().expect("above zero"),
            interval: interval.map(Nanos),
            writes,
            reads,
        })
}

fn ended() -> impl Strategy<Value = Result<Outcome, Ended>> {
    let ok = any::<(u64, i64, u64)>().prop_map(|(steps, time, hash)| {
        Ok(Outcome {
            steps,
            time: Nanos(time),
            hash: TraceHash(hash),
        })
    });
    let client = proptest::option::of("[a-z]{1,20}");
    let cause = proptest::sample::select(&Cause::ALL[..]);
    let err = (cause, client, ".{0,99}", any::<u64>());
    let err = err.prop_map(|(cause, client, reason, steps)| {
        Err(Ended {
            cause,
            client,
            reason,
            steps,
        })
    });
    prop_oneof![ok, err]
}

/// The content of the only frame in `out`.
fn content(out: &[u8]) -> &[u8] {
    let frame = frame(out).expect("a frame").expect("all of it");
    assert_eq!(frame.len() + HEADER, out.len());
    frame
}

proptest! {
    #[test]
    fn what_clients_send_is_read_as_it_was_written(
        declaration in declaration(),
        sequence: u64,
        next: u64,
        writes: Vec<u64>,
        reason in ".{0,99}",
    ) {
        let mut out = Vec::new();
        join(&mut out, &declaration).expect("short names");
        let version = VERSION;
        prop_assert_eq!(from_client(content(&out)), Ok(FromClient::Join { declaration, version }));
        out.clear();
        done(&mut out, sequence, next, &writes);
        match from_client(content(&out)) {
            Ok(FromClient::Done { sequence: read, next: wanted, writes: slots }) => {
                prop_assert_eq!((read, wanted), (sequence, next));
                prop_assert_eq!(slots.iter().collect::<Vec<_>>(), writes);
            }
            other => prop_assert!(false, "{:?}", other),
        }
        out.clear();
        give_up(&mut out, &reason);
        prop_assert_eq!(from_client(content(&out)), Ok(FromClient::GiveUp(&reason)));
        let (token, address) = (sequence, &*format!("unix:/tmp/{next}"));
        out.clear();
        at(&mut out, token, address);
        prop_assert_eq!(from_client(content(&out)), Ok(FromClient::At { token, address }));
        out.clear();
        met(&mut out, token, &reason);
        let met = FromClient::Met { token, reason: &reason };
        prop_assert_eq!(from_client(content(&out)), Ok(met));
        out.clear();
        hello(&mut out, token, 7);
        prop_assert_eq!(read_hello(content(&out)), Ok((token, 7)));
    }

    #[test]
    fn the_list_of_members_is_read_as_it_was_written(
        token: u64,
        declarations in proptest::collection::vec(declaration(), 0..5),
    ) {
        let member = |declaration: Declaration| (format!("127.0.0.1:{token}"), declaration);
        let list = MemberList {
            token,
            step: Nanos(token.cast_signed()),
            own: 3,
            members: declarations.into_iter().map(member).collect(),
        };
        let mut out = Vec::new();
        to_client(&mut out, &ToClient::Members(3, &list));
        for length in 0..content(&out).len() {
            prop_assert!(from_server(&content(&out)[..length]).is_err());
        }
        prop_assert_eq!(from_server(content(&out)), Ok(FromServer::Members(list)));
        for message in [ToClient::Meet(token), ToClient::Until(token)] {
            out.clear();
            to_client(&mut out, &message);
            let read = from_server(content(&out));
            let is_meet = read == Ok(FromServer::Meet(token));
            prop_assert!(is_meet || read == Ok(FromServer::Until(token)));
        }
    }

    #[test]
    fn what_the_server_sends_is_read_as_it_was_written(
        sequence: u64,
        time: i64,
        reads: Vec<u64>,
        types in proptest::collection::vec(proptest::sample::select(&DataType::ALL[..]), 0..20),
        end in ended(),
        whom in ".{0,99}",
    ) {
        let mut out = Vec::new();
        let step = Step { sequence, time: Nanos(time) };
        to_client(&mut out, &ToClient::Step { step, reads: &reads });
        match from_server(content(&out)) {
            Ok(FromServer::Step { step: read, reads: slots }) => {
                prop_assert_eq!(read, step);
                prop_assert_eq!(slots.iter().collect::<Vec<_>>(), reads.clone());
            }
            other => prop_assert!(false, "{:?}", other),
        }
        out.clear();
        to_client(&mut out, &ToClient::Start { step: Nanos(time), reads: &types });
        let start = FromServer::Start { step: Nanos(time), reads: types };
        prop_assert_eq!(from_server(content(&out)), Ok(start));
        out.clear();
        to_client(&mut out, &ToClient::End(&end));
        prop_assert_eq!(from_server(content(&out)), Ok(FromServer::End(end)));
        out.clear();
        to_client(&mut out, &ToClient::Waiting(&whom));
        prop_assert_eq!(from_server(content(&out)), Ok(FromServer::Waiting(&whom)));
        out.clear();
        to_client(&mut out, &ToClient::Save(sequence));
        prop_assert_eq!(from_server(content(&out)), Ok(FromServer::Save(sequence)));
        out.clear();
        let state = whom.as_bytes();
        to_client(&mut out, &ToClient::Restore { sequence, writes: &reads, state });
        match from_server(content(&out)) {
            Ok(FromServer::Restore { sequence: read, writes, state: bytes }) => {
                prop_assert_eq!((read, bytes), (sequence, state));
                prop_assert_eq!(writes.iter().collect::<Vec<_>>(), reads);
            }
            other => prop_assert!(false, "{:?}", other),
        }
    }

    #[test]
    fn any_bytes_are_a_message_that_writes_itself_or_a_violation(
        bytes in proptest::collection::vec(any::<u8>(), 0..80),
    ) {
        let mut out = Vec::new();
        match from_client(&bytes) {
            Ok(FromClient::Join { declaration, version: VERSION }) => {
                join(&mut out, &declaration).expect("short");
            }
            Ok(FromClient::Done { sequence, next, writes }) => {
                done(&mut out, sequence, next, &writes.iter().collect::<Vec<_>>());
            }
            Ok(FromClient::GiveUp(reason)) => give_up(&mut out, reason),
            Ok(FromClient::At { token, address }) => at(&mut out, token, address),
            Ok(FromClient::Met { token, reason }) => met(&mut out, token, reason),
            Ok(FromClient::Saved { sequence, state }) => saved(&mut out, sequence, state),
            // Joins of version 1 can be read, but not written.
            Ok(FromClient::Join { .. }) | Err(_) => return Ok(()),
        }
        prop_assert_eq!(content(&out), &*bytes);
    }
}

#[test]
fn no_prefix_of_a_message_is_one() {
    let mut declaration = Declaration::new("plc");
    declaration.writes = vec![Variable::new("level", DataType::Real)];
    declaration.reads = vec!["speed".to_owned()];
    let mut out = Vec::new();
    join(&mut out, &declaration).expect("short names");
    for length in 0..out.len() {
        assert_eq!(frame(&out[..length]), Ok(None), "{length}");
    }
    for length in HEADER..out.len() {
        assert!(from_client(&out[HEADER..length]).is_err(), "{length}");
    }
    out.push(0);
    let longer = from_client(&out[HEADER..]).expect_err("too long");
    assert_eq!(longer, "sent a message with 1 bytes too many");
}

#[test]
fn a_step_that_is_wanted_next_has_a_number() {
    let mut out = Vec::new();
    done(&mut out, 7, 9, &[1]);
    assert_eq!(out[HEADER], DONE_UNTIL);
    for length in HEADER..HEADER + 17 {
        assert!(from_client(&out[HEADER..length]).is_err(), "{length}");
    }
    out[HEADER + 9] = 0;
    let told = from_client(&out[HEADER..]).expect_err("no step");
    assert_eq!(told, "asked for step 0 as its next one; expected 1 or more");
    out.clear();
    done(&mut out, 7, 0, &[1]);
    assert_eq!(out[HEADER], DONE);
}

#[test]
fn lengths_out_of_range_are_violations_before_the_frame_is_there() {
    assert!(frame(&[0, 0, 0, 0]).is_err());
    assert!(frame(&[1, 0, 16, 0]).is_err());
    assert_eq!(frame(&[0, 0, 16, 0]), Ok(None));
}

#[test]
fn the_codes_of_types_and_causes_do_not_change() {
    let types = DataType::ALL.map(DataType::name).join(" ");
    assert_eq!(
        types,
        "BOOL BYTE SINT USINT WORD INT UINT DWORD DINT UDINT REAL LWORD LINT ULINT LREAL"
    );
    let causes = Cause::ALL.map(Cause::name).join(" ");
    assert_eq!(
        causes,
        "configuration refused lost hung protocol failed logic stopped system"
    );
}

#[test]
fn another_version_is_refused_by_its_number() {
    let mut out = Vec::new();
    join(&mut out, &Declaration::new("plc")).expect("short names");
    out[HEADER + 5] = 7;
    let told = from_client(&out[HEADER..]).expect_err("another version");
    assert_eq!(
        told,
        "speaks version 7 of the format, and this server versions 1 to 4"
    );
}

#[test]
fn a_long_reason_is_cut_between_two_characters() {
    let mut out = Vec::new();
    give_up(&mut out, &format!("x{}", "ä".repeat(4000)));
    match from_client(content(&out)) {
        Ok(FromClient::GiveUp(reason)) => assert_eq!(reason.len(), 4095),
        other => panic!("{other:?}"),
    }
}
