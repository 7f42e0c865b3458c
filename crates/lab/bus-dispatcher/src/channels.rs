//! Maps signals to channels.

use std::collections::BTreeMap;

use tickbus_dispatcher::{Channel, Counts, Kind};
use tickbus_fieldbus::Role;
use tickbus_image::signal::{DataType, Signal, SignalTable};

/// The channels of the signals of one end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channels {
    /// The channel of each signal of the table. The number may be too large for a dispatcher.
    pub list: Vec<Channel>,
    /// The number of channels of each kind.
    pub counts: Counts,
}

/// The kind of a signal at the end with `role`: an output if that end writes it, and digital if it is a BOOL.
pub(super) fn kind_of(signal: &Signal, role: Role) -> Kind {
    let (writes, _) = role.areas();
    match (signal.data_type, signal.area == writes) {
        (DataType::Bool, true) => Kind::DigitalOutput,
        (DataType::Bool, false) => Kind::DigitalInput,
        (_, true) => Kind::AnalogOutput,
        (_, false) => Kind::AnalogInput,
    }
}

impl Channels {
    /// Channels in the order of stations and addresses, from 1; `placed` has the channels that some signals have by
    /// name, which the others leave out.
    pub fn new(table: &SignalTable, role: Role, placed: &BTreeMap<String, Channel>) -> Self {
        let signals = &table.signals;
        let mut order: Vec<usize> = (0..signals.len()).collect();
        order.sort_by_key(|index| {
            let signal = &signals[*index];
            (signal.station, signal.byte, signal.bit)
        });
        let mut next = [1; 4];
        let mut list = vec![None; signals.len()];
        for index in order {
            let signal = &signals[index];
            let kind = kind_of(signal, role);
            let free = || {
                let next = &mut next[kind as usize];
                loop {
                    let channel = Channel {
                        kind,
                        number: *next,
                    };
                    *next += 1;
                    if !placed.values().any(|taken| *taken == channel) {
                        return channel;
                    }
                }
            };
            list[index] = Some(placed.get(&signal.name).copied().unwrap_or_else(free));
        }
        let list: Vec<Channel> = list.into_iter().flatten().collect();
        let [q, i, aq, ai] = Kind::ALL.map(|kind| {
            let numbers = list.iter().filter(|channel| channel.kind == kind);
            numbers.map(|channel| channel.number).max().unwrap_or(0)
        });
        Self {
            list,
            counts: Counts::new(q, i, aq, ai),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_image::signal::{Area, Station};

    fn shown(role: Role, placed: &[(&str, &str)]) -> (Vec<String>, [u16; 4]) {
        let bit = |name: &str, area, byte, bit| Signal {
            bit,
            ..Signal::new(name, area, byte, DataType::Bool)
        };
        let mut table = SignalTable::of_one_station(
            8,
            8,
            vec![
                bit("late", Area::Input, 1, 0),
                bit("high", Area::Input, 0, 7),
                bit("low", Area::Input, 0, 2),
                Signal::new("real", Area::Input, 4, DataType::Real),
                Signal::new("word", Area::Output, 2, DataType::Word),
                bit("run", Area::Output, 0, 0),
                Signal::new("int", Area::Input, 2, DataType::Int),
                Signal {
                    station: 1,
                    ..bit("other", Area::Input, 0, 0)
                },
            ],
        );
        table.stations.push(Station {
            name: "B".to_owned(),
            input_bytes: 1,
            output_bytes: 0,
            observed_bytes: 0,
        });
        let channel = |text: &str| Channel::parse(text.as_bytes()).expect("a channel");
        let placed = placed
            .iter()
            .map(|(name, text)| ((*name).to_owned(), channel(text)));
        let channels = Channels::new(&table, role, &placed.collect());
        let list = channels.list.iter().map(ToString::to_string).collect();
        (list, Kind::ALL.map(|kind| channels.counts.of(kind)))
    }

    #[test]
    fn signals_are_counted_by_address_and_the_roles_mirror_each_other() {
        let machine = ["Q3", "Q2", "Q1", "AQ2", "AI1", "I1", "AQ1", "Q4"].map(str::to_owned);
        assert_eq!(shown(Role::Device, &[]), (machine.to_vec(), [4, 1, 2, 1]));
        let plc = ["I3", "I2", "I1", "AI2", "AQ1", "Q1", "AI1", "I4"].map(str::to_owned);
        assert_eq!(shown(Role::Controller, &[]), (plc.to_vec(), [1, 4, 1, 2]));
    }

    #[test]
    fn a_signal_with_a_channel_of_its_own_is_left_out_of_the_count() {
        let right = ["Q1", "Q3", "Q2", "AQ2", "AI9", "I1", "AQ1", "Q4"].map(str::to_owned);
        let placed = [("low", "Q2"), ("late", "Q1"), ("word", "AI9")];
        assert_eq!(shown(Role::Device, &placed), (right.to_vec(), [4, 1, 2, 9]));
    }
}
