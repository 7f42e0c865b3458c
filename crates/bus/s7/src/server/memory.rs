//! The memory of a server during one client's job.

use std::ops::Range;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::tcp::{Writer, Writers};
use tickbus_fieldbus::{Port, Receipt, Renewal, Role, RowPart as _};

use super::layout::{Part, PlacedObject};
use super::map::{AreaRange, Map, Place};
use crate::Memory;
use crate::item::{Object, ReturnCode};
use crate::pdu::function;
use crate::place::LAST;

/// The bits of the largest object.
const OBJECT_BITS: usize = (LAST + 1) * 8;

/// The state shared by all clients.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) map: Map,
    pub(super) objects: Box<[PlacedObject]>,
    pub(super) role: Role,
    pub(super) stations: Box<[StationMemory]>,
    pub(super) flags: Box<[u8]>,
    /// True if a write is an event even without a change.
    pub(super) every_write: bool,
    /// The client and the time for which the outgoing frames were taken: jobs that arrive together see the
    /// same values.
    pub(super) batch: Option<(u64, Nanos)>,
}

#[derive(Debug)]
pub(super) struct StationMemory {
    /// The values written by clients, initially the fail-safe values.
    pub(super) written: Box<[u8]>,
    /// The values of the other area that clients read in this batch, once they are taken.
    pub(super) outgoing: Box<[u8]>,
    pub(super) is_taken: bool,
    /// The receipt for the outgoing values; `None` if nothing goes out.
    pub(super) receipt: Option<Receipt>,
    /// The bits written by the current job.
    pub(super) changed: Vec<Range<usize>>,
    /// True if the current job reads or writes anything of this station.
    pub(super) addressed: bool,
    /// True if any client has ever written.
    pub(super) has_writer: bool,
    pub(super) writers: Writers,
}

impl Shared {
    /// Jobs of the client with this number arrived at `now`. Returns true if they begin a batch.
    pub(super) fn begin(&mut self, number: u64, now: Nanos) -> bool {
        let batch = Some((number, now));
        let begins = self.batch != batch;
        if begins {
            self.batch = batch;
            self.stations
                .iter_mut()
                .for_each(|station| station.is_taken = false);
        }
        begins
    }
}

/// The memory during one client's job.
pub(super) struct Jobs<'a> {
    pub(super) shared: &'a mut Shared,
    /// The station whose inputs and outputs the client is connected to.
    pub(super) station: Option<usize>,
    pub(super) renewals: &'a mut [Renewal],
    pub(super) writer: &'a Writer,
    pub(super) receipts: &'a mut Vec<Receipt>,
    pub(super) port: &'a mut Port,
    pub(super) now: Nanos,
    /// The stations that the job has addressed so far, and the code with which a fault refuses it.
    pub(super) refusals: Vec<(usize, Option<u8>)>,
    /// The answer is lost.
    pub(super) lost: bool,
}

impl Jobs<'_> {
    /// The job addresses something of a station.
    fn address(&mut self, station: usize, function: u8) -> Result<(), ReturnCode> {
        // A fault with a chance applies to the whole job or not at all.
        let known = self.refusals.iter().find(|(of, _)| *of == station);
        let known = known.map(|(_, code)| *code);
        let code = known.unwrap_or_else(|| {
            let code = self.port.answer(station, function, self.now);
            let code = code.filter(|_| self.port.is_station_up(station, self.now));
            self.refusals.push((station, code));
            code
        });
        if let Some(code) = code {
            return Err(ReturnCode(code));
        }
        self.shared.stations[station].addressed = true;
        Ok(())
    }

    /// The place of an object that is a range of a station's area, and the bytes in that area.
    fn in_area(
        &mut self,
        place: AreaRange,
        range: &Range<usize>,
        function: u8,
    ) -> Result<Range<usize>, ReturnCode> {
        if range.end > place.length {
            return Err(ReturnCode::ADDRESS);
        }
        self.address(place.station, function)?;
        let begin = place.offset + range.start;
        Ok(begin..begin + range.len())
    }

    /// The parts of a placed object within `bits`; they count as addressed.
    fn parts(
        &mut self,
        at: usize,
        bits: &Range<usize>,
        function: u8,
    ) -> Result<Vec<Part>, ReturnCode> {
        let placed = &self.shared.objects[at];
        if bits.end > placed.bytes.len() * 8 {
            return Err(ReturnCode::ADDRESS);
        }
        let found = placed.find(bits);
        let parts: Vec<Part> = found.filter_map(|at| placed.part(at, bits)).collect();
        if parts.is_empty() {
            self.address(placed.owner, function)?;
        }
        for part in &parts {
            self.address(part.station, function)?;
        }
        Ok(parts)
    }

    /// A job writes bits of an object: `put` changes the bytes that have them.
    fn change(
        &mut self,
        object: Object,
        range: Range<usize>,
        bits: Range<usize>,
        put: impl FnOnce(&mut [u8]),
    ) -> Result<(), ReturnCode> {
        let (sends, _) = self.shared.role.areas();
        match self.shared.map.place(object, self.station)? {
            Place::Scratch => {
                let flags = self.shared.flags.get_mut(range);
                put(flags.ok_or(ReturnCode::ADDRESS)?);
            }
            Place::Area(place) => {
                let range = self.in_area(place, &range, function::WRITE)?;
                if place.area == sends {
                    return Err(ReturnCode::ACCESS);
                }
                self.check_up(place.station)?;
                let first = range.start * 8;
                let changed = first + bits.start..first + bits.end;
                self.check_writer(place.station, changed.clone())?;
                let station = &mut self.shared.stations[place.station];
                station.changed.push(changed);
                put(&mut station.written[range]);
            }
            Place::Object(at) => {
                let first = range.start * 8;
                let bits = first + bits.start..first + bits.end;
                let parts = self.parts(at, &bits, function::WRITE)?;
                if parts.iter().any(|part| part.area == sends) {
                    return Err(ReturnCode::ACCESS);
                }
                let owner = self.shared.objects[at].owner;
                if parts.is_empty() {
                    self.check_up(owner)?;
                }
                // Two signals can share bits of the object, but never bits of a frame.
                let base = at * OBJECT_BITS;
                for part in &parts {
                    self.check_up(part.station)?;
                    let bits = part.bits();
                    self.check_writer(part.station, base + bits.start..base + bits.end)?;
                }
                let bytes = &mut self.shared.objects[at].bytes;
                put(&mut bytes[range]);
                for part in &parts {
                    let station = &mut self.shared.stations[part.station];
                    part.scatter(bytes, &mut station.written);
                    station.changed.push(part.frame());
                }
            }
        }
        Ok(())
    }

    /// A station that is cut off hears and answers nothing, as if its client were silent.
    fn check_up(&mut self, station: usize) -> Result<(), ReturnCode> {
        if self.port.is_station_up(station, self.now) {
            return Ok(());
        }
        self.lost = true;
        self.renewals[station].lost(self.now, self.port.max_age());
        Err(ReturnCode::ACCESS)
    }

    /// Refuses a second writer of these bits, which have numbers of their own in the station.
    fn check_writer(&mut self, station: usize, bits: Range<usize>) -> Result<(), ReturnCode> {
        let found = (&*self.port, "s7.second_writer");
        let writers = &mut self.shared.stations[station].writers;
        if writers.may_write(self.writer, bits, self.now, found) {
            return Ok(());
        }
        Err(ReturnCode::ACCESS)
    }

    /// The bytes that a job reads; only `bits` of them are sent.
    fn look(
        &mut self,
        object: Object,
        range: Range<usize>,
        bits: Range<usize>,
    ) -> Result<&[u8], ReturnCode> {
        let (sends, _) = self.shared.role.areas();
        match self.shared.map.place(object, self.station)? {
            Place::Scratch => self.shared.flags.get(range).ok_or(ReturnCode::ADDRESS),
            Place::Area(place) => {
                let range = self.in_area(place, &range, function::READ)?;
                if place.area != sends {
                    return Ok(&self.shared.stations[place.station].written[range]);
                }
                let first = range.start * 8;
                self.send(place.station, first + bits.start..first + bits.end);
                Ok(&self.shared.stations[place.station].outgoing[range])
            }
            Place::Object(at) => {
                let first = range.start * 8;
                let bits = first + bits.start..first + bits.end;
                for part in self.parts(at, &bits, function::READ)? {
                    if part.area == sends {
                        self.send(part.station, part.frame());
                        let frame = &self.shared.stations[part.station].outgoing;
                        part.gather(frame, &mut self.shared.objects[at].bytes);
                    }
                }
                Ok(&self.shared.objects[at].bytes[range])
            }
        }
    }

    /// The answer carries these bits of a station's outgoing frame.
    fn send(&mut self, station: usize, bits: Range<usize>) {
        let memory = &mut self.shared.stations[station];
        if !memory.is_taken {
            memory.is_taken = true;
            let frames = self.port.take(station..station + 1, self.now);
            memory.receipt = frames.map(|mut frames| {
                memory.outgoing.copy_from_slice(frames.frame(station));
                frames.receipt()
            });
        }
        match &memory.receipt {
            None => self.lost = true,
            Some(receipt) => self.receipts.push(receipt.bits(station, bits)),
        }
    }
}

impl Memory for Jobs<'_> {
    fn read(&mut self, object: Object, range: Range<usize>) -> Result<&[u8], ReturnCode> {
        let bits = 0..range.len() * 8;
        self.look(object, range, bits)
    }

    fn read_bit(&mut self, object: Object, byte: usize, bit: u8) -> Result<u8, ReturnCode> {
        let bit = usize::from(bit);
        let bytes = self.look(object, byte..byte + 1, bit..bit + 1)?;
        Ok(bytes[0])
    }

    fn write(&mut self, object: Object, first: usize, values: &[u8]) -> Result<(), ReturnCode> {
        let bits = 0..values.len() * 8;
        let range = first..first + values.len();
        self.change(object, range, bits, |bytes| bytes.copy_from_slice(values))
    }

    fn write_bit(
        &mut self,
        object: Object,
        byte: usize,
        bit: u8,
        on: bool,
    ) -> Result<(), ReturnCode> {
        let bits = usize::from(bit)..usize::from(bit) + 1;
        self.change(object, byte..byte + 1, bits, |bytes| {
            bytes[0] = bytes[0] & !(1 << bit) | u8::from(on) << bit;
        })
    }

    fn done(&mut self) {
        let alone = self.shared.stations.len() == 1;
        let (now, renewals, shared) = (self.now, &mut self.renewals, &mut *self.shared);
        self.port.together(|port| {
            for (index, station) in shared.stations.iter_mut().enumerate() {
                let addressed = std::mem::take(&mut station.addressed);
                if !station.changed.is_empty() {
                    station.has_writer = true;
                    renewals[index].wrote(now);
                    let written = station.changed.drain(..);
                    if shared.every_write {
                        port.received_parts(index, now, &station.written, written);
                    } else {
                        let octets = written.map(|bits| bits.len().div_ceil(8)).sum();
                        port.received_with(index, now, &station.written, octets);
                    }
                } else if addressed || alone {
                    // A client that only reads must not make the values of one that writes look recent.
                    let counts = port.is_station_up(index, now)
                        && renewals[index].counts(now, port.max_age());
                    if counts || !station.has_writer {
                        port.touch(index, now);
                    }
                }
            }
        });
    }

    fn blocks(&self) -> &[(u16, usize)] {
        self.shared.map.blocks(self.station)
    }
}
