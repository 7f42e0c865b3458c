//! The bus of kind `s7-server`: acts as a CPU whose memory clients read and write.

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
use super::szl::{Facts, Identity};
use super::{Memory, ProtocolError, ServerSession, transport};

use map::{AreaRange, Map};
pub use options::{Block, ServerOptions};

/// How long a client may take to complete a packet, or to read an answer.
const PATIENCE: Nanos = Nanos::from_secs(5);

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
        let facts = Facts {
            identity: Identity::of_driver(setup.name),
            pdu: options.pdu,
            clients: u16::try_from(options.clients).unwrap_or(u16::MAX),
            epoch: Facts::NEVER_SET,
        };
        Self {
            address: options.address.clone(),
            service: Service {
                facts,
                clients: options.clients,
                memory: Shared {
                    map: Map::new(options, table),
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
            self.service.facts.epoch = epoch;
        }
        port.carried_by(Medium::Tcp);
        tcp::serve(&self.address, &mut self.service, port, stop)
    }
}

/// The protocol, over the image.
#[derive(Debug)]
struct Service {
    facts: Facts,
    clients: usize,
    memory: Shared,
    /// The number of clients so far.
    welcomed: u64,
}

/// The state shared by all clients.
#[derive(Debug)]
struct Shared {
    map: Map,
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
            let mut jobs = Jobs {
                station: self.memory.map.station_of(client.conversation.called()),
                shared: &mut self.memory,
                renewals: &mut client.renewals,
                writer: &client.writer,
                receipts: &mut client.receipts,
                port,
                now,
                lost: false,
            };
            let taken = client
                .conversation
                .packet(now, bytes, &self.facts, &mut jobs, reply)
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
    /// The answer is lost.
    lost: bool,
}

impl Jobs<'_> {
    fn place(
        &mut self,
        object: Object,
        range: &Range<usize>,
        function: u8,
    ) -> Result<(AreaRange, Range<usize>), ReturnCode> {
        let place = self.shared.map.place(object, self.station)?;
        if let Some(code) = self.port.answer(place.station, function, self.now)
            && self.port.is_station_up(place.station, self.now)
        {
            return Err(ReturnCode(code));
        }
        if range.end > place.length {
            return Err(ReturnCode::ADDRESS);
        }
        self.shared.stations[place.station].addressed = true;
        let begin = place.offset + range.start;
        Ok((place, begin..begin + range.len()))
    }

    /// The bytes that a job writes; only `bits` of them change.
    fn change(
        &mut self,
        object: Object,
        range: Range<usize>,
        bits: Range<usize>,
    ) -> Result<&mut [u8], ReturnCode> {
        if object == Object::Flags {
            return self.shared.flags.get_mut(range).ok_or(ReturnCode::ADDRESS);
        }
        let (place, range) = self.place(object, &range, function::WRITE)?;
        let (sends, _) = self.shared.role.areas();
        if place.area == sends {
            return Err(ReturnCode::ACCESS);
        }
        // A station that is cut off hears and answers nothing, as if its client were silent.
        if !self.port.is_station_up(place.station, self.now) {
            self.lost = true;
            self.renewals[place.station].lost(self.now, self.port.max_age());
            return Err(ReturnCode::ACCESS);
        }
        let station = &mut self.shared.stations[place.station];
        let first = range.start * 8;
        let changed = first + bits.start..first + bits.end;
        let found = (&*self.port, "s7.second_writer");
        if !(station.writers).may_write(self.writer, changed.clone(), self.now, found) {
            return Err(ReturnCode::ACCESS);
        }
        station.changed.push(changed);
        Ok(&mut station.written[range])
    }

    /// The bytes that a job reads; only `bits` of them are sent.
    fn look(
        &mut self,
        object: Object,
        range: Range<usize>,
        bits: Range<usize>,
    ) -> Result<&[u8], ReturnCode> {
        if object == Object::Flags {
            return self.shared.flags.get(range).ok_or(ReturnCode::ADDRESS);
        }
        let (place, range) = self.place(object, &range, function::READ)?;
        let (sends, _) = self.shared.role.areas();
        let station = &mut self.shared.stations[place.station];
        if place.area != sends {
            return Ok(&station.written[range]);
        }
        if !station.is_taken {
            station.is_taken = true;
            let only = place.station..place.station + 1;
            let frames = self.port.take(only, self.now);
            station.receipt = frames.map(|mut frames| {
                station
                    .outgoing
                    .copy_from_slice(frames.frame(place.station));
                frames.receipt()
            });
        }
        match &station.receipt {
            None => self.lost = true,
            Some(receipt) => {
                let first = range.start * 8;
                let bits = first + bits.start..first + bits.end;
                self.receipts.push(receipt.bits(place.station, bits));
            }
        }
        Ok(&station.outgoing[range])
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

    fn write(&mut self, object: Object, range: Range<usize>) -> Result<&mut [u8], ReturnCode> {
        let bits = 0..range.len() * 8;
        self.change(object, range, bits)
    }

    fn write_bit(&mut self, object: Object, byte: usize, bit: u8) -> Result<&mut u8, ReturnCode> {
        let bit = usize::from(bit);
        let bytes = self.change(object, byte..byte + 1, bit..bit + 1)?;
        Ok(&mut bytes[0])
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
        self.shared.map.blocks()
    }
}
