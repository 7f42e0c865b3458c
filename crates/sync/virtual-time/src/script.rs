//! The server's logic as a script in Rhai.
//!
//! The script runs once. It declares the variables that it writes by `variable`, and registers hook functions by
//! `on_start`, `on_time`, `on_change` and `on_read`; these use `get`, `set`, `time`, `step` and `reader`. docs/sdsp.md
//! has an example.
//!
//! A script cannot reach outside: it has no files, no modules, no clock but the virtual one and no random numbers, and
//! a hook that does not finish is aborted. So a script is as deterministic as the rest.

mod frame;

use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rhai::{AST, Dynamic, Engine, EvalAltResult, FnPtr, Position};
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Mistakes, PlacedMistake, load_text};
use tickbus_image::signal::DataType;

use crate::declaration::check_name;
use crate::logic::Access;
use crate::{Logic, Variable};
use frame::Frame;

/// The most operations of one hook: some hundredths of a second.
const MOST_OPERATIONS: u64 = 1_000_000;

/// The most characters, elements or entries of a value.
const LARGEST: usize = 65_536;

/// The deepest nesting of function calls.
const DEEPEST: usize = 32;

type Failed = Box<EvalAltResult>;

/// Everything that a script has registered so far.
#[derive(Default)]
struct Registered {
    variables: Vec<Variable>,
    hooks: Vec<(When, FnPtr)>,
    /// The script has run: from now on only its hooks run.
    is_complete: bool,
}

#[derive(Clone)]
enum When {
    Start,
    Time,
    Change(String),
    Read(String),
}

/// A script that is ready to be called.
struct Script {
    file: String,
    engine: Engine,
    ast: AST,
    frame: Arc<Mutex<Frame>>,
}

/// Reads the script at `path`, and turns it into logic.
///
/// # Errors
///
/// The mistakes, with their positions.
pub fn load(path: &Path) -> Result<Logic<'static>, Mistakes> {
    let text = load_text(path)?;
    parse(&path.display().to_string(), &text)
}

/// Turns the text of a script into logic; messages call it `file`.
///
/// # Errors
///
/// The same as for [`load`].
pub fn parse(file: &str, text: &str) -> Result<Logic<'static>, Mistakes> {
    let registered = Arc::new(Mutex::new(Registered::default()));
    let frame = Arc::new(Mutex::new(Frame::default()));
    let mut engine = Engine::new();
    engine
        .set_max_operations(MOST_OPERATIONS)
        .set_max_call_levels(DEEPEST)
        .set_max_string_size(LARGEST)
        .set_max_array_size(LARGEST)
        .set_max_map_size(LARGEST)
        .disable_symbol("eval")
        .on_print(|text| log::info!("script: {text}"))
        .on_debug(|text, _, place| log::info!("script, {place}: {text}"));
    // Rhai's own `sleep` would stop the run, and the server with it.
    engine.register_fn("sleep", |_: i64| cannot_sleep());
    engine.register_fn("sleep", |_: f64| cannot_sleep());
    offer_registration(&mut engine, &registered);
    offer_access(&mut engine, &frame);
    let wrong = |what: String, place: Position| {
        let place = place
            .line()
            .map(|line| (line, place.position().unwrap_or(1)));
        let mistake = Mistake::new(what, "docs/sdsp.md says what a script may do");
        Mistakes::of_list(file, vec![PlacedMistake { place, mistake }])
    };
    let ast = engine
        .compile(text)
        .map_err(|error| wrong(error.0.to_string(), error.1))?;
    engine
        .run_ast(&ast)
        .map_err(|error| wrong(without_place(&error), innermost(&error)))?;
    let mut registered = locked(&registered);
    registered.is_complete = true;
    let (variables, hooks) = (
        std::mem::take(&mut registered.variables),
        std::mem::take(&mut registered.hooks),
    );
    let script = Arc::new(Script {
        file: file.to_owned(),
        engine,
        ast,
        frame,
    });
    let logic = variables.into_iter().fold(Logic::new(), Logic::variable);
    Ok(hooks.into_iter().fold(logic, |logic, (when, function)| {
        let script = Arc::clone(&script);
        let hook = move |access: &mut Access<'_>| script.call(&function, access);
        match when {
            When::Start => logic.on_start(hook),
            When::Time => logic.on_time(hook),
            When::Change(name) => logic.on_change(name, hook),
            When::Read(name) => logic.on_read(name, hook),
        }
    }))
}

impl Script {
    fn call(&self, function: &FnPtr, access: &mut Access<'_>) -> Result<(), String> {
        locked(&self.frame).enter(access);
        let called = function.call::<Dynamic>(&self.engine, &self.ast, ());
        let left = locked(&self.frame).leave(access);
        called
            .map_err(|error| {
                let place = innermost(&error);
                let line = place.line().map_or_else(String::new, |line| {
                    format!(":{line}:{}", place.position().unwrap_or(1))
                });
                format!("{}{line}: {}", self.file, without_place(&error))
            })
            .and(left)
    }
}

/// Offers the functions that declare variables and hooks.
fn offer_registration(engine: &mut Engine, registered: &Arc<Mutex<Registered>>) {
    let into = Arc::clone(registered);
    engine.register_fn(
        "variable",
        move |name: &str, data_type: &str| -> Result<(), Failed> {
            let data_type: DataType = data_type
                .parse()
                .map_err(|error| format!("\"{data_type}\" is {error}"))?;
            let mut registered = open(&into)?;
            check_name("variable", name).map_err(|mistake| mistake.to_string())?;
            if registered.variables.iter().any(|known| known.name == name) {
                return Err(format!("the variable \"{name}\" is declared twice").into());
            }
            registered.variables.push(Variable::new(name, data_type));
            Ok(())
        },
    );
    for (name, when) in [("on_start", When::Start), ("on_time", When::Time)] {
        let into = Arc::clone(registered);
        engine.register_fn(name, move |function: FnPtr| -> Result<(), Failed> {
            open(&into)?.hooks.push((when.clone(), function));
            Ok(())
        });
    }
    for name in ["on_change", "on_read"] {
        let into = Arc::clone(registered);
        let register = move |of: &str, function: FnPtr| -> Result<(), Failed> {
            let when = match name {
                "on_change" => When::Change(of.to_owned()),
                _ => When::Read(of.to_owned()),
            };
            open(&into)?.hooks.push((when, function));
            Ok(())
        };
        engine.register_fn(name, register);
    }
}

fn cannot_sleep() -> Result<(), Failed> {
    Err("a script cannot sleep; use time() to wait for a virtual time".into())
}

/// The registrations, as long as the script may add to them.
fn open(registered: &Mutex<Registered>) -> Result<MutexGuard<'_, Registered>, Failed> {
    let registered = locked(registered);
    if registered.is_complete {
        return Err(
            "variables and hooks are registered at the top of the script, not in a hook".into(),
        );
    }
    Ok(registered)
}

/// Offers the functions that read and write variables.
fn offer_access(engine: &mut Engine, frame: &Arc<Mutex<Frame>>) {
    let of = Arc::clone(frame);
    engine.register_fn("get", move |name: &str| -> Result<Dynamic, Failed> {
        Ok(locked(&of).get(name)?)
    });
    let of = Arc::clone(frame);
    engine.register_fn(
        "set",
        move |name: &str, value: Dynamic| -> Result<(), Failed> {
            Ok(locked(&of).set(name, &value)?)
        },
    );
    let of = Arc::clone(frame);
    engine.register_fn("time", move || -> Result<i64, Failed> {
        Ok(locked(&of).step()?.time.0)
    });
    let of = Arc::clone(frame);
    engine.register_fn("step", move || -> Result<i64, Failed> {
        Ok(locked(&of).step()?.sequence.cast_signed())
    });
    let of = Arc::clone(frame);
    engine.register_fn("reader", move || -> Result<String, Failed> {
        Ok(locked(&of).reader()?)
    });
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Every single change leaves the data consistent.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The position of the innermost error, which the outer ones only pass on.
fn innermost(error: &EvalAltResult) -> Position {
    match error.unwrap_inner().position() {
        place if place.is_none() => error.position(),
        place => place,
    }
}

fn without_place(error: &EvalAltResult) -> String {
    let mut error = error.unwrap_inner().to_string();
    // The message ends with its position, which is reported in front.
    if let Some(at) = error.rfind(" (line ") {
        error.truncate(at);
    }
    error
}

#[cfg(test)]
mod tests;
