//! The handles, from one thread and from several.

use super::*;
use std::sync::Barrier;
use std::sync::atomic::AtomicUsize;

fn open<const N: usize>(handles: &Handles<u32, N>, tenant: u32) -> i64 {
    handles.reserve().expect("a place is free").fill(tenant)
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
            handles.with(handle, |_| ()),
            Err(Code::NotOpen),
            "{handle:#x}"
        );
        assert_eq!(
            handles.close(handle, |_| ()),
            Err(Code::NotOpen),
            "{handle:#x}"
        );
    }
    assert_eq!(handles.with(real, |tenant| *tenant), Ok(7));
}

#[test]
fn a_stale_handle_stays_closed_though_its_place_has_a_new_tenant() {
    let handles: Handles<u32, 1> = Handles::new();
    let old = open(&handles, 1);
    assert_eq!(handles.close(old, |tenant| tenant), Ok(1));
    assert_eq!(handles.with(old, |_| ()), Err(Code::Closed));
    let new = open(&handles, 2);
    assert_eq!(handles.with(old, |_| ()), Err(Code::Closed));
    assert_eq!(handles.close(old, |_| ()), Err(Code::Closed));
    assert_eq!(handles.with(new, |tenant| *tenant), Ok(2));
}

#[test]
fn places_run_out_and_come_back() {
    let handles: Handles<u32, 2> = Handles::new();
    let first = open(&handles, 1);
    open(&handles, 2);
    let refusal = handles.reserve().err().expect("both places are taken");
    assert_eq!(refusal.code, Code::TooManyDrivers);
    handles.close(first, drop).expect("it is open");
    drop(handles.reserve().expect("the place is free again"));
    open(&handles, 3);
}

#[test]
fn a_tenant_in_use_is_busy_and_stays_open() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 1);
    let answers = handles.with(handle, |_| {
        (handles.with(handle, |_| ()), handles.close(handle, |_| ()))
    });
    assert_eq!(answers, Ok((Err(Code::Busy), Err(Code::Busy))));
    assert_eq!(handles.with(handle, |tenant| *tenant), Ok(1));
}

#[test]
fn a_panic_fails_the_tenant_until_it_is_closed() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 1);
    let text = "formatted at run time".to_owned();
    assert_eq!(
        handles.with(handle, |_| panic!("{text}")),
        Err::<(), _>(Code::Internal)
    );
    assert_eq!(handles.with(handle, |_| ()), Err(Code::Internal));
    assert_eq!(handles.panic_of(handle), Some(text));
    assert_eq!(handles.close(handle, |tenant| tenant), Ok(1));
    assert_eq!(handles.with(handle, |_| ()), Err(Code::Closed));
    assert_eq!(handles.panic_of(handle), None);
}

#[test]
fn a_tenant_that_takes_its_time_to_close_keeps_nobody_waiting() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 1);
    let met = handles.close(handle, |_| {
        let next = open(&handles, 2);
        (
            handles.with(handle, |_| ()),
            handles.with(next, |tenant| *tenant),
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
    assert_eq!(handles.with(handle, |_| ()), Err(Code::Closed));
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
            let entered = handles.with(handle, |tenant| {
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
    assert_eq!(handles.with(handle, |tenant| *tenant), Ok(done));
}

#[test]
fn the_thread_that_ticks_meets_nobody_else_in_there() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 0);
    let (inside, is_over) = (AtomicUsize::new(0), AtomicBool::new(false));
    let rounds = if cfg!(miri) { 200 } else { 300_000 };
    let enter = |tenant: &mut u32| {
        assert_eq!(inside.fetch_add(1, Ordering::Relaxed), 0);
        *tenant += 1;
        assert_eq!(inside.fetch_sub(1, Ordering::Relaxed), 1);
    };
    let done: u32 = std::thread::scope(|scope| {
        let other = scope.spawn(|| {
            let mut done = 0;
            while !is_over.load(Ordering::Relaxed) {
                match handles.with(handle, enter) {
                    Ok(()) => done += 1,
                    Err(refusal) => assert_eq!(refusal, Code::Busy),
                }
            }
            done
        });
        let mut done = 0;
        for _ in 0..rounds {
            match handles.tick(handle, 7, enter) {
                Ok(()) => done += 1,
                Err(refusal) => assert_eq!(refusal, Code::Busy),
            }
        }
        is_over.store(true, Ordering::Relaxed);
        done + other.join().expect("no panic")
    });
    assert_eq!(handles.with(handle, |tenant| *tenant), Ok(done));
}

#[test]
fn several_threads_that_tick_take_turns() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 0);
    let (inside, start) = (AtomicUsize::new(0), Barrier::new(3));
    let rounds = if cfg!(miri) { 100 } else { 50_000 };
    let work = |thread: usize| {
        let (handles, inside, start) = (&handles, &inside, &start);
        move || {
            start.wait();
            let mut done = 0;
            for _ in 0..rounds {
                let entered = handles.tick(handle, thread, |tenant| {
                    assert_eq!(inside.fetch_add(1, Ordering::Relaxed), 0);
                    *tenant += 1;
                    assert_eq!(inside.fetch_sub(1, Ordering::Relaxed), 1);
                });
                done += u32::from(entered.is_ok());
            }
            done
        }
    };
    let done: u32 = std::thread::scope(|scope| {
        let threads = [1, 2, 3].map(|thread| scope.spawn(work(thread)));
        threads
            .into_iter()
            .map(|it| it.join().expect("no panic"))
            .sum()
    });
    assert_eq!(handles.with(handle, |tenant| *tenant), Ok(done));
}

#[test]
fn a_tick_within_a_tick_is_refused() {
    let handles: Handles<u32, 1> = Handles::new();
    let handle = open(&handles, 1);
    for _ in 0..2 {
        let answers = handles.tick(handle, 7, |_| {
            (
                handles.tick(handle, 7, |_| ()),
                handles.with(handle, |_| ()),
                handles.close(handle, |_| ()),
            )
        });
        let busy = Err(Code::Busy);
        assert_eq!(answers, Ok((busy, busy, busy)));
    }
    assert_eq!(handles.tick(handle, 7, |tenant| *tenant), Ok(1));
}

#[test]
fn a_tick_that_panics_fails_the_tenant_until_it_is_closed() {
    for thread_of_the_panic in [7, 8] {
        let handles: Handles<u32, 1> = Handles::new();
        let handle = open(&handles, 1);
        assert_eq!(handles.tick(handle, 7, |tenant| *tenant), Ok(1));
        let panicked = handles.tick(handle, thread_of_the_panic, |_| panic!("stuck"));
        assert_eq!(panicked, Err::<(), _>(Code::Internal));
        assert_eq!(handles.tick(handle, 7, |_| ()), Err(Code::Internal));
        assert_eq!(handles.with(handle, |_| ()), Err(Code::Internal));
        assert_eq!(handles.panic_of(handle).as_deref(), Some("stuck"));
        assert_eq!(handles.close(handle, |tenant| tenant), Ok(1));
        assert_eq!(handles.tick(handle, 7, |_| ()), Err(Code::Closed));
        let next = open(&handles, 2);
        assert_eq!(handles.tick(handle, 7, |_| ()), Err(Code::Closed));
        assert_eq!(handles.tick(next, 7, |tenant| *tenant), Ok(2));
    }
}
