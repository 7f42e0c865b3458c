//! The room itself: its address and its thread.

use std::fmt;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tickbus_base::time::{Clock, Nanos};
use tickbus_net::{Address, bind, prepare};
use tokio::net::TcpStream;
use tokio::sync::oneshot;

use crate::feeds::Feeds;
use crate::guard::Guard;
use crate::invitation::Invitation;
use crate::pages::Pages;
use crate::patient::Patient;
use crate::seats::Seats;
use crate::serve::{Hall, answer};
use crate::token;

/// The longest head of a request, in bytes: four times what a browser sends.
const HEAD: usize = 16 * 1024;

/// The pause in accepting after the system had no free socket.
const PAUSE: Duration = Duration::from_millis(100);

/// The limits that keep the room available.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Connections at a time; further ones are closed at once.
    pub connections: usize,
    /// Connections at a time of one computer.
    pub per_computer: usize,
    /// The time for a request to arrive, and the time that a viewer may read nothing.
    pub patience: Duration,
}

impl Default for Limits {
    /// 512 connections, 256 of one computer, 20 s.
    fn default() -> Self {
        Self {
            connections: 512,
            per_computer: 256,
            patience: Duration::from_secs(20),
        }
    }
}

/// A listening address, and its token.
pub struct Room {
    listener: TcpListener,
    address: SocketAddr,
    guard: Guard,
    host: String,
    limits: Limits,
}

impl fmt::Debug for Room {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Room")
            .field("address", &self.address)
            .finish_non_exhaustive()
    }
}

impl Room {
    /// Listens; port 0 lets the system choose one.
    ///
    /// # Errors
    ///
    /// The host is unknown, or the address cannot be listened on.
    pub fn bind(address: &Address, limits: Limits) -> io::Result<Self> {
        let (listener, bound) = bind(address, None)?;
        let host = if bound.ip().is_unspecified() {
            // Not an address to open.
            "localhost".to_owned()
        } else {
            address.host.to_string()
        };
        Ok(Self {
            listener: listener.into_os()?,
            address: bound,
            guard: Guard::new(&host)?,
            host,
            limits,
        })
    }

    /// Takes the token from this file, so that an opened address stays valid after a restart. A missing file is
    /// created, readable only by its owner.
    ///
    /// # Errors
    ///
    /// The file cannot be read or created, contains no token, or is readable by other users.
    pub fn keep_token(&mut self, file: &Path) -> io::Result<()> {
        let kept = token::kept(file, self.guard.token()).map_err(|error| {
            let file = file.display();
            io::Error::new(error.kind(), format!("{file}: {error}"))
        })?;
        self.guard.set_token(kept);
        Ok(())
    }

    /// The address on which it listens.
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// The URL for a browser, with the token. A browser sends the part after `#` to nobody.
    pub fn url(&self) -> String {
        let port = self.address.port();
        format!("http://{}:{port}/#token={}", self.host, self.guard.token())
    }

    /// The ways in which other devices open this URL.
    pub fn invitation(&self) -> Invitation {
        Invitation::new(self.url(), self.address)
    }

    /// Serves these pages, in a separate thread, until the returned value is dropped.
    ///
    /// # Errors
    ///
    /// The system could not start a thread, or cannot wait for sockets.
    pub fn serve(self, pages: Pages, clock: Arc<dyn Clock>) -> io::Result<Serving> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build()?;
        let (stop, stopped) = oneshot::channel();
        let thread = thread::Builder::new()
            .name("web".to_owned())
            .spawn(move || {
                let limits = self.limits;
                let hall = Arc::new(Hall {
                    guard: self.guard,
                    feeds: Feeds::new(pages.clone(), clock),
                    pages,
                    patience: limits.patience,
                    holders: AtomicUsize::new(0),
                });
                runtime.block_on(async {
                    tokio::select! {
                        () = accept(self.listener, &hall, limits) => {}
                        _ = stopped => {}
                    }
                });
            })?;
        Ok(Serving {
            stop: Some(stop),
            thread: Some(thread),
        })
    }
}

/// Pages being served; dropping it ends that.
#[derive(Debug)]
pub struct Serving {
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Serving {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            // A panic has been reported already.
            let _ = thread.join();
        }
    }
}

/// Makes the system send at once, and give up a peer that confirms nothing.
fn prepared(stream: TcpStream, patience: Duration) -> io::Result<TcpStream> {
    let stream = stream.into_std()?;
    let patience = i64::try_from(patience.as_nanos()).map_or(Nanos::MAX, Nanos);
    prepare(&stream, patience)?;
    TcpStream::from_std(stream)
}

async fn accept(listener: TcpListener, hall: &Arc<Hall>, limits: Limits) {
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else {
        return;
    };
    let mut seats = Seats::new(limits.connections, limits.per_computer);
    loop {
        let Ok((stream, peer)) = listener.accept().await else {
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        let Some(seat) = seats.take(peer.ip()) else {
            continue;
        };
        // A viewer whose computer has silently gone must not count as present.
        let Ok(stream) = prepared(stream, limits.patience) else {
            continue;
        };
        let hall = Arc::clone(hall);
        tokio::spawn(async move {
            let service = service_fn(|request| answer(&hall, request));
            let stream = TokioIo::new(Patient::new(stream, limits.patience));
            // The way in which a browser hangs up does not matter.
            let _ = http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(limits.patience)
                .max_buf_size(HEAD)
                .serve_connection(stream, service)
                .await;
            drop(seat);
        });
    }
}
