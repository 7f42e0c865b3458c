//! The native methods of the Java class `tickbus.SweepSession`: a sweep of faults whose machine is in Java.

#![allow(unsafe_code, reason = "exported names")]

use std::path::{Path, PathBuf};

use jni::EnvUnowned;
use jni::objects::{JClass, JString};
use jni::sys::{jboolean, jint, jlong};

use tickbus_base::time::Nanos;
use tickbus_binding::{Handles, Refusal};
use tickbus_driver::Code;
use tickbus_testing::Session;

use super::failure::{Failure, ThrowFieldbusException};
use super::with;

/// How all verdicts are accepted under `JUnit`.
const ACCEPT: &str = "-Dtickbus.accept=true";

/// The sweeps of this process.
static SWEEPS: Handles<Box<Session>> = Handles::new();

fn visit<R>(sweep: jlong, work: impl FnOnce(&mut Session) -> R) -> Result<R, Failure> {
    Ok(SWEEPS.visit(sweep, |session| work(session))?)
}

fn refused(why: impl std::fmt::Display) -> Failure {
    Failure::coded(Code::BadArgument, why)
}

/// `static native long openNative(long driver, String name, String folder, String keys, long stepNanos)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_openNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    driver: jlong,
    name: JString<'local>,
    folder: JString<'local>,
    keys: JString<'local>,
    step: jlong,
) -> jlong {
    env.with_env(|env| {
        let place = SWEEPS.reserve()?;
        let [name, folder, keys] = [&name, &folder, &keys].map(|text| text.try_to_string(env));
        let (name, folder, keys) = (name?, folder?, keys?);
        let config = with(driver, |device| device.config())?;
        let folder = Path::new(&folder);
        let session = Session::read((&name, &keys), ACCEPT, folder, config, Nanos(step));
        let session = session
            .map_err(|mistakes| refused(format!("the sweep cannot be read:\n{mistakes}")))?;
        Ok::<_, Failure>(place.fill(&name, Box::new(session)))
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native void closeNative(long sweep)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_closeNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
) {
    env.with_env(|_| Ok::<(), Failure>(SWEEPS.close(sweep, drop).map_err(Refusal::plain)?))
        .resolve::<ThrowFieldbusException>();
}

/// `static native void beginNative(long sweep, long driver, int cell)`; a cell below 0 is the run without a fault.
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_beginNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    driver: jlong,
    cell: jint,
) {
    env.with_env(|_| {
        let begin = |session: &mut Session| {
            let cell = usize::try_from(cell).ok();
            with(driver, |device| {
                device.between_ticks(|_, slots| session.begin(cell, slots))
            })
        };
        visit(sweep, begin)??.map_err(refused)
    })
    .resolve::<ThrowFieldbusException>();
}

/// `static native void beforeNative(long sweep, long driver)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_beforeNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    driver: jlong,
) {
    env.with_env(|_| {
        let before = |session: &mut Session| {
            with(driver, |device| {
                device.between_ticks(|driver, slots| session.before(driver, slots))
            })
        };
        visit(sweep, before)??.map_err(refused)
    })
    .resolve::<ThrowFieldbusException>();
}

/// `static native boolean afterNative(long sweep, long driver)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_afterNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    driver: jlong,
) -> jboolean {
    env.with_env(|_| {
        let after = |session: &mut Session| {
            with(driver, |device| {
                device.between_ticks(|_, slots| session.after(slots))
            })
        };
        visit(sweep, after)?
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native boolean idleNative(long sweep, long driver)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_idleNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    driver: jlong,
) -> jboolean {
    env.with_env(|_| {
        let idle = |session: &mut Session| {
            with(driver, |device| {
                device.between_ticks(|_, slots| session.idle(slots))
            })
        };
        visit(sweep, idle)?
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native String planNative(long sweep, boolean rewriting)`: the names of the runs, one per line.
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_planNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    rewriting: jboolean,
) -> JString<'local> {
    env.with_env(|env| {
        let cells = visit(sweep, |session| session.plan(rewriting))?.map_err(refused)?;
        let names: Vec<&str> = cells.iter().map(|cell| cell.name.as_str()).collect();
        Ok::<_, Failure>(env.new_string(names.join("\n"))?)
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native String resultNative(long sweep, int cell)`: whether it passes, its word, and the verdict, on one line
/// each; empty if the run is not over.
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_resultNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    cell: jint,
) -> JString<'local> {
    env.with_env(|env| {
        let cell = usize::try_from(cell).unwrap_or(usize::MAX);
        let run = visit(sweep, |session| session.result(cell))?;
        let text = run.map(|run| format!("{}\n{}\n{}", run.passes, run.word, run.what));
        Ok::<_, Failure>(env.new_string(text.unwrap_or_default())?)
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native String summaryNative(long sweep)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_summaryNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
) -> JString<'local> {
    env.with_env(|env| {
        let summary = visit(sweep, |session| session.summary())?;
        Ok::<_, Failure>(env.new_string(summary)?)
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native String acceptNative(long sweep)`
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_acceptNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
) -> JString<'local> {
    env.with_env(|env| {
        let file = visit(sweep, Session::accept)?.map_err(refused)?;
        Ok::<_, Failure>(env.new_string(file.to_string_lossy())?)
    })
    .resolve::<ThrowFieldbusException>()
}

/// `static native void pageNative(long sweep, String page, String again, String reports)`: the report of each run on a line,
/// or an empty line.
#[unsafe(no_mangle)]
extern "system" fn Java_tickbus_SweepSession_pageNative<'local>(
    mut env: EnvUnowned<'local>,
    _class: JClass<'local>,
    sweep: jlong,
    page: JString<'local>,
    again: JString<'local>,
    reports: JString<'local>,
) {
    env.with_env(|env| {
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
    })
    .resolve::<ThrowFieldbusException>();
}
