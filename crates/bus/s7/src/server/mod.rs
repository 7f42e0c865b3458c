//! The bus of kind `s7-server`: acts as a CPU whose memory clients read and write.

mod at;
mod layout;
mod map;
mod options;

use std::net::SocketAddr;
use std::ops::Range;
use std::sync::Arc;

use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::tcp::{self, Limits, Writer, Writers};
use tickbus_fieldbus::{BusError, BusSetup, Events, Free, Medium, Port, Receipt, Renewal, Role};
use tickbus_image::signal::fail_safe_frame;
use tickbus_net::Address;

use super::item::{Object, ReturnCode};
use super::pdu::function;
use super::place::LAST;
use super::szl::Facts;
use super::{Memory, ProtocolError, ServerSession, transport};

use layout::{Part, PlacedObject};
use map::{AreaRange, Map, Place};
pub use options::{Block, ServerOptions};

/// How long a client may take to complete a packet, or to read an answer.
const PATIENCE: Nanos = Nanos::from_secs(5);

/// The bits of the largest object.
const OBJECT_BITS: usize = (LAST + 1) * 8;

/// The bus of kind `s7-server`.
#[derive(Debug)]
pub struct S7Server {
    address: Address,
    service: Service,
}

impl S7Server {
    /// The bus that `options` describe.
    pub fn new(options: &ServerOptions, setup: &BusSetup<'_>) -> Self {
        let (table, role) = (setup.table, setup.role);
        let (sends, receives) = role.areas();
        let mut objects = layout::objects(options, table);
        for placed in &mut objects {
            let PlacedObject { bytes, .. } = placed;
            let mut bytes = std::mem::take(bytes);
            for part in placed.parts() {
                let frame = fail_safe_frame(table, part.station, part.area);
                part.gather(&frame, &mut bytes);
            }
            placed.bytes = bytes;
        }
        let stations = (0..table.stations.len()).map(|station| StationMemory {
            written: fail_safe_frame(table, station, receives),
            outgoing: fail_safe_frame(table, station, sends),
            is_taken: false,
            receipt: None,
            changed: Vec::new(),
            addressed: false,
            has_writer: false,
            writers: Writers::new(options.is_single_writer),
        });
        let facts = (0..table.stations.len()).map(|station| Facts {
            identity: options.identity(station, setup.name),
            pdu: options.pdu,
            clients: u16::try_from(options.clients).unwrap_or(u16::MAX),
            epoch: Facts::NEVER_SET,
        });
        Self {
            address: options.address.clone(),
            service: Service {
                facts: facts.collect(),
                clients: options.clients,
                memory: Shared {
                    map: Map::new(options, table, &objects),
                    objects: objects.into(),
                    role,
                    stations: stations.collect(),
                    flags: vec![0; options.flags].into(),
                    every_write: setup.events == Events::Writes,
                    batch: None,
                },
                welcomed: 0,
            },
        }
    }
}

impl Free for S7Server {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        if let Some(epoch) = port.clock().epoch() {
            for facts in &mut self.service.facts {
                facts.epoch = epoch;
            }
        }
        port.carried_by(Medium::Tcp);
        tcp::serve(&self.address, &mut self.service, port, stop)
    }
}

/// The protocol, over the image.
#[derive(Debug)]
struct Service {
    /// By station.
    facts: Box<[Facts]>,
    clients: usize,
    memory: Shared,
    /// The number of clients so far.
    welcomed: u64,
}

/// The state shared by all clients.
#[derive(Debug)]
struct Shared {
    map: Map,
    objects: Box<[PlacedObject]>,
    role: Role,
    stations: Box<[StationMemory]>,
    flags: Box<[u8]>,
    /// True if a write is an event even without a change.
    every_write: bool,
    /// The client and the time for which the outgoing frames were taken: jobs that arrive together see the
    /// same values.
    batch: Option<(u64, Nanos)>,
}

#[derive(Debug)]
struct StationMemory {
    /// The values written by clients, initially the fail-safe values.
    written: Box<[u8]>,
    /// The values of the other area that clients read in this batch, once they are taken.
    outgoing: Box<[u8]>,
    is_taken: bool,
    /// The receipt for the outgoing values; `None` if nothing goes out.
    receipt: Option<Receipt>,
    /// The bits written by the current job.
    changed: Vec<Range<usize>>,
    /// True if the current job reads or writes anything of this station.
    addressed: bool,
    /// True if any client has ever written.
    has_writer: bool,
    writers: Writers,
}

/// One client.
#[derive(Debug)]
struct Client {
    conversation: ServerSession,
    number: u64,
    writer: Writer,
    /// Per station, whether its requests keep the values young.
    renewals: Box<[Renewal]>,
    /// For what answers to it carry.
    receipts: Vec<Receipt>,
}

impl tcp::Service for Service {
    type Client = Client;

    fn limits(&self) -> Limits {
        Limits {
            telegram: transport::LONGEST_PACKET,
            clients: self.clients,
            patience: PATIENCE,
        }
    }

    fn welcome(&mut self, peer: SocketAddr, _now: Nanos) -> Client {
        self.welcomed += 1;
        Client {
            conversation: ServerSession::default(),
            number: self.welcomed,
            writer: Arc::new(peer),
            renewals: vec![Renewal::of_new_client(); self.memory.stations.len()].into(),
            receipts: Vec::new(),
        }
    }

    fn telegram(
        &mut self,
        client: &mut Client,
        now: Nanos,
        bytes: &[u8],
        reply: &mut Vec<u8>,
        port: &mut Port,
    ) -> Result<usize, BusError> {
        self.memory.begin(client, now);
        let begin = reply.len();
        // A fault that begins meanwhile meets all jobs of the packet or none.
        port.together(|port| {
            let station = self.memory.map.station_of(client.conversation.called());
            let facts = &self.facts[station.unwrap_or_default()];
            let mut jobs = Jobs {
                station,
                shared: &mut self.memory,
                renewals: &mut client.renewals,
                writer: &client.writer,
                receipts: &mut client.receipts,
                port,
                now,
                refusals: Vec::new(),
                lost: false,
            };
            let taken = client
                .conversation
                .packet(now, bytes, facts, &mut jobs, reply)
                .map_err(ProtocolError::into_error)?;
            if jobs.lost {
                reply.truncate(begin);
            }
            if let Some(wrong) = port.take_wrong() {
                transport::spoil(reply, begin, wrong);
                client.receipts.clear();
            }
            Ok(taken)
        })
    }

    fn replied(&mut self, client: &mut Client, port: &mut Port) {
        // While a fault held the answer back, another client may have taken newer values: what this one has of them is
        // unknown, and is sent again.
        let batch = self.memory.batch;
        let is_newest = batch.is_some_and(|(number, _)| number == client.number);
        for receipt in client.receipts.drain(..) {
            if is_newest {
                port.sent(&receipt);
            }
        }
        if is_newest {
            self.memory.batch = None;
        }
    }

    fn unheard(&mut self, client: &mut Client, now: Nanos, port: &mut Port) {
        client.receipts.clear();
        Renewal::lost_all(&mut client.renewals, now, port.max_age());
    }
}

impl Shared {
    /// Jobs of a client arrived at `now`.
    fn begin(&mut self, client: &mut Client, now: Nanos) {
        let batch = Some((client.number, now));
        if self.batch != batch {
            self.batch = batch;
            self.stations
                .iter_mut()
                .for_each(|station| station.is_taken = false);
            client.receipts.clear();
        }
    }
}

/// The memory during one client's job.
struct Jobs<'a> {
    shared: &'a mut Shared,
    /// The station whose inputs and outputs the client is connected to.
    station: Option<usize>,
    renewals: &'a mut [Renewal],
    writer: &'a Writer,
    receipts: &'a mut Vec<Receipt>,
    port: &'a mut Port,
    now: Nanos,
    /// The stations that the job has addressed so far, and the code with which a fault refuses it.
    refusals: Vec<(usize, Option<u8>)>,
    /// The answer is lost.
    lost: bool,
}

impl Jobs<'_> {
    /// The job addresses something of a station.
    fn address(&mut self, station: usize, function: u8) -> Result<(), ReturnCode> {
        // A fault with a chance meets the whole job or nothing of it.
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
                // Two signals can have the same bits of the object, and not of a frame.
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
