//! A hand-written PLC that is a Modbus server: four separate tables, and the quirks of real devices.

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// The behaviour of a device for a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Habit {
    Answers,
    Refuses(u8),
    Ignores,
    HangsUp,
}

/// How the unit with this number handles a function.
pub type Habits = fn(unit: u8, function: u8) -> Habit;

/// The memory, the same for all units: coils, discrete inputs, input registers, holding registers.
#[derive(Debug)]
pub struct Memory {
    pub bits: [Vec<bool>; 2],
    pub registers: [Vec<u16>; 2],
    /// Unit and function of each request.
    pub asked: Vec<(u8, u8)>,
    /// The results of function 22 on registers, one after another.
    pub masked: Vec<u16>,
}

pub struct Plc {
    pub address: SocketAddr,
    pub memory: Arc<Mutex<Memory>>,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Plc {
    /// Initially every register is 0xA5A5, and every other bit is on.
    pub fn start(habits: Habits) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        let bits = || (0..2000).map(|bit| bit % 2 == 0).collect();
        let memory = Arc::new(Mutex::new(Memory {
            bits: [bits(), bits()],
            registers: [vec![0xA5A5; 2000], vec![0xA5A5; 2000]],
            asked: Vec::new(),
            masked: Vec::new(),
        }));
        let over = Arc::new(AtomicBool::new(false));
        let thread = std::thread::spawn({
            let (memory, over) = (Arc::clone(&memory), Arc::clone(&over));
            move || {
                for stream in listener.incoming() {
                    if over.load(Ordering::Relaxed) {
                        return;
                    }
                    serve(stream.expect("a connection"), &memory, habits);
                }
            }
        });
        Self {
            address,
            memory,
            over,
            thread: Some(thread),
        }
    }

    pub fn with<R>(&self, look: impl FnOnce(&mut Memory) -> R) -> R {
        look(&mut self.memory.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// The driver must be closed first.
impl Drop for Plc {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        let _ = TcpStream::connect(self.address);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("the PLC did not panic");
        }
    }
}

fn serve(mut stream: TcpStream, memory: &Mutex<Memory>, habits: Habits) {
    let mut header = [0; 7];
    while stream.read_exact(&mut header).is_ok() {
        let mut pdu = vec![0; usize::from(u16::from_be_bytes([header[4], header[5]])) - 1];
        if stream.read_exact(&mut pdu).is_err() {
            return;
        }
        let (unit, function) = (header[6], pdu[0]);
        let mut memory = memory.lock().unwrap_or_else(PoisonError::into_inner);
        memory.asked.push((unit, function));
        let answer = match habits(unit, function) {
            Habit::Answers => act(&pdu, &mut memory).unwrap_or(vec![function | 0x80, 2]),
            Habit::Refuses(exception) => vec![function | 0x80, exception],
            Habit::Ignores => continue,
            Habit::HangsUp => {
                let _ = stream.shutdown(Shutdown::Both);
                return;
            }
        };
        drop(memory);
        let length = u16::try_from(answer.len() + 1).expect("it is short");
        let mut telegram = header.to_vec();
        telegram[4..6].copy_from_slice(&length.to_be_bytes());
        telegram.extend(answer);
        if stream.write_all(&telegram).is_err() {
            return;
        }
    }
}

fn act(pdu: &[u8], memory: &mut Memory) -> Option<Vec<u8>> {
    if !matches!(pdu[0], 1..=6 | 15 | 16 | 22) {
        return Some(vec![pdu[0] | 0x80, 1]);
    }
    let word = |at: usize| u16::from_be_bytes([pdu[at], pdu[at + 1]]);
    let (first, second) = (usize::from(word(1)), word(3));
    let span = first..first + usize::from(second);
    let echo = Some(pdu[..pdu.len().min(5)].to_vec());
    match pdu[0] {
        function @ (1 | 2) => {
            let bits = memory.bits[usize::from(function - 1)].get(span)?;
            let byte = |bits: &[bool]| {
                bits.iter()
                    .rev()
                    .fold(0, |byte, bit| byte << 1 | u8::from(*bit))
            };
            let bytes: Vec<u8> = bits.chunks(8).map(byte).collect();
            Some(
                [
                    &[function, u8::try_from(bytes.len()).ok()?],
                    bytes.as_slice(),
                ]
                .concat(),
            )
        }
        function @ (3 | 4) => {
            let table = usize::from(function != 4);
            let registers = memory.registers[table].get(span)?;
            let bytes: Vec<u8> = registers.iter().flat_map(|r| r.to_be_bytes()).collect();
            Some(
                [
                    &[function, u8::try_from(bytes.len()).ok()?],
                    bytes.as_slice(),
                ]
                .concat(),
            )
        }
        5 => {
            *memory.bits[0].get_mut(first)? = second == 0xFF00;
            echo
        }
        6 => {
            *memory.registers[1].get_mut(first)? = second;
            echo
        }
        15 => {
            for (n, bit) in memory.bits[0].get_mut(span)?.iter_mut().enumerate() {
                *bit = pdu[6 + n / 8] >> (n % 8) & 1 == 1;
            }
            echo
        }
        16 => {
            for (n, register) in memory.registers[1].get_mut(span)?.iter_mut().enumerate() {
                *register = word(6 + 2 * n);
            }
            echo
        }
        _ => {
            let register = memory.registers[1].get_mut(first)?;
            let (and, or) = (second, word(5));
            *register = (*register & and) | (or & !and);
            let masked = *register;
            memory.masked.push(masked);
            Some(pdu.to_vec())
        }
    }
}
