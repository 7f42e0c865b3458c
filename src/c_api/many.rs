//! Ticks of many drivers in one call.

use tickbus_binding::{Device, MAX_DRIVERS, Refusal};
use tickbus_driver::Code;

use super::{DRIVERS, LAST_TICK, Opened, answer};
use crate::page::Place;

/// # Safety
///
/// `drivers` and `statuses` must have `count` elements, and `times` as many or be null.
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_exchange_many(
    drivers: *const i64,
    count: usize,
    times: *const i64,
    statuses: *mut i32,
) -> i32 {
    // SAFETY: promised by the caller.
    unsafe { tick_many(drivers, count, times, statuses, Device::exchange) }
}

/// # Safety
///
/// As [`tb_exchange_many`].
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_receive_many(
    drivers: *const i64,
    count: usize,
    times: *const i64,
    statuses: *mut i32,
) -> i32 {
    // SAFETY: promised by the caller.
    unsafe { tick_many(drivers, count, times, statuses, Device::receive) }
}

/// # Safety
///
/// As [`tb_exchange_many`].
#[unsafe(no_mangle)]
unsafe extern "C" fn tb_send_many(drivers: *const i64, count: usize, statuses: *mut i32) -> i32 {
    // SAFETY: promised by the caller.
    unsafe { tick_many(drivers, count, std::ptr::null(), statuses, Device::send) }
}

/// Ticks each driver, and returns how many have failed.
///
/// # Safety
///
/// As [`tb_exchange_many`].
unsafe fn tick_many(
    drivers: *const i64,
    count: usize,
    times: *const i64,
    statuses: *mut i32,
    tick: impl Fn(&mut Device<Option<Place>>) -> Code,
) -> i32 {
    let wrong = match (drivers.is_null(), statuses.is_null()) {
        _ if count == 0 => return 0,
        _ if count > MAX_DRIVERS => format!("count is {count}; expected at most {MAX_DRIVERS}"),
        (true, _) => "drivers is NULL".to_owned(),
        (_, true) => "statuses is NULL; expected a place for the status of each driver".to_owned(),
        (false, false) => {
            // SAFETY: promised by the caller. The lists are read and written through pointers, since nothing forbids that
            // they overlap.
            let handles = (0..count).map(|at| unsafe { drivers.add(at).read() });
            // SAFETY: as above.
            let time = |at| (!times.is_null()).then(|| unsafe { times.add(at).read() });
            let mut failed = 0;
            let work = |at, opened: &mut Opened| {
                if let Some(time) = time(at) {
                    opened.device.set_time(time);
                }
                tick(&mut opened.device)
            };
            DRIVERS.tick_each(handles, work, |at, code| {
                // SAFETY: as above.
                unsafe { statuses.add(at).write(code.code()) };
                if code.code() < 0 {
                    failed += 1;
                    // SAFETY: as above.
                    LAST_TICK.set(Some((unsafe { drivers.add(at).read() }, code)));
                }
            });
            return failed;
        }
    };
    answer(|| Err(Refusal::new(Code::BadArgument, wrong)))
}
