//! The bus of kind `s7-server`: acts as a CPU whose memory clients read and write.

mod at;
mod layout;
mod map;
mod memory;
mod options;

use std::net::SocketAddr;
use std::sync::Arc;

use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::tcp::{self, Limits, Writer, Writers};
use tickbus_fieldbus::{BusError, BusSetup, Events, Free, Medium, Port, Receipt, Renewal};
use tickbus_image::signal::fail_safe_frame;
use tickbus_net::Address;

use super::szl::Facts;
use super::{ProtocolError, ServerSession, transport};

use map::Map;
use memory::{Jobs, Shared, StationMemory};
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
        let mut objects = layout::objects(options, table);
        let frames: Vec<[Box<[u8]>; 2]> = (0..table.stations.len())
            .map(|station| [sends, receives].map(|area| fail_safe_frame(table, station, area)))
            .collect();
        for placed in &mut objects {
            let mut bytes = std::mem::take(&mut placed.bytes);
            for part in placed.parts() {
                let [sent, received] = &frames[part.station];
                let frame = if part.area == sends { sent } else { received };
                part.gather(frame, &mut bytes);
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

/// One client.
#[derive(Debug)]
struct Client {
    conversation: ServerSession,
    number: u64,
    writer: Writer,
    /// Per station, whether its requests keep the values young.
    renewals: Box<[Renewal]>,
    /// The receipts for the values in the answers to it.
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
        if self.memory.begin(client.number, now) {
            client.receipts.clear();
        }
        let begin = reply.len();
        // A fault that begins during the packet applies to all of its jobs or to none.
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
        // While a fault held the answer back, another client may have taken newer values. This client may have got
        // some of them or none, so they are sent again.
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
