//! A bare hub: it passes whole lines from each odd connection on to the next one, and does nothing else.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::thread;

use rustix::buffer::spare_capacity;
use rustix::event::epoll::{self, CreateFlags, Event, EventData, EventFlags};

struct Client {
    stream: TcpStream,
    /// The beginning of a line, and how long it is.
    begun: Vec<u8>,
}

/// Starts the hub; it ends with the process.
pub(crate) fn start() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("it is bound");
    thread::spawn(move || serve(&listener));
    address
}

fn serve(listener: &TcpListener) {
    const LISTENER: u64 = u64::MAX;

    let poll = epoll::create(CreateFlags::CLOEXEC).expect("a descriptor");
    let watch = |key, stream: &dyn rustix::fd::AsFd| {
        let data = EventData::new_u64(key);
        epoll::add(&poll, stream, data, EventFlags::IN).expect("it can be waited for");
    };
    watch(LISTENER, listener);
    let mut clients: Vec<Client> = Vec::new();
    let mut events: Vec<Event> = Vec::with_capacity(256);
    let mut buffer = vec![0; 64 * 1024];
    loop {
        events.clear();
        epoll::wait(&poll, spare_capacity(&mut events), None).expect("it waits");
        for event in &events {
            let data = event.data;
            if data.u64() == LISTENER {
                let (stream, _) = listener.accept().expect("it connects");
                stream.set_nodelay(true).expect("a TCP option");
                watch(clients.len() as u64, &stream);
                let begun = Vec::new();
                clients.push(Client { stream, begun });
                continue;
            }
            let at = usize::try_from(data.u64()).expect("an index");
            let client = &mut clients[at];
            let start = client.begun.len();
            buffer[..start].copy_from_slice(&client.begun);
            client.begun.clear();
            let Ok(count @ 1..) = client.stream.read(&mut buffer[start..]) else {
                let _ = epoll::delete(&poll, &client.stream);
                continue;
            };
            let all = &buffer[..start + count];
            let lines = all
                .iter()
                .rposition(|byte| *byte == b'\n')
                .map_or(0, |end| end + 1);
            client.begun.extend_from_slice(&all[lines..]);
            let mut sink = &clients[at + 1].stream;
            sink.write_all(&all[..lines]).expect("the client reads");
        }
    }
}
