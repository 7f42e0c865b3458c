//! The inputs of this end, and the frames that their values make.

use tickbus_base::time::Nanos;
use tickbus_dispatcher::{Channel, Number, level};
use tickbus_fieldbus::{Port, Role};
use tickbus_image::signal::{DataType, RawValues, SignalTable, fail_safe_frame};

use super::Channels;

/// The inputs.
#[derive(Debug)]
pub(super) struct Inputs {
    list: Box<[Input]>,
    /// The index of a channel in the list: digital ones and analog ones, by number less 1.
    places: [Box<[Option<usize>]>; 2],
    raw: RawValues,
    stations: Box<[Station]>,
}

#[derive(Debug)]
struct Input {
    signal: usize,
    station: usize,
    channel: Channel,
    data_type: DataType,
    fail_safe: u64,
    /// The input has a value from its source.
    is_alive: bool,
    /// The last value was out of range.
    is_out: bool,
}

#[derive(Debug)]
struct Station {
    frame: Box<[u8]>,
    inputs: usize,
    /// The number of these inputs with a source.
    alive: usize,
    is_changed: bool,
}

impl Inputs {
    pub(super) fn new(table: &SignalTable, role: Role, channels: &Channels) -> Self {
        let (_, area) = role.areas();
        let mut raw = RawValues::new(table, area);
        let frames: Vec<_> = (0..table.stations.len())
            .map(|station| fail_safe_frame(table, station, area))
            .collect();
        for (station, frame) in frames.iter().enumerate() {
            raw.take(station, frame);
        }
        let signals = table.signals.iter().enumerate().zip(&channels.list);
        let signals = signals.filter(|((_, signal), _)| signal.area == area);
        let list: Box<[Input]> = signals
            .map(|((index, signal), channel)| Input {
                signal: index,
                station: signal.station,
                channel: *channel,
                data_type: signal.data_type,
                fail_safe: raw.bits(index),
                is_alive: false,
                is_out: false,
            })
            .collect();
        let places = [false, true].map(|is_analog| {
            let of_kind = |at: &usize| list[*at].channel.kind.is_analog() == is_analog;
            let number = |at: usize| usize::from(list[at].channel.number);
            let all = (0..list.len()).filter(of_kind);
            let mut places = vec![None; all.clone().map(number).max().unwrap_or(0)];
            all.for_each(|at| places[number(at) - 1] = Some(at));
            places.into()
        });
        let station = |(index, frame)| Station {
            frame,
            inputs: list.iter().filter(|input| input.station == index).count(),
            alive: 0,
            is_changed: false,
        };
        Self {
            stations: frames.into_iter().enumerate().map(station).collect(),
            list,
            places,
            raw,
        }
    }

    /// A connection begins: no input has a source.
    pub(super) fn begin(&mut self) {
        for input in &mut self.list {
            self.raw.set(input.signal, input.fail_safe);
            input.is_alive = false;
        }
        for station in &mut self.stations {
            station.alive = 0;
            station.is_changed = false;
        }
    }

    /// True if this end exchanges data: an input has a source, or there are no inputs.
    pub(super) fn is_served(&self) -> bool {
        self.list.is_empty() || self.stations.iter().any(|station| station.alive > 0)
    }

    fn input(&mut self, channel: Channel) -> Option<&mut Input> {
        let places = &self.places[usize::from(channel.kind.is_analog())];
        let at = places.get(usize::from(channel.number).checked_sub(1)?)?;
        Some(&mut self.list[(*at)?])
    }

    /// An input has a value. Values that do not fit the signal are refused.
    pub(super) fn value(&mut self, channel: Channel, value: Number, port: &Port) {
        let Some(input) = self.input(channel) else {
            // A number that [fieldbus.at] leaves out.
            return;
        };
        let (signal, data_type, station) = (input.signal, input.data_type, input.station);
        let was_alive = std::mem::replace(&mut input.is_alive, true);
        let before = self.raw.bits(signal);
        let bits = bits(data_type, value, before);
        let was_out = self
            .input(channel)
            .is_some_and(|input| std::mem::replace(&mut input.is_out, bits.is_none()));
        if bits.is_none() {
            port.count("dispatcher.out_of_range");
            if !was_out {
                port.log(
                    log::Level::Warn,
                    "out of range",
                    format_args!(
                        "{channel} got {value}, which no {data_type} holds; it keeps its value until it gets one that fits"
                    ),
                );
            }
        }
        self.raw.set(signal, bits.unwrap_or(before));
        let station = &mut self.stations[station];
        station.alive += usize::from(!was_alive);
        station.is_changed = true;
    }

    /// An input has lost its source.
    pub(super) fn lost(&mut self, channel: Channel, port: &Port) {
        let Some(input) = self.input(channel) else {
            return;
        };
        let was_alive = std::mem::replace(&mut input.is_alive, false);
        let (signal, station, fail_safe) = (input.signal, input.station, input.fail_safe);
        self.raw.set(signal, fail_safe);
        port.count("dispatcher.lost");
        let station = &mut self.stations[station];
        station.alive -= usize::from(was_alive);
        station.is_changed = true;
    }

    /// Passes on the stations that have changed, and touches the others that have a source, or need none.
    pub(super) fn deliver(&mut self, now: Nanos, port: &mut Port) {
        if !port.is_up(now) {
            return;
        }
        port.together(|port| {
            for (index, station) in self.stations.iter_mut().enumerate() {
                if std::mem::take(&mut station.is_changed) {
                    self.raw.give(index, &mut station.frame);
                    port.received(index, now, &station.frame);
                } else if station.alive > 0 || station.inputs == 0 {
                    port.touch(index, now);
                }
            }
        });
    }
}

/// The bits of a value; `None` if the type cannot hold it.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the range was checked; a number that a REAL cannot hold is rounded"
)]
fn bits(data_type: DataType, value: Number, before: u64) -> Option<u64> {
    let real = value.to_f64();
    match data_type {
        DataType::Bool => Some(level(real).map_or(before, u64::from)),
        DataType::Real => Some(u64::from((real as f32).to_bits())),
        DataType::Lreal => Some(real.to_bits()),
        _ => {
            // A value without a fraction needs no rounding, and may have more digits than a double keeps.
            let whole = value.as_str().parse::<i128>();
            let whole = whole.unwrap_or_else(|_| real.round() as i128);
            let range = data_type.range()?;
            range.contains(&whole).then(|| {
                let all = u64::MAX >> (64 - data_type.width().bits());
                whole as u64 & all
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volts_and_numbers_become_bits() {
        let real = |value: f32| Some(u64::from(value.to_bits()));
        for (data_type, before, text, right) in [
            (DataType::Bool, 0, "4.9", Some(0)),
            (DataType::Bool, 1, "4.9", Some(0)),
            (DataType::Bool, 0, "5", Some(0)),
            (DataType::Bool, 1, "5", Some(1)),
            (DataType::Bool, 0, "8", Some(0)),
            (DataType::Bool, 1, "8", Some(1)),
            (DataType::Bool, 0, "8.1", Some(1)),
            (DataType::Bool, 1, "-24", Some(0)),
            (DataType::Int, 7, "-2", Some(0xFFFE)),
            (DataType::Int, 7, "2.5", Some(3)),
            (DataType::Int, 7, "-2.5", Some(0xFFFD)),
            (DataType::Int, 7, "32767.4", Some(0x7FFF)),
            (DataType::Int, 7, "32767.5", None),
            (DataType::Int, 7, "-32769", None),
            (DataType::Usint, 7, "-1", None),
            (DataType::Usint, 7, "255", Some(255)),
            (DataType::Ulint, 7, "18446744073709551615", Some(u64::MAX)),
            (DataType::Ulint, 7, "18446744073709551616", None),
            (DataType::Lint, 7, "-9223372036854775808", Some(1 << 63)),
            (DataType::Real, 7, "-0.5", real(-0.5)),
            (DataType::Lreal, 7, "0.1", Some(0.1_f64.to_bits())),
        ] {
            let value = Number::parse(text.as_bytes()).expect(text);
            assert_eq!(bits(data_type, value, before), right, "{data_type} {text}");
        }
    }
}
