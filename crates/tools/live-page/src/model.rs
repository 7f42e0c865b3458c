//! All drivers on the page, and the updates for viewers.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use tickbus_base::time::Nanos;
use tickbus_web::{Differences, Refused};

use crate::exhibit::Exhibit;
use crate::order::Order;

/// The drivers and runs, and the number of their current state.
#[derive(Debug, Default)]
pub(crate) struct Model {
    /// Another number for each page that is opened: by it and by the layout, a viewer who connects again knows that the
    /// drivers are still the same.
    run: u128,
    number: u64,
    /// The number of joins and leaves, and the number of the state of the last one.
    layout: u64,
    layout_number: u64,
    /// The time of the last update.
    now: Nanos,
    /// By their ids.
    drivers: BTreeMap<i32, Box<dyn Exhibit>>,
    has: Arc<Has>,
}

/// The views that are not empty, for the tabs: those who read them do not wait for the model.
#[derive(Debug, Default)]
pub(crate) struct Has {
    pub(crate) picture: AtomicBool,
    pub(crate) past: AtomicBool,
}

impl Model {
    /// Adds the exhibit that `make` builds with an id, which is `asked` unless that is in use; returns the id.
    pub(crate) fn join(&mut self, asked: i32, make: impl FnOnce(i32) -> Box<dyn Exhibit>) -> i32 {
        let mut id = asked;
        while self.drivers.contains_key(&id) {
            id = id.checked_add(1).unwrap_or(1);
        }
        self.drivers.insert(id, make(id));
        self.has_new_layout();
        id
    }

    /// Removes a driver; returns true if it was the last one.
    pub(crate) fn leave(&mut self, id: i32) -> bool {
        self.drivers.remove(&id);
        self.has_new_layout();
        self.drivers.is_empty()
    }

    fn has_new_layout(&mut self) {
        self.number += 1;
        self.layout += 1;
        self.layout_number = self.number;
        for driver in self.drivers.values_mut() {
            driver.sheet_mut().forget_line();
        }
        let has_picture = self.drivers().any(|driver| driver.picture().is_some());
        self.has.picture.store(has_picture, Relaxed);
        let has_past = self.drivers().any(|driver| driver.archive().is_some());
        self.has.past.store(has_past, Relaxed);
    }

    pub(crate) fn has(&self) -> Arc<Has> {
        Arc::clone(&self.has)
    }

    pub(crate) fn drivers(&self) -> impl Iterator<Item = &dyn Exhibit> {
        self.drivers.values().map(|driver| &**driver)
    }

    pub(crate) fn drivers_mut(&mut self) -> impl Iterator<Item = &mut Box<dyn Exhibit>> {
        self.drivers.values_mut()
    }

    pub(crate) fn driver(&self, id: i32) -> Option<&dyn Exhibit> {
        self.drivers.get(&id).map(|driver| &**driver)
    }

    /// Takes over the copies of `now`.
    pub(crate) fn update(&mut self, now: Nanos, with_line: bool) {
        self.now = now;
        let number = self.number + 1;
        let mut is_new = false;
        for driver in self.drivers.values_mut() {
            is_new |= driver.update(now, number, with_line);
        }
        if is_new {
            self.number = number;
        }
        if self.drivers().any(Exhibit::is_other) {
            self.has_new_layout();
        }
    }

    /// Carries out an order.
    pub(crate) fn obey(&mut self, order: &Order) -> Result<(), Refused> {
        match order {
            Order::ReleaseAll => {
                let released = self.drivers.values_mut().map(|driver| driver.release_all());
                // Release all, even if one fails.
                let released: Vec<_> = released.collect();
                released.into_iter().collect()
            }
            Order::Force { driver, values } => self.named(*driver)?.force(values),
            Order::Fault {
                driver,
                name,
                value,
            } => self.named(*driver)?.fault(name, value.as_deref()),
            Order::Release { driver, signals } => self.named(*driver)?.release(signals),
        }
    }

    fn named(&mut self, id: i32) -> Result<&mut Box<dyn Exhibit>, Refused> {
        let ids: Vec<String> = self.drivers.keys().map(i32::to_string).collect();
        self.drivers.get_mut(&id).ok_or_else(|| Refused {
            status: 404,
            text: format!("there is no driver {id} here; ids are {}", ids.join(", ")),
        })
    }

    /// `GET /signals`.
    pub(crate) fn signals(&self) -> String {
        let drivers: Vec<String> = self.drivers().map(Exhibit::json).collect();
        let (layout, drivers) = (self.layout, drivers.join(","));
        format!("{{\"layout\":{layout},\"drivers\":[{drivers}]}}")
    }

    /// `GET /line`.
    pub(crate) fn line(&self) -> String {
        let drivers: Vec<&str> = self.drivers().map(|driver| driver.sheet().line()).collect();
        format!("{{\"drivers\":[{}]}}", drivers.join(","))
    }

    /// How far the histories reach: the first and the last time in milliseconds, the last tick, and whether older ticks
    /// were dropped.
    fn write_past(&self, json: &mut String) {
        let drivers = self.drivers();
        let reaches = drivers.filter_map(|driver| {
            let reach = driver.archive()?.reach()?;
            Some(format!("\"{}\":{reach}", driver.id()))
        });
        let reaches: Vec<String> = reaches.collect();
        // Writing to a String cannot fail.
        let _ = write!(json, ",\"past\":{{{}}}", reaches.join(","));
    }

    fn since(&self, seen: Option<u64>) -> String {
        let (layout, time) = (self.layout, self.now.0 / 1_000_000);
        let seen = seen.filter(|seen| *seen >= self.layout_number);
        let Some(seen) = seen else {
            let (signals, line) = (self.signals(), self.line());
            let run = self.run;
            let mut json =
                format!("{{\"run\":{run},\"layout\":{layout},\"full\":true,\"time_ms\":{time}");
            self.write_past(&mut json);
            let _ = write!(json, ",\"signals\":{signals},\"line\":{line}}}");
            return json;
        };
        let mut json = format!("{{\"layout\":{layout},\"time_ms\":{time},\"values\":{{");
        let mut comma = "";
        for driver in self.drivers() {
            if let Some(changes) = driver.sheet().changes(driver.signals(), seen) {
                // Writing to a String cannot fail.
                let _ = write!(json, "{comma}\"{}\":{changes}", driver.id());
                comma = ",";
            }
        }
        json.push('}');
        self.write_past(&mut json);
        if self
            .drivers()
            .any(|driver| driver.sheet().has_new_line(seen))
        {
            let _ = write!(json, ",\"line\":{}", self.line());
        }
        json.push('}');
        json
    }
}

/// The model, for the room and the page's own thread.
#[derive(Debug)]
pub(crate) struct Shared(Mutex<Model>);

impl Shared {
    /// The model of a page without drivers, which is opened at this time of day.
    pub(crate) fn opened(day: Duration) -> Self {
        Self(Mutex::new(Model {
            run: day.as_millis(),
            ..Model::default()
        }))
    }

    /// Works on the model.
    pub(crate) fn with<R>(&self, work: impl FnOnce(&mut Model) -> R) -> R {
        // After a panic the next look updates every driver anyway.
        let mut model = self
            .0
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        work(&mut model)
    }
}

impl Differences for Shared {
    fn number(&self) -> u64 {
        self.with(|model| model.number)
    }

    fn since(&self, seen: Option<u64>) -> (u64, String) {
        self.with(|model| (model.number, model.since(seen)))
    }
}
