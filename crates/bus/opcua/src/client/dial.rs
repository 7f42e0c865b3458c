//! An existing TCP connection in the form in which the crate makes connections.

use std::net::TcpStream;
use std::sync::{Arc, Mutex, PoisonError};

use opcua::client::ConnectionSource;
use opcua::client::transport::{
    Connector, RequestRecv, SecureChannelState, StreamConnection, StreamConnector, StreamTransport,
    TransportConfiguration,
};
use opcua::core::comms::tcp_codec::TcpCodec;
use opcua::types::{DecodingOptions, EndpointDescription, Error, StatusCode};
use tokio::io::{ReadHalf, WriteHalf};
use tokio_util::codec::FramedRead;

type Reader = ReadHalf<tokio::net::TcpStream>;
type Writer = WriteHalf<tokio::net::TcpStream>;

/// Passes one connection to the crate, once. The bus makes and remakes the connection, as for all buses.
#[derive(Clone)]
pub(super) struct Dial {
    stream: Arc<Mutex<Option<TcpStream>>>,
    url: String,
}

impl Dial {
    /// A dial for the server at `url`, to which `stream` is connected.
    pub(super) fn new(stream: TcpStream, url: &str) -> Self {
        Self {
            stream: Arc::new(Mutex::new(Some(stream))),
            url: url.to_owned(),
        }
    }

    fn take(
        &self,
        url: String,
        options: DecodingOptions,
    ) -> Result<StreamConnection<Reader, Writer>, Error> {
        let mut stream = self.stream.lock().unwrap_or_else(PoisonError::into_inner);
        let lost = || {
            Error::new(
                StatusCode::BadConnectionClosed,
                "the connection was used up",
            )
        };
        let stream = stream.take().ok_or_else(lost)?;
        let stream = tokio::net::TcpStream::from_std(stream)
            .map_err(|error| Error::new(StatusCode::BadCommunicationError, error))?;
        let (reader, writer) = tokio::io::split(stream);
        let reader = FramedRead::new(reader, TcpCodec::new(options));
        Ok(StreamConnection::new(reader, writer, url))
    }
}

impl Connector for Dial {
    type Transport = StreamTransport<Reader, Writer>;

    async fn connect(
        &self,
        channel: Arc<SecureChannelState>,
        outgoing_recv: RequestRecv,
        config: TransportConfiguration,
    ) -> Result<Self::Transport, Error> {
        let take = |url, options| std::future::ready(self.take(url, options));
        let connector = StreamConnector::new(take, self.url.clone());
        connector.connect(channel, outgoing_recv, config).await
    }

    fn default_endpoint(&self) -> EndpointDescription {
        EndpointDescription::from(&*self.url)
    }
}

impl ConnectionSource for Dial {
    type Builder = Self;

    fn get_connector(&self, _: &EndpointDescription) -> Result<Self, Error> {
        Ok(self.clone())
    }
}
