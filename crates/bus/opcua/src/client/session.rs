//! An open session: received values go into the image, changed ones are written.

use std::sync::Arc;

use opcua::client::Session;
use opcua::types::NodeId;

use crate::looks::TaskLooks;
use crate::pki::meaning;
use crate::reactor::{Inbox, Reactor};
use tickbus_base::time::{Nanos, Pace, Stop};
use tickbus_fieldbus::{BusError, PlcState, Port};
use tickbus_image::signal::SignalTable;

use super::Field;
use super::feed::Notification;
use super::readings::Readings;
use super::writings::Writings;

/// An open session and its state.
pub(super) struct ClientSession<'a> {
    pub(super) session: Arc<Session>,
    pub(super) reactor: &'a Reactor,
    pub(super) inbox: Inbox<Notification>,
    pub(super) fields: &'a [Field],
    pub(super) table: &'a SignalTable,
    pub(super) nodes: Vec<NodeId>,
    pub(super) readings: Readings,
    /// `None` while writing is not permitted.
    pub(super) writings: Option<Writings>,
    /// The most values of one Write; 0 for no limit.
    pub(super) most_writes: usize,
    pub(super) cycle: Nanos,
    /// The reason shown while the line is running.
    pub(super) running: String,
}

impl ClientSession<'_> {
    /// Serves the session until `stop`.
    ///
    /// # Errors
    ///
    /// Why the session has ended.
    pub(super) fn serve(mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let clock = Arc::clone(port.clock());
        let mut pace = Pace::new(clock.now(), self.cycle);
        let (mut news, mut looks) = (Vec::new(), TaskLooks::new());
        port.begin_to_look(clock.now());
        // The last reported trouble with values; `None` for none.
        let mut said = None;
        while !stop.is_stopped() {
            let now = clock.now();
            looks.look(port, now);
            self.inbox.take(&mut news);
            for news in news.drain(..) {
                self.hear(port, now, news)?;
            }
            let trouble = self.readings.trouble(self.fields);
            let can_tell = trouble.is_some() || self.readings.is_complete();
            if can_tell && said.as_ref() != Some(&trouble) {
                match &trouble {
                    Some(trouble) => {
                        let error = BusError::Link(trouble.clone());
                        port.lost(&error, "it continues when there is one");
                    }
                    None => port.running(&self.running),
                }
                said = Some(trouble);
            }
            if pace.take(now) {
                self.write(port, now);
            }
            port.observe(now);
            self.reactor
                .wait(&*clock, pace.due().min(port.due()).min(port.next_look()));
        }
        Ok(())
    }

    fn hear(&mut self, port: &mut Port, now: Nanos, news: Notification) -> Result<(), BusError> {
        match news {
            Notification::Values(values) => self.readings.take(port, now, self.fields, &values)?,
            Notification::Alive => self.readings.touch(port, now),
            Notification::Plc(state) => {
                for station in 0..port.stations() {
                    port.plc_state(station, now, state);
                }
                // Values that did not change during the stop are not reported again; they are valid from now on.
                if state == PlcState::Run {
                    self.readings.commit(port, now, self.fields);
                }
            }
            Notification::Written(answer) => {
                if let Some(writings) = &mut self.writings {
                    writings.answered(port, self.table, &answer?);
                }
            }
            Notification::Ended(error) => return Err(error),
        }
        Ok(())
    }

    /// Writes changed values, unless an answer is pending: one Write at a time.
    fn write(&mut self, port: &mut Port, now: Nanos) {
        let Some(writings) = &mut self.writings else {
            return;
        };
        if writings.is_under_way() {
            return;
        }
        let values = writings.due(port, now, self.fields, &self.nodes);
        if values.is_empty() {
            return;
        }
        let (session, inbox) = (Arc::clone(&self.session), self.inbox.clone());
        let most = match self.most_writes {
            0 => values.len(),
            most => most,
        };
        self.reactor.spawn(async move {
            let mut statuses = Vec::new();
            for part in values.chunks(most) {
                match session.write(part).await {
                    Ok(more) => statuses.extend(more),
                    Err(error) => {
                        let why = meaning(error.status());
                        let error =
                            BusError::Link(format!("the server did not answer a Write ({why})"));
                        inbox.push(Notification::Written(Err(error)));
                        return;
                    }
                }
            }
            inbox.push(Notification::Written(Ok(statuses)));
        });
    }
}
