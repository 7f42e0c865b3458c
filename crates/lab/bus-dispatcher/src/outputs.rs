//! The values of this end's outputs.

use tickbus_dispatcher::client::Client;
use tickbus_dispatcher::{Channel, Number, ON_VOLTS};
use tickbus_fieldbus::{DeadBands, Frames, Port, Role};
use tickbus_image::signal::{DataType, RawValues, SignalTable};

use super::Channels;

/// The outputs, and the last frames sent.
#[derive(Debug)]
pub(super) struct Outputs {
    list: Box<[Output]>,
    raw: RawValues,
    stations: Box<[Frame]>,
    /// Nothing was sent on this connection yet.
    is_first: bool,
}

#[derive(Debug)]
struct Output {
    signal: usize,
    channel: Channel,
    data_type: DataType,
    /// The last bits sent.
    last: Option<u64>,
    /// The value cannot be sent.
    is_unsayable: bool,
}

#[derive(Debug)]
struct Frame {
    last: Box<[u8]>,
    now: Box<[u8]>,
    bands: DeadBands,
}

impl Outputs {
    pub(super) fn new(table: &SignalTable, role: Role, channels: &Channels) -> Self {
        let (area, _) = role.areas();
        let signals = table.signals.iter().enumerate().zip(&channels.list);
        let signals = signals.filter(|((_, signal), _)| signal.area == area);
        let list = signals.map(|((index, signal), channel)| Output {
            signal: index,
            channel: *channel,
            data_type: signal.data_type,
            last: None,
            is_unsayable: false,
        });
        let stations = table
            .stations
            .iter()
            .enumerate()
            .map(|(index, station)| Frame {
                last: vec![0; station.bytes(area)].into(),
                now: vec![0; station.bytes(area)].into(),
                bands: DeadBands::new(table, index, area),
            });
        Self {
            list: list.collect(),
            raw: RawValues::new(table, area),
            stations: stations.collect(),
            is_first: true,
        }
    }

    /// A connection begins.
    pub(super) fn begin(&mut self) {
        self.is_first = true;
        for output in &mut self.list {
            output.last = None;
        }
    }

    /// Looks at the frames; returns whether there is something to send.
    pub(super) fn look(&mut self, frames: &mut Frames<'_>) -> bool {
        let mut differs = self.is_first;
        for (station, Frame { last, now, bands }) in self.stations.iter_mut().enumerate() {
            now.copy_from_slice(frames.frame(station));
            differs |= bands.differ(last, now);
        }
        differs
    }

    /// Sets the values that have changed in these frames; without a client they are lost.
    pub(super) fn say(&mut self, mut client: Option<&mut Client>, port: &Port) {
        self.is_first = false;
        for (station, frame) in self.stations.iter_mut().enumerate() {
            frame.last.copy_from_slice(&frame.now);
            self.raw.take(station, &frame.last);
        }
        for output in &mut self.list {
            let bits = self.raw.bits(output.signal);
            if output.last.replace(bits) == Some(bits) {
                continue;
            }
            let number = number(output.data_type, bits);
            match (number, &mut client) {
                (Some(number), Some(client)) => client.set(output.channel, number),
                (None, _) => {
                    port.count("dispatcher.out_of_range");
                    if !output.is_unsayable {
                        port.log(
                            log::Level::Warn,
                            "not sent",
                            format_args!(
                                "the value of {} cannot be sent, since it is no finite number of up to 23 digits; its \
                                 last one stays until it is",
                                output.channel
                            ),
                        );
                    }
                }
                (Some(_), None) => {}
            }
            output.is_unsayable = number.is_none();
        }
    }
}

/// The value of these bits; `None` for infinities, NaN, and values that are too long.
#[expect(clippy::cast_possible_truncation, reason = "a REAL has 32 bits")]
fn number(data_type: DataType, bits: u64) -> Option<Number> {
    match data_type {
        DataType::Bool => Number::of(if bits == 0 { 0 } else { ON_VOLTS }),
        DataType::Real => Number::of(f32::from_bits(bits as u32)),
        DataType::Lreal => Number::of(f64::from_bits(bits)),
        _ if data_type.is_signed() => {
            let unused = 64 - data_type.width().bits();
            Number::of((bits << unused).cast_signed() >> unused)
        }
        _ => Number::of(bits),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_become_volts_and_numbers() {
        for (data_type, bits, right) in [
            (DataType::Bool, 0, Some("0")),
            (DataType::Bool, 1, Some("24")),
            (DataType::Int, 0xFFFE, Some("-2")),
            (DataType::Word, 0xFFFE, Some("65534")),
            (DataType::Lint, u64::MAX, Some("-1")),
            (DataType::Ulint, u64::MAX, Some("18446744073709551615")),
            (DataType::Real, u64::from(0.1_f32.to_bits()), Some("0.1")),
            (DataType::Lreal, (-2.5_f64).to_bits(), Some("-2.5")),
            (DataType::Real, u64::from(f32::NAN.to_bits()), None),
            (DataType::Lreal, 1e30_f64.to_bits(), None),
        ] {
            let number = number(data_type, bits);
            assert_eq!(number.as_ref().map(Number::as_str), right, "{data_type}");
        }
    }
}
