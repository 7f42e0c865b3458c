//! Received values and their quality, on their way into the image.

use opcua::types::{DataValue, DateTime, StatusCode};

use crate::pki::meaning;
use crate::values::{self, scalar};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::{BusError, Port};
use tickbus_image::signal::{Area, RawValues, SignalTable};

use super::Field;

/// The shortest interval between two updates of the newest source time in the statistics.
const TOLD_EVERY: Nanos = Nanos::from_secs(1);

/// The quality of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Quality {
    /// No value yet.
    Missing,
    Good,
    Uncertain,
    Bad(StatusCode),
}

/// The signals that are read, and their quality.
///
/// A station's frame is passed to the image if all its values are present and none is bad. While one is bad, no value
/// of the station is passed on, so that its data grow old, as they should.
#[derive(Debug)]
pub(super) struct Readings {
    values: RawValues,
    quality: Vec<Quality>,
    /// The source time of each signal's value.
    made: Vec<Option<DateTime>>,
    frames: Vec<Box<[u8]>>,
    newest: Option<DateTime>,
    told: Nanos,
    /// The last reported quality.
    said: Option<String>,
}

impl Readings {
    /// Readings without any values.
    pub(super) fn new(table: &SignalTable, area: Area, port: &Port) -> Self {
        let frames = (0..port.stations()).map(|station| vec![0; port.sizes(station).1].into());
        Self {
            values: RawValues::new(table, area),
            quality: vec![Quality::Missing; table.signals.len()],
            made: vec![None; table.signals.len()],
            frames: frames.collect(),
            newest: None,
            told: Nanos(i64::MIN),
            said: None,
        }
    }

    /// Takes the values of one publish and commits them: once, with the newest value of each signal. If a
    /// signal has several, the earlier ones are committed before that, for their edges.
    ///
    /// # Errors
    ///
    /// A value's type is not its signal's.
    pub(super) fn take(
        &mut self,
        port: &mut Port,
        now: Nanos,
        fields: &[Field],
        values: &[(usize, DataValue)],
    ) -> Result<(), BusError> {
        let mut counts = vec![0; fields.len()];
        for (signal, _) in values {
            if let Some(count) = counts.get_mut(*signal) {
                *count += 1;
            }
        }
        let steps = counts.iter().copied().max().unwrap_or(0);
        // Aligned at the end: the last value of each signal belongs to the last step.
        let mut at: Vec<usize> = counts.iter().map(|count| steps - count).collect();
        let steps_of: Vec<usize> = values
            .iter()
            .map(|(signal, _)| {
                at.get_mut(*signal).map_or(usize::MAX, |at| {
                    *at += 1;
                    *at - 1
                })
            })
            .collect();
        for step in 0..steps {
            for ((signal, value), own) in values.iter().zip(&steps_of) {
                if *own == step {
                    self.set(port, *signal, &fields[*signal], value)?;
                }
            }
            self.commit(port, now, fields);
        }
        self.tell(port, now, fields);
        Ok(())
    }

    fn set(
        &mut self,
        port: &Port,
        signal: usize,
        field: &Field,
        value: &DataValue,
    ) -> Result<(), BusError> {
        let status = value.status();
        if let Some(made) = value.source_timestamp {
            if self.made[signal].is_some_and(|before| made.ticks() < before.ticks()) {
                port.count("opcua.source_time_back");
            }
            self.made[signal] = Some(made);
            if self
                .newest
                .is_none_or(|newest| newest.ticks() < made.ticks())
            {
                self.newest = Some(made);
            }
        }
        if status.is_bad() {
            port.count("opcua.bad_values");
            self.quality[signal] = Quality::Bad(status);
            return Ok(());
        }
        let bits = value
            .value
            .as_ref()
            .and_then(|value| values::bits(field.data_type, value));
        let Some(bits) = bits else {
            let theirs = value
                .value
                .as_ref()
                .and_then(opcua::types::Variant::scalar_type_id);
            return Err(BusError::Protocol(format!(
                "\"{}\" is {}, which is {:?} in OPC UA, but the value that came is {}; correct \"type\", or \
                 the node {}",
                field.name,
                field.data_type,
                scalar(field.data_type),
                theirs.map_or("none".to_owned(), |theirs| format!("{theirs:?}")),
                field.node
            )));
        };
        self.values.set(signal, bits);
        self.quality[signal] = if status.is_good() {
            Quality::Good
        } else {
            port.count("opcua.uncertain_values");
            Quality::Uncertain
        };
        Ok(())
    }

    /// True if all values of a station are present and usable.
    fn is_sound(&self, station: usize) -> bool {
        let mut signals = self.values.signals(station).iter();
        signals.all(|&signal| matches!(self.quality[signal], Quality::Good | Quality::Uncertain))
    }

    /// Passes on the stations whose values are complete.
    pub(super) fn commit(&mut self, port: &mut Port, now: Nanos, fields: &[Field]) {
        debug_assert_eq!(fields.len(), self.quality.len(), "one per signal");
        port.together(|port| {
            for station in 0..self.frames.len() {
                if !self.is_sound(station) {
                    continue;
                }
                let frame = &mut self.frames[station];
                if frame.is_empty() {
                    // No signal of the station is read, but its server is present.
                    port.touch(station, now);
                } else {
                    self.values.give(station, frame);
                    port.received(station, now, frame);
                }
            }
        });
    }

    /// The server sent a sign of life.
    pub(super) fn touch(&mut self, port: &mut Port, now: Nanos) {
        port.together(|port| {
            for station in 0..self.frames.len() {
                if self.is_sound(station) {
                    port.touch(station, now);
                }
            }
        });
    }

    /// True if all values are present and usable.
    pub(super) fn is_complete(&self) -> bool {
        (0..self.frames.len()).all(|station| self.is_sound(station))
    }

    /// Describes the first signal that has a bad value; `None` if all are good.
    pub(super) fn trouble(&self, fields: &[Field]) -> Option<String> {
        let mut bad = self.quality.iter().enumerate();
        bad.find_map(|(signal, quality)| match quality {
            Quality::Bad(status) => Some(format!(
                "the server has no good value of \"{}\" ({})",
                fields[signal].name,
                meaning(*status)
            )),
            _ => None,
        })
    }

    /// Updates quality and source time in the statistics.
    fn tell(&mut self, port: &Port, now: Nanos, fields: &[Field]) {
        let named = |wanted: fn(&Quality) -> bool| {
            let signals = self.quality.iter().enumerate();
            let names = signals.filter(|(_, quality)| wanted(quality));
            let names: Vec<&str> = names.map(|(signal, _)| &*fields[signal].name).collect();
            names.join(", ")
        };
        let bad = named(|quality| matches!(quality, Quality::Bad(_)));
        let uncertain = named(|quality| *quality == Quality::Uncertain);
        let text = match (&*bad, &*uncertain) {
            ("", "") => "good".to_owned(),
            ("", uncertain) => format!("uncertain: {uncertain}"),
            (bad, "") => format!("bad: {bad}"),
            (bad, uncertain) => format!("bad: {bad}; uncertain: {uncertain}"),
        };
        if self.said.as_ref() != Some(&text) {
            port.tell("quality", &text);
            self.said = Some(text);
        }
        if let Some(newest) = self.newest
            && now >= self.told
        {
            port.tell("source_time", &newest.to_rfc3339());
            self.told = now + TOLD_EVERY;
        }
    }
}
