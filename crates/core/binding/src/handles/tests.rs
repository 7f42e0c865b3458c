use super::*;
use std::sync::Barrier;
use std::sync::atomic::AtomicUsize;

fn open<const N: usize>(handles: &Handles<u32, N>, tenant: u32) -> i64 {
    handles
        .reserve()
        .expect("a place is free")
        .fill(&format!("number {tenant}"), tenant)
}

#[test]
fn what_was_never_opened_is_not_open() {
    let handles: Handles<u32, 3> = Handles::new();
    let real = open(&handles, 7);
    for handle in [
        0,
        1,
        2,
        3,
        255,
        -1,
        i64::MIN,
        i64::MAX,
        real + 1,
        real + 256,
        real | 1 << 62,
    ] {
        assert_eq!(
            handles.tick(handle, |_| ()),
            Err(Code::NotOpen),
            "{handle:#x}"
        );
        assert_eq!(
            handles.close(handle, |_| ()),
            Err(Code::NotOpen),
            "{handle:#x}"
        );
    }
    assert_eq!(handles.tick(real, |tenant| *tenant), Ok(7));
}

#[test]
fn a_stale_handle_stays_closed_though_its_place_has_a_new_tenant() {
    let handles: Handles<u32, 1> = Handles::new();
    let old = open(&handles, 1);
    assert_eq!(handles.close(old, |tenant| tenant), Ok(1));
    assert_eq!(handles.tick(old, |_| ()), Err(Code::Closed));
    let new = open(&handles, 2);
    assert_eq!(handles.tick(old, |_| ()), Err(Code::Closed));
    assert_eq!(handles.close(old, |_| ()), Err(Code::Closed));
    assert_eq!(handles.tick(new, |tenant| *tenant), Ok(2));
}

#[test]
fn places_run_out_and_come_back() {
    let handles: Handles<u32, 2> = Handles::new();
    let all: Vec<i64> = (0..128).map(|tenant| open(&handles, tenant % 9)).collect();
    let refusal = handles.reserve().err().expect("all places are taken");
    assert_eq!(refusal.code, Code::TooManyDrivers);
    let text = refusal.to_string();
    assert!(text.contains("128 drivers are open"), "{text}");
    assert!(text.contains("\"number 0\", \"number 1\""), "{text}");
    assert!(text.contains("\"number 7\" and others"), "{text}");
    let seen = all
        .iter()
        .map(|&handle| handles.tick(handle, |tenant| *tenant));
    assert!(seen.eq((0..128).map(|tenant| Ok(tenant % 9))));
    handles.close(all[100], drop).expect("it is open");
    drop(handles.reserve().expect("the place is free again"));
    let again = open(&handles, 3);
    assert_eq!(handles.tick(all[100], |_| ()), Err(Code::Closed));
    assert_eq!(handles.tick(again, |tenant| *tenant), Ok(3));
    assert_eq!(handles.tick(all[101], |tenant| *tenant), Ok(101 % 9));
}

#[test]
fn a_tenant_in_use_is_busy_and_stays_open() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 1);
    let answers = handles.tick(handle, |_| {
        let visit = handles.enter(handle, OPEN, Nanos::ZERO).map(drop);
        let close = handles.close_within(Nanos::ZERO, handle, |_| ());
        (handles.tick(handle, |_| ()), visit, close)
    });
    assert_eq!(
        answers,
        Ok((Err(Code::Busy), Err(Code::Busy), Err(Code::Busy)))
    );
    assert_eq!(handles.tick(handle, |tenant| *tenant), Ok(1));
}

#[test]
fn a_panic_fails_the_tenant_until_it_is_closed() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 1);
    let text = "formatted at run time".to_owned();
    assert_eq!(
        handles.tick(handle, |_| panic!("{text}")),
        Err::<(), _>(Code::Internal)
    );
    assert_eq!(handles.tick(handle, |_| ()), Err(Code::Internal));
    assert_eq!(handles.panic_of(handle), Some(text));
    assert_eq!(handles.close(handle, |tenant| tenant), Ok(1));
    assert_eq!(handles.tick(handle, |_| ()), Err(Code::Closed));
    assert_eq!(handles.panic_of(handle), None);
}

#[test]
fn a_tenant_that_takes_its_time_to_close_keeps_nobody_waiting() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 1);
    let met = handles.close(handle, |_| {
        let next = open(&handles, 2);
        (
            handles.tick(handle, |_| ()),
            handles.tick(next, |tenant| *tenant),
        )
    });
    assert_eq!(met, Ok((Err(Code::Closed), Ok(2))));
}

#[test]
fn a_panic_while_closing_frees_the_place() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 1);
    let closing = catch_unwind(AssertUnwindSafe(|| {
        handles.close(handle, |_| panic!("stuck"))
    }));
    assert_eq!(panic_message(closing.expect_err("close panicked")), "stuck");
    assert_eq!(handles.tick(handle, |_| ()), Err(Code::Closed));
    open(&handles, 2);
}

#[test]
fn two_threads_never_have_the_tenant_at_once() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 0);
    let (inside, start) = (AtomicUsize::new(0), Barrier::new(2));
    let rounds = if cfg!(miri) { 200 } else { 100_000 };
    let work = || {
        start.wait();
        let mut done = 0;
        for _ in 0..rounds {
            let entered = handles.tick(handle, |tenant| {
                assert_eq!(inside.fetch_add(1, Ordering::Relaxed), 0);
                *tenant += 1;
                assert_eq!(inside.fetch_sub(1, Ordering::Relaxed), 1);
            });
            match entered {
                Ok(()) => done += 1,
                Err(refusal) => assert_eq!(refusal, Code::Busy),
            }
        }
        done
    };
    let done: u32 = std::thread::scope(|scope| {
        let other = scope.spawn(work);
        work() + other.join().expect("no panic")
    });
    assert_eq!(handles.tick(handle, |tenant| *tenant), Ok(done));
}

/// A thread that never pauses between two ticks.
fn ticks_all_the_time(handles: &Handles<u64, 1>, handle: i64) -> u64 {
    let mut ticks = 0;
    loop {
        match handles.tick(handle, |tenant| *tenant += 1) {
            Ok(()) => ticks += 1,
            Err(Code::Closed) => return ticks,
            Err(other) => panic!("a tick was refused: {other:?}"),
        }
    }
}

#[test]
fn a_visit_and_a_close_get_in_beside_ticks_without_a_pause() {
    let handles: Handles<u64, 1> = Handles::new();
    let handle = handles.reserve().expect("a place is free").fill("x", 0);
    std::thread::scope(|scope| {
        let ticking = scope.spawn(|| ticks_all_the_time(&handles, handle));
        let visits = if cfg!(miri) { 5 } else { 2_000 };
        for _ in 0..visits {
            handles.visit(handle, |_| ()).expect("it is let in");
        }
        let ticked = handles
            .close(handle, |tenant| tenant)
            .expect("it is let in");
        assert_eq!(ticking.join().expect("no panic"), ticked);
    });
}

#[test]
fn the_end_of_a_tick_yields_once_to_a_wish() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 1);
    let wanted = &handles.first[0].wanted;
    wanted.store(true, Ordering::Relaxed);
    // No visit comes: the tick returns, and a visit has to set the flag again.
    assert_eq!(handles.tick(handle, |tenant| *tenant), Ok(1));
    assert!(!wanted.load(Ordering::Relaxed));
}

#[test]
fn a_tick_waits_for_a_visit_and_not_for_a_tick() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 1);
    let inside = Barrier::new(2);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            handles.visit(handle, |tenant| {
                inside.wait();
                *tenant = 2;
            })
        });
        inside.wait();
        assert_eq!(handles.tick(handle, |tenant| *tenant), Ok(2));
    });
    let within = handles.tick(handle, |_| handles.tick(handle, |_| ()));
    assert_eq!(within, Ok(Err(Code::Busy)));
}

#[test]
fn what_is_open_at_the_end_is_closed_failed_or_not() {
    let handles: Handles<u32, 1> = Handles::new();
    let [first, second, third] = [1, 2, 3].map(|tenant| open(&handles, tenant));
    handles.close(first, drop).expect("it is open");
    let panics = handles.tick(second, |_| panic!("stuck"));
    assert_eq!(panics, Err::<(), _>(Code::Internal));
    let mut closed = Vec::new();
    handles.close_all(|tenant| closed.push(tenant));
    assert_eq!(closed, [2, 3]);
    assert_eq!(handles.tick(third, |_| ()), Err(Code::Closed));
}

#[test]
fn a_call_ticks_each_tenant_once_and_a_failure_stops_no_other_one() {
    let handles: Handles<u32, 2> = Handles::new();
    let all: Vec<i64> = (0..6).map(|tenant| open(&handles, tenant)).collect();
    handles.close(all[1], drop).expect("it is open");
    let list = [all[0], all[1], all[2], all[0], 99, all[3], all[4]];
    for round in 1..=2 {
        let mut codes = Vec::new();
        let work = |at: usize, tenant: &mut u32| {
            assert!(*tenant != 3, "stuck");
            assert_eq!(list[at], all[usize::try_from(*tenant % 10).expect("small")]);
            *tenant += 10;
            Code::Fresh
        };
        handles.tick_each(list, work, |at, code| codes.push((at, code)));
        let codes: Vec<Code> = codes.into_iter().map(|(_, code)| code).collect();
        let expected = [
            Code::Fresh,
            Code::Closed,
            Code::Fresh,
            Code::BadArgument,
            Code::NotOpen,
            Code::Internal,
            Code::Fresh,
        ];
        assert_eq!(codes, expected, "round {round}");
        assert_eq!(handles.tick(all[0], |tenant| *tenant), Ok(10 * round));
    }
    assert_eq!(handles.tick(all[5], |tenant| *tenant), Ok(5));
}

#[test]
fn two_calls_at_once_share_the_tenants_and_each_meets_a_busy_one_at_most() {
    let handles: Handles<u64, 2> = Handles::new();
    let all: Vec<i64> = (0..8)
        .map(|_| handles.reserve().expect("a place is free").fill("x", 0))
        .collect();
    let rounds = if cfg!(miri) { 20 } else { 20_000 };
    let work = || {
        let mut done = 0;
        for _ in 0..rounds {
            let tick = |_, tenant: &mut u64| {
                *tenant += 1;
                Code::Fresh
            };
            handles.tick_each(all.iter().copied(), tick, |_, code| match code {
                Code::Fresh => done += 1,
                code => assert_eq!(code, Code::Busy),
            });
        }
        done
    };
    let done: u64 = std::thread::scope(|scope| {
        let other = scope.spawn(work);
        work() + other.join().expect("no panic")
    });
    let counted = all
        .iter()
        .map(|handle| handles.tick(*handle, |tenant| *tenant));
    assert_eq!(counted.sum::<Result<u64, _>>(), Ok(done));
}
