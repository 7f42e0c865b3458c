//! Maps the objects of a CPU to the frames of stations.

use tickbus_image::signal::{Area, SignalTable};

use super::ServerOptions;
use crate::Tsap;
use crate::item::{Object, ReturnCode};

/// A range of a station's area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct AreaRange {
    pub(super) station: usize,
    pub(super) area: Area,
    pub(super) offset: usize,
    pub(super) length: usize,
}

/// The places of a server's objects.
#[derive(Debug)]
pub(super) struct Map {
    /// The data blocks in order of their numbers, and their lengths for clients that ask.
    blocks: Vec<(u16, AreaRange)>,
    lengths: Vec<(u16, usize)>,
    stations: Vec<Cpu>,
}

/// A station as a CPU in a rack.
#[derive(Debug)]
struct Cpu {
    inputs: usize,
    outputs: usize,
    /// The rack and slot.
    slot: Option<(u8, u8)>,
}

impl Map {
    /// The map for `options`, which must [fit](ServerOptions::fit) the table.
    pub(super) fn new(options: &ServerOptions, table: &SignalTable) -> Self {
        let stations = table
            .stations
            .iter()
            .enumerate()
            .map(|(index, station)| Cpu {
                inputs: station.input_bytes,
                outputs: station.output_bytes,
                slot: options.slots.get(index).copied().flatten(),
            });
        let blocks = options.blocks.iter().filter_map(|block| {
            let station = block.station_in(table)?;
            let size = table.stations[station].bytes(block.area);
            let place = AreaRange {
                station,
                area: block.area,
                offset: block.offset,
                length: block.length.unwrap_or(size.saturating_sub(block.offset)),
            };
            Some((block.number, place))
        });
        let mut blocks: Vec<_> = blocks.collect();
        blocks.sort_by_key(|(number, _)| *number);
        let lengths = blocks.iter().map(|(number, place)| (*number, place.length));
        Self {
            lengths: lengths.collect(),
            blocks,
            stations: stations.collect(),
        }
    }

    /// The station whose inputs and outputs belong to the TSAP that a client connected to.
    pub(super) fn station_of(&self, called: Tsap) -> Option<usize> {
        if self.stations.len() == 1 {
            return Some(0);
        }
        let slot = called.slot()?;
        self.stations
            .iter()
            .position(|station| station.slot == Some(slot))
    }

    /// The place of an object for a client connected to `station`.
    pub(super) fn place(
        &self,
        object: Object,
        station: Option<usize>,
    ) -> Result<AreaRange, ReturnCode> {
        let area = match object {
            Object::Inputs => Area::Input,
            Object::Outputs => Area::Output,
            Object::Flags => return Err(ReturnCode::MISSING),
            Object::Block(number) => {
                let found = self.blocks.binary_search_by_key(&number, |block| block.0);
                return found
                    .map(|index| self.blocks[index].1)
                    .map_err(|_| ReturnCode::MISSING);
            }
        };
        let station = station.ok_or(ReturnCode::MISSING)?;
        let Cpu {
            inputs, outputs, ..
        } = self.stations[station];
        Ok(AreaRange {
            station,
            area,
            offset: 0,
            length: match area {
                Area::Input => inputs,
                Area::Output => outputs,
            },
        })
    }

    pub(super) fn blocks(&self) -> &[(u16, usize)] {
        &self.lengths
    }
}
