//! Maps the objects of a CPU to the frames of stations.

use tickbus_image::signal::{Area, SignalTable};

use super::ServerOptions;
use super::layout::PlacedObject;
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

/// The place of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// A range of a station's area.
    Area(AreaRange),
    /// Memory of its own: the position in the list of [placed objects](super::layout::objects).
    Object(usize),
    /// The scratch memory, which the flags of all other stations share.
    Scratch,
}

/// The places of a server's objects.
#[derive(Debug)]
pub(super) struct Map {
    /// The data blocks that are parts of images, in order of their numbers.
    blocks: Vec<(u16, AreaRange)>,
    /// The objects of placed stations, in the order of the list.
    objects: Vec<(Option<usize>, Object)>,
    /// The data blocks of each station and their lengths, for clients that ask. The last entry is for clients that connect
    /// to no station.
    lengths: Vec<Vec<(u16, usize)>>,
    stations: Vec<Cpu>,
}

/// A station as a CPU in a rack.
#[derive(Debug)]
struct Cpu {
    inputs: usize,
    outputs: usize,
    /// The rack and slot.
    slot: Option<(u8, u8)>,
    /// True if `[fieldbus.at]` places its signals.
    is_placed: bool,
}

impl Map {
    /// The map for `options`, which must [fit](ServerOptions::fit) the table, with the objects of its placed stations.
    pub(super) fn new(
        options: &ServerOptions,
        table: &SignalTable,
        objects: &[PlacedObject],
    ) -> Self {
        let stations = table
            .stations
            .iter()
            .enumerate()
            .map(|(index, station)| Cpu {
                inputs: station.input_bytes,
                outputs: station.output_bytes,
                slot: options.slots.get(index).copied().flatten(),
                is_placed: options.is_placed(table, index),
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
        let lengths = |station: Option<usize>| {
            let found = objects
                .iter()
                .filter(|placed| placed.cpu.is_none() || placed.cpu == station);
            let found = found.filter_map(|placed| match placed.object {
                // A block of the CPU takes precedence over one that all CPUs share.
                Object::Block(number) => Some((number, placed.cpu.is_none(), placed.bytes.len())),
                _ => None,
            });
            let images = blocks
                .iter()
                .map(|(number, place)| (*number, true, place.length));
            let mut all: Vec<_> = found.chain(images).collect();
            all.sort_unstable();
            all.dedup_by_key(|(number, ..)| *number);
            all.iter()
                .map(|(number, _, length)| (*number, *length))
                .collect()
        };
        let clients = (0..table.stations.len()).map(Some).chain([None]);
        Self {
            lengths: clients.map(lengths).collect(),
            objects: objects
                .iter()
                .map(|placed| (placed.cpu, placed.object))
                .collect(),
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
    ) -> Result<Place, ReturnCode> {
        // The image of a station without lines takes precedence over objects that other stations share.
        let has_image = station.is_some_and(|station| !self.stations[station].is_placed)
            && matches!(object, Object::Inputs | Object::Outputs);
        let common = (!has_image).then_some(None);
        for cpu in [Some(station), common].into_iter().flatten() {
            if let Ok(at) = self.objects.binary_search(&(cpu, object)) {
                return Ok(Place::Object(at));
            }
        }
        let area = match object {
            Object::Inputs => Area::Input,
            Object::Outputs => Area::Output,
            Object::Flags => return Ok(Place::Scratch),
            Object::Block(number) => {
                let found = self.blocks.binary_search_by_key(&number, |block| block.0);
                return found
                    .map(|index| Place::Area(self.blocks[index].1))
                    .map_err(|_| ReturnCode::MISSING);
            }
        };
        let station = station.ok_or(ReturnCode::MISSING)?;
        let Cpu {
            inputs, outputs, ..
        } = self.stations[station];
        Ok(Place::Area(AreaRange {
            station,
            area,
            offset: 0,
            length: match area {
                Area::Input => inputs,
                Area::Output => outputs,
            },
        }))
    }

    /// The data blocks and their lengths, for a client connected to `station`.
    pub(super) fn blocks(&self, station: Option<usize>) -> &[(u16, usize)] {
        let other = self.lengths.len() - 1;
        &self.lengths[station.unwrap_or(other)]
    }
}
