use super::*;
use proptest::prelude::*;

const TERMS: SessionParameters = SessionParameters {
    sending: Sending::Cyclic,
    cycle: Nanos(10),
    min_interval: Nanos::ZERO,
    max_age: Nanos(300),
    receives: 4,
    sends: 2,
};

fn session(sending: Sending) -> Session {
    Session::new(SessionParameters { sending, ..TERMS }, Nanos::ZERO)
}

/// The owner of an imaginary socket; its image is one byte, sent twice.
impl Session {
    fn hear(&mut self, now: i64, mut bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut records = Vec::new();
        while !bytes.is_empty() {
            let space = self.space();
            let count = space.len().min(bytes.len());
            space[..count].copy_from_slice(&bytes[..count]);
            self.arrived(Nanos(now), count);
            bytes = &bytes[count..];
            while let Some(record) = self.take() {
                records.push(record.to_vec());
            }
        }
        records
    }

    /// Makes and writes due records, as long as the system accepts any of `room` more bytes; returns the accepted
    /// bytes, and the number of whole records in them.
    fn speak(&mut self, now: i64, image: u8, room: usize) -> (Vec<u8>, usize) {
        let (mut taken, mut whole) = (Vec::new(), 0);
        loop {
            if let Some(record) = self.due(Nanos(now)) {
                record.fill(image);
                self.made(Nanos(now), |before, now| before != now);
            }
            let rest = self.to_write();
            if rest.is_empty() {
                return (taken, whole);
            }
            let count = rest.len().min(room - taken.len());
            taken.extend_from_slice(&rest[..count]);
            if !self.wrote(count) {
                return (taken, whole);
            }
            whole += 1;
        }
    }

    /// All times up to `until` at which a record is sent, when only waiting for deadlines.
    fn sends_until(&mut self, until: i64, image: impl Fn(i64) -> u8) -> Vec<i64> {
        let (mut times, mut now) = (Vec::new(), 0);
        while now <= until {
            for _ in 0..self.speak(now, image(now), usize::MAX).1 {
                times.push(now);
            }
            self.check(Nanos(now)).expect("the connection may go on");
            let deadline = self.deadline().0;
            assert!(deadline > now, "a deadline in the past at {now}");
            now = deadline;
        }
        times
    }
}

#[test]
fn a_record_that_gets_lost_counts_as_sent_and_none_is_due_before_its_time() {
    let mut session = session(Sending::OnChange);
    assert_eq!(session.speak(0, 1, usize::MAX).1, 1);
    let (mut now, mut lost) = (0, Vec::new());
    while now < 300 {
        now = session.deadline().0;
        if let Some(record) = session.due(Nanos(now)) {
            record.fill(2);
            if session.made(Nanos(now), |before, now| before != now) {
                session.lost();
                lost.push(now);
            }
        }
        assert!(session.to_write().is_empty());
        session.hear(now, &[0; 4]);
        session.check(Nanos(now)).expect("the connection may go on");
        assert!(
            session.deadline().0 > now,
            "a deadline in the past at {now}"
        );
    }
    assert_eq!(lost, [10, 110, 210], "the change, and signs of life");
    assert_eq!(session.speak(305, 3, usize::MAX).1, 0);
    assert_eq!(session.speak(310, 3, usize::MAX).1, 1);
}

#[test]
fn a_cyclic_end_sends_at_once_and_on_every_beat() {
    let mut session = session(Sending::Cyclic);
    assert_eq!(session.sends_until(45, |_| 0), [0, 10, 20, 30, 40]);
}

#[test]
fn what_a_stall_made_miss_is_left_out_and_the_beat_stays() {
    let mut session = session(Sending::Cyclic);
    assert_eq!(session.speak(0, 1, 99).0, [1, 1]);
    assert_eq!(session.speak(37, 2, 99).0, [2, 2], "late, and once only");
    assert_eq!(session.speak(39, 3, 99).0, []);
    assert_eq!(session.speak(40, 4, 99).0, [4, 4]);
}

#[test]
fn on_change_sends_changes_at_the_next_look_and_signs_of_life() {
    let mut session = session(Sending::OnChange);
    session.hear(0, &[0; 4]);
    let times = session.sends_until(300, |now| u8::from(now >= 35));
    assert_eq!(times, [0, 40, 140, 240], "max_age / 3 without a change");
}

#[test]
fn on_change_keeps_the_least_interval_and_loses_no_change_by_it() {
    let terms = SessionParameters {
        sending: Sending::OnChange,
        min_interval: Nanos(25),
        ..TERMS
    };
    let mut session = Session::new(terms, Nanos::ZERO);
    let image = |now: i64| u8::from(now >= 10);
    assert_eq!(session.sends_until(90, image), [0, 30]);
}

#[test]
fn a_look_longer_than_a_sign_of_life_does_not_delay_it() {
    let terms = SessionParameters {
        sending: Sending::OnChange,
        cycle: Nanos(250),
        ..TERMS
    };
    let mut session = Session::new(terms, Nanos::ZERO);
    assert_eq!(session.sends_until(299, |_| 0), [0, 100, 200]);
}

#[test]
fn a_blocked_end_that_sends_on_change_waits_for_a_time_to_come() {
    let mut session = session(Sending::OnChange);
    session.hear(0, &[0; 4]);
    assert_eq!(session.speak(0, 0, 1).0, [0]);
    assert_eq!(session.speak(150, 0, 0).0, []);
    assert_eq!(session.check(Nanos(150)), Ok(()));
    assert_eq!(session.deadline(), Nanos(160));
}

#[test]
fn a_reply_follows_each_record_and_nothing_else_does() {
    let mut session = session(Sending::Reply);
    assert_eq!(session.speak(0, 1, 99).0, []);
    assert_eq!(session.hear(5, &[0; 8]).len(), 2);
    assert_eq!(session.speak(5, 2, 99), (vec![2; 4], 2));
    assert_eq!(session.speak(500, 3, 99).0, []);
    session.hear(501, &[0; 3]);
    assert_eq!(
        session.speak(501, 4, 99).0,
        [],
        "not for a part of a record"
    );
}

#[test]
fn an_answer_that_is_owed_waits_for_nothing() {
    let mut session = session(Sending::Reply);
    session.hear(5, &[0; 4]);
    assert_eq!(session.check(Nanos(5)), Ok(()));
    assert!(session.deadline() <= Nanos(5));
    session.speak(5, 1, 99);
    assert!(session.deadline() > Nanos(5));
}

#[test]
fn replies_that_the_peer_has_no_room_for_are_made_later_and_none_is_lost() {
    let mut session = session(Sending::Reply);
    session.hear(0, &[0; 12]);
    assert_eq!(session.speak(0, 1, 3), (vec![1; 3], 1));
    assert_eq!(session.speak(1, 2, 0), (vec![], 0));
    assert_eq!(
        session.speak(2, 3, 99),
        (vec![1, 3, 3], 2),
        "the newest image"
    );
}

#[test]
fn a_record_that_has_not_left_yet_gives_way_to_the_newest() {
    let mut session = session(Sending::Cyclic);
    assert_eq!(session.speak(0, 1, 0).0, []);
    assert_eq!(session.speak(10, 2, 1).0, [2]);
    assert_eq!(session.speak(20, 3, 99).0, [2], "begun is begun");
    assert_eq!(session.speak(29, 3, 99).0, []);
    assert_eq!(session.speak(30, 4, 99).0, [4, 4]);
    assert_eq!(session.skipped(), 2);
}

#[test]
fn an_incomplete_record_is_a_fault_after_max_age_and_says_how_much_came() {
    let mut session = session(Sending::Cyclic);
    session.hear(50, &[0; 4]);
    session.hear(100, &[0; 2]);
    session.hear(200, &[0]);
    assert_eq!(session.check(Nanos(400)), Ok(()));
    session.speak(400, 0, 99);
    assert_eq!(session.deadline(), Nanos(401));
    let partial = Partial { have: 3, of: 4 };
    assert_eq!(
        session.check(Nanos(401)),
        Err(EndReason::Incomplete(partial, Nanos(300)))
    );
    assert_eq!(session.hear(401, &[0]).len(), 1);
    assert_eq!(session.check(Nanos(401)), Ok(()), "it had come after all");
}

#[test]
fn the_rest_of_one_read_begins_the_next_record_now() {
    let mut session = session(Sending::Cyclic);
    session.hear(0, &[0; 2]);
    assert_eq!(session.hear(250, &[0; 3]).len(), 1);
    assert_eq!(session.check(Nanos(550)), Ok(()));
    assert!(session.check(Nanos(551)).is_err());
}

#[test]
fn a_record_held_back_by_the_line_is_no_fault_of_the_peer() {
    let mut session = session(Sending::Cyclic);
    session.hear(0, &[0; 4]);
    session.speak(10, 1, 1);
    session.held_back(Nanos(200));
    assert_eq!(session.check(Nanos(500)), Ok(()));
    assert!(session.check(Nanos(501)).is_err());
}

#[test]
fn a_peer_that_never_reads_is_a_fault_after_max_age() {
    let mut session = session(Sending::Cyclic);
    session.hear(0, &[0; 4]);
    session.speak(10, 1, 1);
    assert_eq!(session.check(Nanos(310)), Ok(()));
    let partial = Partial { have: 1, of: 2 };
    assert_eq!(
        session.check(Nanos(311)),
        Err(EndReason::NotReading(partial, Nanos(300)))
    );
}

#[test]
fn a_newer_record_does_not_give_the_peer_more_time_to_read() {
    let mut session = session(Sending::Cyclic);
    for now in 0..30 {
        session.speak(now * 10, 1, 0);
        session.check(Nanos(now * 10)).expect("not yet");
    }
    session.speak(310, 1, 0);
    assert!(session.check(Nanos(310)).is_err());
}

#[test]
fn a_silent_peer_is_stale_after_max_age_and_given_up_after_four() {
    for begins in [false, true] {
        let mut session = session(Sending::Reply);
        assert!(!session.has_heard());
        if begins {
            session.hear(0, &[0; 4]);
            session.speak(0, 0, 99);
        }
        assert!(!session.is_stale(Nanos(300)) && session.is_stale(Nanos(301)));
        assert_eq!(session.deadline(), Nanos(301));
        assert_eq!(session.check(Nanos(301)), Ok(()));
        assert_eq!(session.deadline(), Nanos(1201));
        assert_eq!(session.check(Nanos(1200)), Ok(()));
        assert_eq!(
            session.check(Nanos(1201)),
            Err(EndReason::Silent(Nanos(1200)))
        );
        assert_eq!(session.has_heard(), begins);
    }
}

#[test]
fn parts_of_a_record_break_no_silence() {
    let mut session = session(Sending::Reply);
    session.hear(1199, &[0; 3]);
    assert_eq!(
        session.check(Nanos(1201)),
        Err(EndReason::Silent(Nanos(1200)))
    );
}

#[test]
fn a_peer_that_has_nothing_to_say_is_never_silent_and_must_not_speak() {
    let terms = SessionParameters {
        receives: 0,
        ..TERMS
    };
    let mut session = Session::new(terms, Nanos::ZERO);
    assert!(session.has_heard() && !session.is_stale(Nanos(9_999)));
    assert_eq!(session.sends_until(5_000, |_| 0).len(), 501);
    assert_eq!(session.left(), EndReason::Left);
    session.hear(5_000, &[1]);
    assert_eq!(session.check(Nanos(5_000)), Err(EndReason::Unasked));
    assert_eq!(session.left(), EndReason::Unasked);
}

#[test]
fn an_end_that_only_listens_sends_nothing_and_waits_for_silence() {
    let mut session = Session::new(SessionParameters { sends: 0, ..TERMS }, Nanos::ZERO);
    assert_eq!(session.speak(0, 1, 99), (vec![], 0));
    assert_eq!(session.deadline(), Nanos(301));
    session.hear(7, &[0; 4]);
    assert_eq!(session.deadline(), Nanos(308));
}

#[test]
fn how_a_peer_left_depends_on_what_it_had_sent() {
    let mut session = session(Sending::Cyclic);
    assert_eq!(session.left(), EndReason::LeftAtOnce);
    session.hear(0, &[0; 4]);
    assert_eq!(session.left(), EndReason::Left);
    session.hear(0, &[0; 3]);
    assert_eq!(
        session.left(),
        EndReason::LeftWithin(Partial { have: 3, of: 4 })
    );
}

/// An event in the life of a connection.
#[derive(Clone, Debug)]
enum Step {
    Time(i64),
    Hear(Vec<u8>),
    Speak(u8, usize),
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        (0..200_i64).prop_map(Step::Time),
        proptest::collection::vec(any::<u8>(), 0..50).prop_map(Step::Hear),
        (any::<u8>(), 0..20_usize).prop_map(|(image, room)| Step::Speak(image, room)),
    ]
}

fn terms() -> impl Strategy<Value = SessionParameters> {
    let sending = prop_oneof![
        Just(Sending::Cyclic),
        Just(Sending::OnChange),
        Just(Sending::Reply)
    ];
    (sending, 1..50_i64, 0..100_i64, 0..9_usize, 0..9_usize).prop_map(
        |(sending, cycle, least, receives, sends)| SessionParameters {
            sending,
            cycle: Nanos(cycle),
            min_interval: Nanos(least),
            receives,
            sends,
            ..TERMS
        },
    )
}

proptest! {
    /// For any events: no panic; the peer gets whole records, each of one image; there are as many replies as received
    /// records; no deadline is in the past.
    #[test]
    fn the_stream_out_is_whole_records(
        terms in terms(), steps in proptest::collection::vec(step(), 0..100),
    ) {
        let mut session = Session::new(terms, Nanos::ZERO);
        let (mut now, mut heard, mut said, mut whole) = (0, 0, Vec::new(), 0);
        for step in steps {
            match step {
                Step::Time(span) => now += span,
                Step::Hear(bytes) => heard += session.hear(now, &bytes).len(),
                Step::Speak(image, room) => {
                    let (bytes, count) = session.speak(now, image, room);
                    said.extend(bytes);
                    whole += count;
                }
            }
            if session.check(Nanos(now)).is_err() {
                break;
            }
        }
        let (bytes, _) = session.speak(now, 0, usize::MAX);
        said.extend(bytes);
        if terms.sends == 0 {
            prop_assert!(said.is_empty());
            return Ok(());
        }
        prop_assert_eq!(said.len() % terms.sends, 0);
        prop_assert!(said.len() / terms.sends >= whole);
        for record in said.chunks(terms.sends) {
            prop_assert!(record.iter().all(|byte| *byte == record[0]), "two images in one record");
        }
        if terms.sending == Sending::Reply {
            prop_assert_eq!(said.len() / terms.sends, heard);
        }
        session.check(Nanos(now)).ok();
        if session.check(Nanos(now)).is_ok() {
            prop_assert!(session.deadline() > Nanos(now));
        }
    }
}

#[test]
fn a_change_that_is_withdrawn_is_sent_when_the_line_is_back() {
    let mut session = session(Sending::OnChange);
    assert_eq!(session.speak(0, 1, usize::MAX).1, 1);
    session.due(Nanos(10)).expect("a look is due").fill(2);
    // Held back while the line goes down; a sign of life is due meanwhile.
    assert!(session.made(Nanos(10), |_, _| true));
    assert!(session.withdraw(), "nothing of it was written");
    let (record, _) = session.speak(20, 2, usize::MAX);
    assert_eq!(record, [2, 2], "the change still has to be sent");
}
