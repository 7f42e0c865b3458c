use super::*;

const MAX_AGE: Nanos = Nanos::from_millis(100);

fn at(millis: i64) -> Nanos {
    Nanos::from_millis(millis)
}

#[test]
fn names_and_codes_are_told_apart() {
    for (code, state) in LinkState::ALL.iter().enumerate() {
        assert_eq!(*state as usize, code);
    }
    for (code, cause) in Cause::ALL.iter().enumerate() {
        assert_eq!(*cause as usize, code);
    }
}

#[test]
fn a_running_line_becomes_stale_and_running_again_by_age_alone() {
    let status = LinkStatus::new("test", MAX_AGE);
    status.running(at(1000), "the peer is there");
    // The data are from an earlier peer, or missing: the new peer has time to send its first data.
    status.observe(at(1100), std::iter::once(Nanos::MAX));
    assert_eq!(status.state(), LinkState::Running);
    status.observe(at(1101), std::iter::once(Nanos::MAX));
    let link = status.link();
    assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Silent));
    assert_eq!(
        link.reason,
        "nothing has come from the peer for 101ms; the limit is max_age = 100ms"
    );
    status.running(at(1102), "the peer is there");
    assert_eq!(
        status.state(),
        LinkState::Stale,
        "being there is not enough"
    );
    status.observe(at(1103), std::iter::once(at(3)));
    let link = status.link();
    assert_eq!(link.state, LinkState::Running);
    assert_eq!(link.reason, "the peer is there");
}

#[test]
fn a_look_that_another_thread_overtook_changes_nothing() {
    let status = LinkStatus::new("test", MAX_AGE);
    status.running(at(0), "the peer is there");
    status.observe(at(1005), std::iter::once(at(101)));
    assert_eq!(status.state(), LinkState::Stale);
    // It read the clock before the other thread did.
    status.observe(at(1004), std::iter::once(at(100)));
    assert_eq!(status.state(), LinkState::Stale);
    status.observe(at(1010), std::iter::once(at(1)));
    assert_eq!(status.state(), LinkState::Running);
    // Data arrive between its two looks.
    let looks = std::cell::Cell::new(0);
    let ages = std::iter::once_with(|| at([101, 1][looks.replace(1)]));
    status.observe(at(2000), ages);
    assert_eq!((status.state(), looks.get()), (LinkState::Running, 1));
}

#[test]
fn a_silent_station_among_several_is_told_by_its_name() {
    let names = ["lift", "press", "saw"].map(str::to_owned);
    let status = LinkStatus::of_stations("test", MAX_AGE, names.into());
    status.running(at(0), "all are there");
    let observe = |now, ages: [Nanos; 3]| {
        status.observe(at(now), ages.into_iter());
        let link = status.link();
        (link.state, link.reason)
    };
    let (state, reason) = observe(1000, [at(5), at(101), at(100)]);
    assert_eq!(state, LinkState::Stale);
    let limit = "the limit is max_age = 100ms";
    let said = format!("nothing has come from station \"press\" for 101ms; {limit}");
    assert_eq!(reason, said);
    let (_, reason) = observe(1100, [at(5), at(201), Nanos::MAX]);
    let said = format!(
        "nothing has come from station \"press\" for 201ms, station \"saw\" at all; {limit}"
    );
    assert_eq!(reason, said);
    let (_, reason) = observe(1200, [at(5), at(3), Nanos::MAX]);
    assert!(reason.contains("from station \"saw\" at all; "), "{reason}");
    assert_eq!(observe(1300, [at(5), at(3), at(1)]).0, LinkState::Running);
}

#[test]
fn a_call_that_does_not_return_is_told() {
    let status = LinkStatus::new("test", MAX_AGE);
    status.running(at(0), "the peer is there");
    status.call_begins(at(10), &"exchange() of libx.so".into(), at(50));
    status.observe_call(at(60));
    assert_eq!(status.state(), LinkState::Running);
    status.observe_call(at(3210));
    let link = status.link();
    assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Hung));
    assert_eq!(
        link.reason,
        "exchange() of libx.so has not returned for 3200ms; it may take 50ms"
    );
    status.call_ends(at(3211));
    let link = status.link();
    assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Silent));
    status.observe(at(3211), std::iter::once(at(1)));
    assert_eq!(status.state(), LinkState::Running);
    assert_eq!(status.link().reason, "the peer is there");
}

#[test]
fn a_line_that_waited_when_a_call_hung_waits_on() {
    let status = LinkStatus::new("test", MAX_AGE);
    let (state, cause) = (LinkState::Opening, Cause::Waiting);
    status.enter(at(0), state, cause, "waiting for the peer");
    status.call_begins(at(10), &"exchange() of libx.so".into(), at(50));
    status.observe_call(at(100));
    status.observe_call(at(200));
    assert_eq!(status.link().cause, Cause::Hung);
    status.call_ends(at(210));
    let link = status.link();
    assert_eq!((link.state, link.cause), (state, cause));
    assert_eq!(link.reason, "waiting for the peer");
    status.running(at(211), "the peer is there");
    assert_eq!(status.link().reason, "the peer is there");
}

#[test]
fn statistics_have_one_line_per_key_whatever_the_reason_says() {
    let status = LinkStatus::new("test", MAX_AGE);
    let (state, cause) = (LinkState::Failed, Cause::Defect);
    status.enter(
        at(5),
        state,
        cause,
        "assertion failed\n  left: 1\n right: 2",
    );
    status.tell("address", "127.0.0.1:5");
    status.count("socket.turned_away");
    let mut statistics = tickbus_base::statistics::Statistics::default();
    status.write(at(1005), &mut statistics);
    let text = statistics.to_string();
    assert!(
        text.starts_with(
            "state=failed\nstate.code=4\ncause=defect\ncause.code=8\n\
             reason=assertion failed left: 1 right: 2\nstate.for_s=1.000\nmax_age=100ms\naddress=127.0.0.1:5\n"
        ),
        "{text}"
    );
    assert!(text.contains("\nlink.failed=1\ncause.defect=1\nsocket.turned_away=1\n"));
    assert!(text.lines().all(|line| line.contains('=')), "{text}");
}
