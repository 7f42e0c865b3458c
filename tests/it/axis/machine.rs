//! A driver as the machine, and a PLC that is a bare TCP client.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use tickbus::driver::Driver;
use tickbus::signal::Slot;
use tickbus::time::{Monotonic, Nanos};
use tickbus_conformance::rig::Looks;
use tickbus_test_log as logged;

use crate::axis::parse;

/// A machine whose driver listens, and a PLC that is a bare TCP client.
pub(crate) struct Pair {
    pub(crate) machine: Machine,
    pub(crate) plc: TcpStream,
    pub(crate) outputs: Vec<u8>,
    pub(crate) inputs: Vec<u8>,
}

/// An open driver, ticked by the test.
pub(crate) struct Machine {
    pub(crate) driver: Driver,
    pub(crate) slots: Vec<Slot>,
    pub(crate) ticks: i64,
    _logged: logged::Watch,
}

impl Machine {
    pub(crate) fn new(text: &str) -> Self {
        let logged = logged::Watch::new();
        let driver = Driver::open(parse(text), Monotonic::shared()).expect("opens");
        Self {
            slots: driver.initial_slots(),
            driver,
            ticks: 0,
            _logged: logged,
        }
    }

    pub(crate) fn statistic(&self, key: &str) -> Option<String> {
        let statistics = self.driver.statistics();
        let mut lines = statistics.lines();
        lines.find_map(|line| Some(line.strip_prefix(key)?.strip_prefix('=')?.to_owned()))
    }

    /// Connects to each address on which the driver listens.
    pub(crate) fn clients(&self, count: usize) -> Vec<TcpStream> {
        let begun = Instant::now();
        let addresses = loop {
            let told = self.statistic("address").unwrap_or_default();
            let addresses: Vec<String> = told.split_whitespace().map(str::to_owned).collect();
            if addresses.len() == count {
                break addresses;
            }
            assert!(begun.elapsed() < Duration::from_secs(10), "{told}");
            std::thread::yield_now();
        };
        addresses.iter().map(client).collect()
    }

    pub(crate) fn place(&self, name: &str) -> usize {
        let place = self.driver.config().table.position(name);
        place.unwrap_or_else(|| panic!("{name}"))
    }

    pub(crate) fn get(&self, name: &str) -> f64 {
        self.slots[self.place(name)].real()
    }

    pub(crate) fn set(&mut self, name: &str, value: f64) {
        let place = self.place(name);
        self.slots[place] = Slot::from_real(value);
    }

    pub(crate) fn tick(&mut self) {
        self.ticks += 1;
        self.driver
            .exchange(Nanos::from_millis(self.ticks), &mut self.slots);
    }

    #[track_caller]
    pub(crate) fn until(&mut self, what: &str, is: impl Fn(&Self) -> bool) {
        let begun = Instant::now();
        let mut looks = Looks::default();
        while !is(self) {
            assert!(begun.elapsed() < Duration::from_secs(20), "{what}");
            self.tick();
            looks.pause();
        }
    }
}

pub(crate) fn client(address: &String) -> TcpStream {
    let plc = TcpStream::connect(address).expect("it listens");
    plc.set_nodelay(true).expect("a socket");
    plc.set_read_timeout(Some(Duration::from_secs(10)))
        .expect("a socket");
    plc
}

impl Pair {
    pub(crate) fn new(axes: &str) -> Self {
        let machine = Machine::new(&format!(
            "[driver]\nid = 1\nname = \"axes\"\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\
             cycle = \"2ms\"\n{axes}"
        ));
        let station = &machine.driver.config().table.stations[0];
        Self {
            outputs: vec![0; station.output_bytes],
            inputs: vec![0; station.input_bytes],
            plc: machine.clients(1).remove(0),
            machine,
        }
    }

    pub(crate) fn get(&self, name: &str) -> f64 {
        self.machine.get(name)
    }

    pub(crate) fn set(&mut self, name: &str, value: f64) {
        self.machine.set(name, value);
    }

    /// The PLC sends its outputs and receives a record; the machine ticks.
    pub(crate) fn turn(&mut self) {
        self.plc
            .write_all(&self.outputs)
            .expect("the machine reads");
        self.plc
            .read_exact(&mut self.inputs)
            .expect("the machine sends");
        self.machine.tick();
    }

    #[track_caller]
    pub(crate) fn until(&mut self, what: &str, is: impl Fn(&Self) -> bool) {
        let begun = Instant::now();
        while !is(self) {
            assert!(
                begun.elapsed() < Duration::from_secs(20),
                "{what}: {:?}",
                self.inputs
            );
            self.turn();
        }
    }
}
