//! The serial line of a simulated world, as PROFIBUS has it: each port hears all others, and the line stores nothing.

use std::collections::{BTreeMap, VecDeque};
use std::io::{self, ErrorKind};

use crate::delivery::Delivery;
use crate::random::Random;

/// The rate of the line, in bits per second.
pub(crate) const BAUD: u32 = 500_000;

/// The bits of a character: start bit, eight data bits, parity, stop bit.
const CHARACTER: u32 = 11;

/// The time that a number of bits takes.
pub(crate) fn bits(count: u32) -> i64 {
    i64::from(count) * 1_000_000_000 / i64::from(BAUD)
}

/// The time that so many characters take.
pub(crate) fn characters(count: usize) -> i64 {
    bits(CHARACTER * u32::try_from(count).expect("a telegram"))
}

/// The conditions on the line while a telegram is written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Conditions {
    /// The least and the greatest time until the characters can be read, beyond their own, in ns.
    pub(crate) latency: (i64, i64),
    /// One telegram in this many is damaged; 0 for none.
    pub(crate) damages: u64,
}

#[derive(Debug)]
struct Telegram {
    delivery: Delivery,
    /// In the code of marked characters.
    bytes: Vec<u8>,
}

#[derive(Debug)]
struct Port {
    process: usize,
    incoming: VecDeque<Telegram>,
    /// The adapter was unplugged.
    is_gone: bool,
}

/// All open ports of the line.
#[derive(Debug, Default)]
pub(crate) struct Wire {
    ports: BTreeMap<u64, Port>,
    /// The line is cut until then.
    cut_until: i64,
}

impl Wire {
    pub(crate) fn open(&mut self, id: u64, process: usize) {
        let port = Port {
            process,
            incoming: VecDeque::new(),
            is_gone: false,
        };
        self.ports.insert(id, port);
    }

    pub(crate) fn close(&mut self, id: u64) {
        self.ports.remove(&id);
    }

    /// The operating system closes the ports of a killed process.
    pub(crate) fn kill(&mut self, process: usize) {
        self.ports.retain(|_, port| port.process != process);
    }

    /// All adapters are unplugged, and plugged in again.
    pub(crate) fn unplug(&mut self) {
        self.ports.values_mut().for_each(|port| port.is_gone = true);
    }

    /// All characters are lost until `time`.
    pub(crate) fn cut(&mut self, time: i64) {
        self.cut_until = self.cut_until.max(time);
    }

    /// The time from which a port can be read; `None` if this is no port.
    pub(crate) fn readable_at(&self, id: u64) -> Option<i64> {
        let port = self.ports.get(&id)?;
        let first = port.incoming.front();
        Some(if port.is_gone {
            i64::MIN
        } else {
            first.map_or(i64::MAX, |telegram| telegram.delivery.at)
        })
    }

    /// Reads the characters that have arrived by `now`, and adds their deliveries.
    pub(crate) fn read(
        &mut self,
        id: u64,
        buffer: &mut [u8],
        now: i64,
        deliveries: &mut BTreeMap<usize, Vec<Delivery>>,
    ) -> io::Result<usize> {
        let port = self.ports.get_mut(&id).ok_or(ErrorKind::NotConnected)?;
        if port.is_gone {
            return Ok(0);
        }
        let mut count = 0;
        while let Some(telegram) = port.incoming.front()
            && telegram.delivery.at <= now
            && count + telegram.bytes.len() <= buffer.len()
        {
            let telegram = port.incoming.pop_front().expect("it was just found");
            buffer[count..count + telegram.bytes.len()].copy_from_slice(&telegram.bytes);
            count += telegram.bytes.len();
            deliveries
                .entry(port.process)
                .or_default()
                .push(telegram.delivery);
        }
        if count == 0 {
            return Err(ErrorKind::WouldBlock.into());
        }
        Ok(count)
    }

    /// Sends a telegram to all other ports.
    pub(crate) fn write(
        &mut self,
        id: u64,
        bytes: &[u8],
        (now, sent): (i64, i64),
        conditions: Conditions,
        random: &mut Random,
    ) -> io::Result<usize> {
        let port = self.ports.get(&id).ok_or(ErrorKind::NotConnected)?;
        if port.is_gone {
            return Err(ErrorKind::BrokenPipe.into());
        }
        let from = port.process;
        let (least, most) = conditions.latency;
        let is_damaged = conditions.damages > 0 && random.once_in(conditions.damages);
        let marked = marked(bytes, is_damaged, random);
        let arrival = now + characters(bytes.len()) + random.within(least, most);
        if arrival < self.cut_until {
            return Ok(bytes.len());
        }
        for (_, other) in self.ports.iter_mut().filter(|(other, _)| **other != id) {
            let last = other.incoming.back();
            let last = last.map_or(i64::MIN, |telegram| telegram.delivery.at);
            let delivery = Delivery {
                at: arrival.max(last),
                sent,
                from,
                is_whole: !is_damaged,
            };
            other.incoming.push_back(Telegram {
                delivery,
                bytes: marked.clone(),
            });
        }
        Ok(bytes.len())
    }
}

/// The characters in the code of [`Marks`](tickbus_base::os::Marks). In a damaged telegram one of them has wrong parity,
/// or another value.
fn marked(bytes: &[u8], is_damaged: bool, random: &mut Random) -> Vec<u8> {
    let place = if is_damaged {
        usize::try_from(random.below(bytes.len() as u64)).expect("a length")
    } else {
        usize::MAX
    };
    let has_wrong_parity = is_damaged && random.once_in(2);
    let mut marked = Vec::with_capacity(bytes.len() + 2);
    for (index, byte) in bytes.iter().enumerate() {
        match byte {
            byte if index == place && has_wrong_parity => marked.extend([0xFF, 0x00, *byte]),
            byte if index == place => marked.push(if *byte == 0xFE { 0x01 } else { byte ^ 0x01 }),
            0xFF => marked.extend([0xFF, 0xFF]),
            byte => marked.push(*byte),
        }
    }
    marked
}
