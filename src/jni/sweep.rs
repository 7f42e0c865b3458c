//! The native methods of the Java class `tickbus.SweepSession`: a sweep of faults whose machine is in Java.

#![allow(unsafe_code, reason = "exported names")]

use std::path::{Path, PathBuf};

use jni::objects::{JClass, JString};
use jni::sys::{jboolean, jint, jlong};
use jni::{Env, EnvUnowned};

use tickbus_base::time::Nanos;
use tickbus_binding::{Handles, Refusal};
use tickbus_driver::{Code, Driver};
use tickbus_image::signal::Slot;
use tickbus_testing::Session;

use super::failure::{Failure, answer};
use super::with;

/// How all verdicts are accepted under `JUnit`.
const ACCEPT: &str = "-Dtickbus.accept=true";

/// The sweeps of this process.
static SWEEPS: Handles<Box<Session>> = Handles::new();

fn visit<R>(sweep: jlong, work: impl FnOnce(&mut Session) -> R) -> Result<R, Failure> {
    Ok(SWEEPS.visit(sweep, |session| work(session))?)
}

/// Calls `work` with the sweep, the driver of its run, and the driver's slots.
fn visit_run<R>(
    sweep: jlong,
    driver: jlong,
    work: impl FnOnce(&mut Session, &mut Driver, &mut [Slot]) -> R,
) -> Result<R, Failure> {
    visit(sweep, |session| {
        with(driver, |device| {
            device.between_ticks(|driver, slots| work(session, driver, slots))
        })
    })?
}

/// The text of a native method's result.
fn text<'local>(env: &mut Env<'local>, text: impl AsRef<str>) -> Result<JString<'local>, Failure> {
    Ok(env.new_string(text.as_ref())?)
}

fn refused(why: impl std::fmt::Display) -> Failure {
    Failure::coded(Code::BadArgument, why)
}

/// `static native long openNative(long driver, String name, String folder, String keys, long stepNanos)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_openNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    driver: jlong,
    name: JString<'local>,
    folder: JString<'local>,
    keys: JString<'local>,
    step: jlong,
) -> jlong {
    answer(env, |env| {
        let place = SWEEPS.reserve()?;
        let [name, folder, keys] = [&name, &folder, &keys].map(|text| text.try_to_string(env));
        let (name, folder, keys) = (name?, folder?, keys?);
        let folder = Path::new(&folder);
        let session = with(driver, |device| {
            device.between_ticks(|driver, _| {
                Session::read((&name, &keys), ACCEPT, folder, driver, Nanos(step))
            })
        })?;
        let session = session
            .map_err(|mistakes| refused(format!("the sweep cannot be read:\n{mistakes}")))?;
        Ok(place.fill(&name, Box::new(session)))
    })
}

/// `static native void closeNative(long sweep)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_closeNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
) {
    answer(env, |_| {
        Ok(SWEEPS.close(sweep, drop).map_err(Refusal::plain)?)
    });
}

/// `static native void beginNative(long sweep, long driver, int cell)`; a cell below 0 is the run without a fault.
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_beginNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    driver: jlong,
    cell: jint,
) {
    let cell = usize::try_from(cell).ok();
    answer(env, |_| {
        let begun = visit_run(sweep, driver, |session, _, slots| {
            session.begin(cell, slots)
        });
        begun?.map_err(refused)
    });
}

/// `static native void beforeNative(long sweep, long driver)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_beforeNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    driver: jlong,
) {
    answer(env, |_| {
        visit_run(sweep, driver, Session::before)?.map_err(refused)
    });
}

/// `static native boolean afterNative(long sweep, long driver)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_afterNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    driver: jlong,
) -> jboolean {
    answer(env, |_| {
        visit_run(sweep, driver, |session, _, slots| session.after(slots))
    })
}

/// `static native boolean idleNative(long sweep, long driver)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_idleNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    driver: jlong,
) -> jboolean {
    answer(env, |_| {
        visit_run(sweep, driver, |session, _, slots| session.idle(slots))
    })
}

/// `static native String planNative(long sweep, boolean rewriting)`: the names of the runs, one per line.
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_planNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    rewriting: jboolean,
) -> JString<'local> {
    answer(env, |env| {
        let plan = visit(sweep, |session| session.plan(rewriting))?.map_err(refused)?;
        let names: Vec<&str> = plan.cells.iter().map(|cell| cell.name.as_str()).collect();
        text(env, names.join("\n"))
    })
}

/// `static native String resultNative(long sweep, int cell)`: whether it passes, its word, and the verdict, on one line
/// each; empty if the run is not over.
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_resultNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    cell: jint,
) -> JString<'local> {
    answer(env, |env| {
        let cell = usize::try_from(cell).unwrap_or(usize::MAX);
        let run = visit(sweep, |session| session.result(cell))?;
        let lines = run.map(|run| format!("{}\n{}\n{}", run.passes, run.word, run.what));
        text(env, lines.unwrap_or_default())
    })
}

/// `static native String summaryNative(long sweep)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_summaryNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
) -> JString<'local> {
    answer(env, |env| {
        let summary = visit(sweep, |session| session.summary())?;
        text(env, summary)
    })
}

/// `static native String acceptNative(long sweep)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_acceptNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
) -> JString<'local> {
    answer(env, |env| {
        let file = visit(sweep, Session::accept)?.map_err(refused)?;
        text(env, file.to_string_lossy())
    })
}

/// `static native void pageNative(long sweep, String page, String again, String reports)`: the report of each run on a line,
/// or an empty line.
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_pageNative<'local>(
    env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    page: JString<'local>,
    again: JString<'local>,
    reports: JString<'local>,
) {
    answer(env, |env| {
        let [page, again, reports] = [&page, &again, &reports].map(|text| text.try_to_string(env));
        let (page, again, reports) = (page?, again?, reports?);
        let reports: Vec<&str> = reports.split('\n').collect();
        let report = |run: usize| {
            let report = reports.get(run).filter(|report| !report.is_empty());
            report.map(PathBuf::from)
        };
        visit(sweep, |session| {
            session.page(Path::new(&page), &again, report)
        })?
        .map_err(refused)
    });
}
