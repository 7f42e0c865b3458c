//! The objects of a CPU whose signals `[fieldbus.at]` has placed: memory of their own, and the bits of frames in it.

use std::ops::Range;

use tickbus_fieldbus::{Row, RowPart, copy_bits};
use tickbus_image::signal::{Area, SignalTable};

use super::ServerOptions;
use crate::item::Object;

/// Bits of a station's frame, and the bits of an object that carry them in the same order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Part {
    pub(super) station: usize,
    pub(super) area: Area,
    /// The first bit in the object.
    first: usize,
    /// The first bit in the frame.
    frame: usize,
    bits: usize,
}

impl Part {
    fn end(&self) -> usize {
        self.first + self.bits
    }

    /// The bits in the frame.
    pub(super) fn frame(&self) -> Range<usize> {
        self.frame..self.frame + self.bits
    }

    /// Copies the part from an object's bytes into its frame.
    pub(super) fn scatter(&self, bytes: &[u8], frame: &mut [u8]) {
        copy_bits(bytes, self.first, self.bits, frame, self.frame);
    }

    /// Copies the part from its frame into an object's bytes.
    pub(super) fn gather(&self, frame: &[u8], bytes: &mut [u8]) {
        copy_bits(frame, self.frame, self.bits, bytes, self.first);
    }

    /// The portion of the part within `bits` of the object.
    fn within(&self, bits: &Range<usize>) -> Option<Self> {
        let first = self.first.max(bits.start);
        let end = self.end().min(bits.end);
        (first < end).then(|| Self {
            first,
            frame: self.frame + first - self.first,
            bits: end - first,
            ..*self
        })
    }
}

impl RowPart for Part {
    /// The bits in the object.
    fn bits(&self) -> Range<usize> {
        self.first..self.end()
    }

    fn append(&mut self, next: &Self) -> bool {
        let continues = (next.station, next.area) == (self.station, self.area)
            && next.first == self.end()
            && next.frame == self.frame + self.bits;
        if continues {
            self.bits += next.bits;
        }
        continues
    }
}

/// One object: a data block, or the inputs, outputs or flags of a CPU.
#[derive(Debug)]
pub(super) struct PlacedObject {
    /// The station that is the CPU with this object; `None` for an object that every client finds.
    pub(super) cpu: Option<usize>,
    pub(super) object: Object,
    /// The station that requests for bytes without a signal count for.
    pub(super) owner: usize,
    /// The contents. Bytes without a signal keep what clients write.
    pub(super) bytes: Box<[u8]>,
    parts: Row<Part>,
}

impl PlacedObject {
    fn new(cpu: Option<usize>, object: Object, owner: usize) -> Self {
        Self {
            cpu,
            object,
            owner,
            bytes: Box::default(),
            parts: Row::default(),
        }
    }

    /// Gives the object its length, at least that of its parts, and orders them.
    fn finish(&mut self, length: usize) {
        self.parts.finish();
        let end = self.parts.end().div_ceil(8);
        self.bytes = vec![0; length.max(end)].into();
    }

    /// The parts that reach into `bits`, as positions for [`part`](Self::part).
    pub(super) fn find(&self, bits: &Range<usize>) -> Range<usize> {
        self.parts.find(bits)
    }

    /// The portion of a part within `bits`; `None` if another part reaches over it.
    pub(super) fn part(&self, at: usize, bits: &Range<usize>) -> Option<Part> {
        self.parts.parts()[at].within(bits)
    }

    /// All parts.
    pub(super) fn parts(&self) -> &[Part] {
        self.parts.parts()
    }
}

/// The objects of all placed stations, in the order of CPU and object.
pub(super) fn objects(options: &ServerOptions, table: &SignalTable) -> Vec<PlacedObject> {
    let mut objects: Vec<PlacedObject> = Vec::new();
    let stations = (0..table.stations.len()).filter(|station| options.is_placed(table, *station));
    for station in stations {
        let cpu = options.cpu(table, station);
        for object in [Object::Inputs, Object::Outputs, Object::Flags] {
            object_of(&mut objects, cpu, object, station);
        }
        for length in options.lengths_of(table, station) {
            object_of(&mut objects, cpu, Object::Block(length.number), station);
        }
        for signal in table
            .signals
            .iter()
            .filter(|signal| signal.station == station)
        {
            let Some(variable) = options.variables.get(&signal.name) else {
                continue;
            };
            let (first, bits) = variable.bits();
            let part = Part {
                station,
                area: signal.area,
                first,
                frame: signal.address().bits().start,
                bits,
            };
            object_of(&mut objects, cpu, variable.object, station)
                .parts
                .push(part);
        }
    }
    for placed in &mut objects {
        let length = match placed.object {
            Object::Flags => options.flags,
            Object::Block(number) => {
                // Several stations can share the block, and each can state its length.
                let stations = 0..table.stations.len();
                let sharers = stations.filter(|station| options.cpu(table, *station) == placed.cpu);
                let lengths = sharers.flat_map(|station| options.lengths_of(table, station));
                let stated = lengths.filter(|length| length.number == number);
                stated.map(|length| length.length).max().unwrap_or(0)
            }
            Object::Inputs | Object::Outputs => 0,
        };
        placed.finish(length);
    }
    objects
}

/// The object of a CPU, which is added if it is missing.
fn object_of(
    objects: &mut Vec<PlacedObject>,
    cpu: Option<usize>,
    object: Object,
    owner: usize,
) -> &mut PlacedObject {
    let key = |placed: &PlacedObject| (placed.cpu, placed.object);
    let at = match objects.binary_search_by_key(&(cpu, object), key) {
        Ok(at) => at,
        Err(at) => {
            objects.insert(at, PlacedObject::new(cpu, object, owner));
            at
        }
    };
    &mut objects[at]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(first: usize, frame: usize, bits: usize) -> Part {
        Part {
            station: 0,
            area: Area::Output,
            first,
            frame,
            bits,
        }
    }

    fn object(parts: &[Part]) -> PlacedObject {
        let mut object = PlacedObject::new(None, Object::Block(1), 0);
        for part in parts {
            object.parts.push(*part);
        }
        object.finish(4);
        object
    }

    #[test]
    fn neighbours_that_are_neighbours_in_the_frame_are_one_part() {
        let object = object(&[
            part(9, 1, 1),
            part(8, 0, 1),
            part(10, 7, 1),
            part(16, 16, 16),
        ]);
        assert_eq!(
            object.parts(),
            [part(8, 0, 2), part(10, 7, 1), part(16, 16, 16)]
        );
        assert_eq!(object.bytes.len(), 4);
        assert_eq!(object.find(&(0..8)), 0..0);
        assert_eq!(object.find(&(9..11)), 0..2);
        assert_eq!(object.part(0, &(9..11)), Some(part(9, 1, 1)));
        assert_eq!(object.find(&(24..32)), 2..3);
    }

    #[test]
    fn a_word_and_its_bits_are_found_from_every_side() {
        let object = object(&[part(0, 32, 16), part(3, 0, 1), part(12, 1, 1)]);
        let found = |bits: Range<usize>| {
            let found = object.find(&bits);
            let parts = found.filter_map(|at| object.part(at, &bits));
            parts.collect::<Vec<_>>()
        };
        assert_eq!(found(3..4), [part(3, 35, 1), part(3, 0, 1)]);
        assert_eq!(found(8..16), [part(8, 40, 8), part(12, 1, 1)]);
        assert_eq!(found(16..24), []);
    }
}
