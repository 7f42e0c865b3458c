//! Sessions that are driven on connections that block.

use super::super::{ClientSession, ConnectionParameters, End, FrameFields, SessionEvent};
use crate::Tsap;
use crate::length::LONGEST;
use crate::szl::Identity;
use tickbus_fieldbus::PlcState;
use tickbus_fieldbus::examine::{Peer, Wire, WireEnd};

/// The racks and slots of CPUs: S7-1200 and S7-1500, S7-300, software controllers, S7-400.
pub(in crate::client) const SLOTS: [(u8, u8); 4] = [(0, 1), (0, 2), (0, 0), (0, 3)];

/// Why a conversation ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::client) enum Miss {
    Wire(WireEnd),
    Session(End),
}

/// A session on a connection that blocks.
pub(in crate::client) struct Talk {
    wire: Wire,
    pub(in crate::client) session: ClientSession,
    pub(in crate::client) peer: Peer,
}

impl Talk {
    /// A session with the peer at these ends, which transfers these fields.
    pub(in crate::client) fn new(
        wire: Wire,
        peer: &Peer,
        fields: &FrameFields,
        (calling, called): (Tsap, Tsap),
        pdu: u16,
        asks_who: bool,
    ) -> Self {
        let terms = ConnectionParameters {
            calling,
            called,
            pdu,
            patience: peer.patience(),
            asks_who,
        };
        Self {
            wire,
            session: fields.session(terms, peer.now()),
            peer: peer.clone(),
        }
    }

    /// Ends the connection: a CPU has few of them.
    pub(in crate::client) fn hang_up(&self) {
        self.wire.hang_up();
    }

    /// Waits for the session's next news.
    fn news(&mut self) -> Result<SessionEvent, Miss> {
        let mut bytes = Vec::new();
        loop {
            let heard = self.session.hear(self.peer.now(), &bytes);
            if let Some(news) = heard.map_err(Miss::Session)? {
                return Ok(news);
            }
            bytes.clear();
            let out = self.session.to_write().to_vec();
            if !out.is_empty() {
                self.wire.send(&out).map_err(Miss::Wire)?;
                self.session.wrote(out.len());
            }
            let deadline = self.wire.deadline();
            self.wire
                .receive(&mut bytes, deadline)
                .map_err(Miss::Wire)?;
        }
    }

    /// The agreed length of a PDU, and the identity.
    pub(in crate::client) fn meet(&mut self) -> Result<(u16, Option<Identity>), Miss> {
        match self.news()? {
            SessionEvent::Met(length, identity) => Ok((length, identity)),
            _ => Ok((0, None)),
        }
    }

    /// Reads all fields of the session.
    pub(in crate::client) fn read(&mut self) -> Result<(), Miss> {
        if self.session.begin(self.peer.now()).is_none() {
            self.news()?;
        }
        Ok(())
    }

    /// The operating state, if the CPU reports it.
    pub(in crate::client) fn state(&mut self) -> Result<Option<PlcState>, Miss> {
        self.session.ask_state(self.peer.now());
        match self.news()? {
            SessionEvent::State(state) => Ok(state),
            _ => Ok(None),
        }
    }
}

/// A short conversation with another end; the length of a PDU, and the identity.
pub(in crate::client) fn meets(peer: &Peer, ends: (Tsap, Tsap)) -> Option<(u16, Option<Identity>)> {
    let fields = FrameFields {
        lengths: vec![[0, 0]],
        ..FrameFields::default()
    };
    let mut talk = Talk::new(peer.dial().ok()?, peer, &fields, ends, LONGEST, false);
    talk.meet().ok()
}
