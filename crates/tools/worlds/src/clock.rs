//! The clock of a simulated world, and the sockets that replace those of the system.

use std::fs::File;
use std::io::{self, ErrorKind};
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use tickbus_base::time::{
    Clock, Interest, Nanos, Ready, SimulatedListener, SimulatedSocket, SimulatedStream, Simulation,
    Stop,
};

use crate::scheduler::{self, network};

/// The clock of the world that runs on this thread.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SimulatedClock;

impl SimulatedClock {
    /// The clock, for a driver.
    pub(crate) fn shared() -> Arc<dyn Clock> {
        Arc::new(Self)
    }
}

impl Clock for SimulatedClock {
    fn now(&self) -> Nanos {
        scheduler::look()
    }

    fn wait_until(&self, deadline: Nanos, stop: &Stop) {
        if !stop.is_woken() {
            scheduler::wait(deadline, stop, Vec::new());
        }
    }

    fn wait_with(&self, deadline: Nanos, stop: &Stop, sleep: &mut dyn FnMut(Option<Duration>)) {
        self.wait_until(deadline, stop);
        sleep(Some(Duration::ZERO));
    }

    fn passes_alone(&self) -> bool {
        true
    }

    fn simulation(&self) -> Option<&dyn Simulation> {
        Some(self)
    }
}

impl Simulation for SimulatedClock {
    fn spawn(&self, _name: &str, body: Box<dyn FnOnce() + Send>) {
        scheduler::spawn(scheduler::process(), body);
    }

    fn wait_for(&self, limit: Nanos, done: &mut dyn FnMut() -> bool) -> bool {
        scheduler::wait_for(limit, done)
    }

    fn poll(
        &self,
        sockets: &[(usize, u64, Interest)],
        deadline: Nanos,
        stop: &Stop,
        ready: &mut Vec<Ready>,
    ) {
        let is_woken = stop.is_woken();
        network(|network, _, now| network.look(sockets, now, ready));
        if is_woken || !ready.is_empty() {
            return;
        }
        let sockets_alone = sockets.iter().map(|(_, id, interest)| (*id, *interest));
        scheduler::wait(deadline, stop, sockets_alone.collect());
        network(|network, _, now| network.look(sockets, now, ready));
    }

    fn listen(&self, addresses: &[SocketAddr]) -> io::Result<Box<dyn SimulatedListener>> {
        let process = scheduler::process();
        let id = network(|network, _, _| network.listen(process, addresses))?;
        Ok(Box::new(Socket(id)))
    }

    fn connect(&self, address: SocketAddr) -> io::Result<Box<dyn SimulatedStream>> {
        let process = scheduler::process();
        let id = network(|network, random, now| network.connect(address, process, now, random));
        Ok(Box::new(Socket(id)))
    }

    fn open_serial(&self, _device: &str) -> io::Result<Box<dyn SimulatedStream>> {
        let process = scheduler::process();
        let id = network(|network, _, now| network.open_serial(process, now));
        Ok(Box::new(SerialPort(id)))
    }

    fn write(&self, file: &File, path: &Path, bytes: &[u8]) -> io::Result<usize> {
        let process = scheduler::process();
        scheduler::disk(|disk, _| disk.write(process, file, path, bytes))
    }
}

/// A listener or a connection of the network.
#[derive(Debug)]
struct Socket(u64);

impl SimulatedSocket for Socket {
    fn identity(&self) -> u64 {
        self.0
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        network(|network, _, _| Ok(network.addresses(self.0)?.0))
    }
}

impl SimulatedListener for Socket {
    fn accept(&self) -> io::Result<(Box<dyn SimulatedStream>, SocketAddr)> {
        let (id, peer) = network(|network, _, now| network.accept(self.0, now))?;
        Ok((Box::new(Socket(id)), peer))
    }
}

impl SimulatedStream for Socket {
    fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        network(|network, _, now| network.read(self.0, buffer, now))
    }

    fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        let times = scheduler::awake_since();
        network(|network, random, _| network.write(self.0, bytes, times, random))
    }

    fn wait(&self, interest: Interest, limit: Nanos) -> bool {
        let sockets = [(0, self.0, interest)];
        let mut ready = Vec::new();
        let deadline = Nanos(scheduler::now().0.saturating_add(limit.0));
        SimulatedClock.poll(&sockets, deadline, &Stop::new(), &mut ready);
        !ready.is_empty()
    }

    fn shutdown_write(&self) -> io::Result<()> {
        network(|network, _, now| network.shut_down(self.0, now))
    }

    fn close_by_reset(&self) {
        network(|network, _, now| network.close_by_reset(self.0, now));
    }

    fn peer_addr(&self) -> io::Result<SocketAddr> {
        network(|network, _, _| Ok(network.addresses(self.0)?.1))
    }

    fn take_error(&self) -> io::Result<Option<io::Error>> {
        let error: Option<ErrorKind> = network(|network, _, _| network.take_error(self.0))?;
        Ok(error.map(io::Error::from))
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        network(|network, _, now| {
            network.close_listener(self.0, now);
            network.close(self.0, now);
        });
    }
}

/// A port of the serial line.
#[derive(Debug)]
struct SerialPort(u64);

impl SimulatedSocket for SerialPort {
    fn identity(&self) -> u64 {
        self.0
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        Err(ErrorKind::Unsupported.into())
    }
}

impl SimulatedStream for SerialPort {
    fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        network(|network, _, now| network.read_serial(self.0, buffer, now))
    }

    fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        let times = scheduler::awake_since();
        network(|network, random, _| network.write_serial(self.0, bytes, times, random))
    }

    fn wait(&self, _interest: Interest, _limit: Nanos) -> bool {
        true
    }

    fn shutdown_write(&self) -> io::Result<()> {
        Ok(())
    }

    fn close_by_reset(&self) {}

    fn peer_addr(&self) -> io::Result<SocketAddr> {
        Err(ErrorKind::Unsupported.into())
    }

    fn take_error(&self) -> io::Result<Option<io::Error>> {
        Ok(None)
    }
}

impl Drop for SerialPort {
    fn drop(&mut self) {
        network(|network, _, _| network.wire.close(self.0));
    }
}
