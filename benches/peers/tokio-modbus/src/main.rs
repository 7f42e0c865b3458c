//! A tokio-modbus server, for comparison: 2,048 holding registers. It prints its address and serves until its
//! stdin ends.

use std::future::{Ready, ready};
use std::io::Read as _;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};

use tokio::net::TcpListener;
use tokio_modbus::server::Service;
use tokio_modbus::server::tcp::{Server, accept_tcp_connection};
use tokio_modbus::{ExceptionCode, Request, Response};

struct Registers(Mutex<Vec<u16>>);

impl Service for Registers {
    type Request = Request<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Response, ExceptionCode>>;

    fn call(&self, request: Self::Request) -> Self::Future {
        let mut registers = self.0.lock().expect("nobody panics with it");
        ready(match request {
            Request::ReadWriteMultipleRegisters(from, count, to, values) => {
                let to = usize::from(to);
                registers[to..to + values.len()].copy_from_slice(&values);
                let from = usize::from(from);
                let read = registers[from..from + usize::from(count)].to_vec();
                Ok(Response::ReadWriteMultipleRegisters(read))
            }
            _ => Err(ExceptionCode::IllegalFunction),
        })
    }
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> std::io::Result<()> {
    let listener = TcpListener::bind("127.0.0.1:0").await?;
    println!("{}", listener.local_addr()?);
    std::thread::spawn(|| {
        let _ = std::io::stdin().read(&mut [0]);
        std::process::exit(0);
    });
    let registers = Arc::new(Registers(Mutex::new(vec![0; 2048])));
    let service = |_: SocketAddr| Ok(Some(Arc::clone(&registers)));
    let connected = |stream: tokio::net::TcpStream, address| async move {
        stream.set_nodelay(true)?;
        accept_tcp_connection(stream, address, service)
    };
    Server::new(listener)
        .serve(&connected, |error| eprintln!("{error}"))
        .await
}
