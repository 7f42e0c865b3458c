//! The records of a station, and the requests to read and write them.

use super::Acyclic;
use super::drive::{self, Parameter};
use super::identification::{INDEX, Identification};
use super::machine::Machine;
use super::pdu::{Refusal, function, refuse};

/// A block of octets that masters read, and may write.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// The slot; 0 is the device itself.
    pub slot: u8,
    /// The index, 0 to 254.
    pub index: u8,
    /// The octets at power-on, 1 to 240.
    pub octets: Vec<u8>,
    /// Masters may write the record.
    pub is_writable: bool,
}

/// The requests of a master that its next reading answers.
#[derive(Debug, Default)]
pub(super) struct Called {
    /// The part of record 255 that it has named in a slot.
    part: Option<(u8, u16)>,
    /// The answer to its request for parameters in record 47; empty if there is no such answer.
    parameters: Vec<u8>,
}

/// The records.
#[derive(Debug)]
pub(super) struct Records {
    all: Vec<Record>,
    parameters: Vec<Parameter>,
    identification: Identification,
    /// The highest slot.
    slots: u8,
    /// The most octets of a record.
    room: usize,
}

impl Records {
    pub(super) fn new(own: &Acyclic, slots: u8) -> Self {
        Self {
            all: own.records.clone(),
            parameters: own.parameters.clone(),
            identification: Identification::new(&own.nameplate),
            slots,
            room: own.room(),
        }
    }

    /// Serves a request; returns the answer.
    pub(super) fn serve(
        &mut self,
        request: &[u8],
        called: &mut Called,
        machine: &mut impl Machine,
    ) -> Vec<u8> {
        let mut answer = Vec::new();
        let service = request[0];
        let served = match *request {
            [function::READ, slot, index, length] if length > 0 => {
                self.read(slot, index, length, called, machine, &mut answer)
            }
            [function::WRITE, slot, index, length, ref data @ ..] if length > 0 => {
                if data.len() == length.into() && data.len() <= self.room {
                    self.write(slot, index, data, called, machine)
                        .map(|()| answer.extend([service, slot, index, length]))
                } else {
                    Err(Refusal::Length)
                }
            }
            [function::READ | function::WRITE, ..] => Err(Refusal::Form),
            _ => Err(Refusal::NotSupported),
        };
        if let Err(why) = served {
            if let [function::READ | function::WRITE, slot, index, ..] = *request {
                machine.refused(service == function::WRITE, slot, index, why);
            }
            refuse(service, why, &mut answer);
        }
        answer
    }

    fn read(
        &self,
        slot: u8,
        index: u8,
        length: u8,
        called: &mut Called,
        machine: &mut impl Machine,
        answer: &mut Vec<u8>,
    ) -> Result<(), Refusal> {
        let mut octets = if index == INDEX {
            self.check_slot(slot)?;
            match called.part {
                Some((of, part)) if of == slot => self.identification.read(part)?,
                _ => return Err(Refusal::State),
            }
        } else if self.is_drive(index) {
            self.check_slot(slot)?;
            match std::mem::take(&mut called.parameters) {
                answer if answer.is_empty() => return Err(Refusal::State),
                answer => answer,
            }
        } else {
            let own = self.position(slot, index)?;
            let mut octets = self.all[own].octets.clone();
            machine.read(own, &mut octets);
            octets
        };
        octets.truncate(self.room.min(length.into()));
        let length = u8::try_from(octets.len()).expect("a record has at most 240 octets");
        answer.extend([function::READ, slot, index, length]);
        answer.append(&mut octets);
        Ok(())
    }

    fn write(
        &mut self,
        slot: u8,
        index: u8,
        data: &[u8],
        called: &mut Called,
        machine: &mut impl Machine,
    ) -> Result<(), Refusal> {
        if index == INDEX {
            self.check_slot(slot)?;
            called.part = None;
            called.part = Some((slot, self.identification.call(data)?));
            return Ok(());
        }
        if self.is_drive(index) {
            self.check_slot(slot)?;
            called.parameters.clear();
            called.parameters = drive::serve(
                data,
                &mut self.parameters,
                self.all.len(),
                self.room,
                machine,
            )?;
            return Ok(());
        }
        let own = self.position(slot, index)?;
        let record = &mut self.all[own];
        if !record.is_writable {
            return Err(Refusal::Access);
        }
        if record.octets.len() != data.len() {
            return Err(Refusal::Length);
        }
        record.octets.copy_from_slice(data);
        machine.written(own, data);
        Ok(())
    }

    /// True for the record with the parameters of a drive.
    fn is_drive(&self, index: u8) -> bool {
        index == drive::INDEX && !self.parameters.is_empty()
    }

    fn check_slot(&self, slot: u8) -> Result<(), Refusal> {
        (slot <= self.slots).then_some(()).ok_or(Refusal::Slot)
    }

    fn position(&self, slot: u8, index: u8) -> Result<usize, Refusal> {
        self.check_slot(slot)?;
        let mut all = self.all.iter();
        all.position(|own| (own.slot, own.index) == (slot, index))
            .ok_or(Refusal::Index)
    }
}
