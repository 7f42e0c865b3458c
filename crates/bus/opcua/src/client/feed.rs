//! The server's own reports: a subscription.

use std::sync::Arc;

use opcua::client::{MonitoredItemMap, OnSubscriptionNotificationCore, Session};
use opcua::types::{
    DataChangeNotification, DataValue, Error, MonitoredItemCreateRequest, MonitoringMode,
    MonitoringParameters, NodeId, NotificationMessage, ServerState, StatusChangeNotification,
    StatusCode, TimestampsToReturn, VariableId, Variant,
};

use crate::pki::meaning;
use crate::reactor::Inbox;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::{BusError, PlcState};

use super::Field;

/// The most items in one call; every server accepts this many.
const CHUNK: usize = 100;

/// The number of changes of a latched signal that are queued between two publishes.
const QUEUE: u32 = 10;

/// How long the server keeps a subscription without requests.
const LIFE: Nanos = Nanos::from_secs(30);

/// News from the server.
#[derive(Debug)]
pub(super) enum Notification {
    /// The values of one publish, in order, with the indices of their signals.
    Values(Vec<(usize, DataValue)>),
    /// A publish without values: nothing has changed.
    Alive,
    /// The operating state of the PLC.
    Plc(PlcState),
    /// The answer to a Write: one status per value, or why there is no answer.
    Written(Result<Vec<StatusCode>, BusError>),
    /// The session is over.
    Ended(BusError),
}

/// How often the server samples and publishes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rhythm {
    pub(super) publishing: Nanos,
    /// `None`: the publishing interval, and for latched signals the shortest that the server supports.
    pub(super) sampling: Option<Nanos>,
    pub(super) max_age: Nanos,
}

/// Receives notifications, each as a whole.
struct Feed(Inbox<Notification>);

impl OnSubscriptionNotificationCore for Feed {
    fn on_subscription_notification(
        &mut self,
        notification: NotificationMessage,
        _items: MonitoredItemMap<'_>,
    ) {
        let mut values = Vec::new();
        for data in notification.notification_data.into_iter().flatten() {
            if let Some(ended) = data.inner_as::<StatusChangeNotification>() {
                let why = meaning(ended.status);
                let error = BusError::Left(format!("the server ended the subscription ({why})"));
                self.0.push(Notification::Ended(error));
            } else if let Some(data) = data.into_inner_as::<DataChangeNotification>() {
                for item in data.monitored_items.into_iter().flatten() {
                    if item.client_handle == STATE {
                        self.0.extend(state(&item.value).map(Notification::Plc));
                    } else {
                        values.push((signal(item.client_handle), item.value));
                    }
                }
            }
        }
        self.0.push(if values.is_empty() {
            Notification::Alive
        } else {
            Notification::Values(values)
        });
    }
}

/// The client handle of the item that is not a signal: the state of the server.
const STATE: u32 = u32::MAX;

/// The PLC's operating state according to `Server_ServerStatus_State`; `None` if there is no value yet. A server that
/// does not report its state, or does not know it, is assumed to run, even if an earlier server at this address
/// reported a stop. The outputs of a server in test mode have no effect, like those of a suspended one (OPC 10000-5,
/// 12.6).
pub(super) fn state(value: &DataValue) -> Option<PlcState> {
    const RUNNING: i32 = ServerState::Running as i32;
    const UNKNOWN: i32 = ServerState::Unknown as i32;
    match value.value {
        _ if value.status() == StatusCode::BadWaitingForInitialData => None,
        _ if value.status().is_bad() => Some(PlcState::Run),
        Some(Variant::Int32(RUNNING | UNKNOWN)) => Some(PlcState::Run),
        Some(Variant::Int32(_)) => Some(PlcState::Stop),
        _ => Some(PlcState::Run),
    }
}

/// The client handle of an item is the signal's index, from 1.
fn handle(signal: usize) -> u32 {
    u32::try_from(signal + 1).expect("tables hold fewer than 2^32 signals")
}

fn signal(handle: u32) -> usize {
    (handle as usize).wrapping_sub(1)
}

/// Subscribes to the signals that are read; `nodes` has the node of each signal of the table. Returns the
/// publishing interval as revised by the server.
pub(super) async fn subscribe(
    session: &Arc<Session>,
    fields: &[Field],
    nodes: &[NodeId],
    rhythm: Rhythm,
    inbox: Inbox<Notification>,
) -> Result<Nanos, BusError> {
    let interval = rhythm.publishing;
    // Three signs of life within `max_age`.
    let quiet = count(Nanos(rhythm.max_age.0 / 3), interval).max(1);
    let life = count(LIFE, interval).max(quiet.saturating_mul(3));
    let id = session
        .create_subscription(
            interval.to_duration(),
            life,
            quiet,
            0,
            0,
            true,
            Feed(inbox.clone()),
        )
        .await
        .map_err(|error| no_subscription(&error))?;
    let (revised, quiet) = revised(session, id, (interval, quiet));
    if revised.times(quiet.into()) > rhythm.max_age {
        log::warn!(
            "the server publishes every {revised} and is silent for up to {quiet} times that; with max_age = \
             {} its data become stale in between",
            rhythm.max_age
        );
    }
    // Before the values, which are invalid while the server is not running.
    watch_state(session, id, interval, &inbox).await?;
    let read: Vec<usize> = (0..fields.len())
        .filter(|index| fields[*index].is_read)
        .collect();
    for chunk in read.chunks(CHUNK) {
        let requests = chunk.iter().map(|&index| {
            let latched = fields[index].latched;
            let sampling = match rhythm.sampling {
                Some(stated) => stated.as_micros() / 1e3,
                None if latched => 0.0,
                None => interval.as_micros() / 1e3,
            };
            MonitoredItemCreateRequest::new(
                nodes[index].clone().into(),
                MonitoringMode::Reporting,
                MonitoringParameters {
                    client_handle: handle(index),
                    sampling_interval: sampling,
                    queue_size: if latched { QUEUE } else { 1 },
                    discard_oldest: true,
                    ..MonitoringParameters::default()
                },
            )
        });
        let made = session
            .create_monitored_items(id, TimestampsToReturn::Both, requests.collect())
            .await
            .map_err(|error| no_subscription(&error))?;
        for (&index, made) in chunk.iter().zip(&made) {
            let status = made.result.status_code;
            if status.is_bad() {
                let Field { name, node, .. } = &fields[index];
                return Err(BusError::Refused(format!(
                    "the server does not report \"{name}\", which is {node} ({})",
                    meaning(status)
                )));
            }
        }
    }
    Ok(revised)
}

/// Subscribes to the state of the server. If the server does not report it, it is assumed to run.
async fn watch_state(
    session: &Session,
    id: u32,
    interval: Nanos,
    inbox: &Inbox<Notification>,
) -> Result<(), BusError> {
    let request = MonitoredItemCreateRequest::new(
        NodeId::from(VariableId::Server_ServerStatus_State).into(),
        MonitoringMode::Reporting,
        MonitoringParameters {
            client_handle: STATE,
            sampling_interval: interval.as_micros() / 1e3,
            queue_size: 1,
            discard_oldest: true,
            ..MonitoringParameters::default()
        },
    );
    let made = session
        .create_monitored_items(id, TimestampsToReturn::Both, vec![request])
        .await
        .map_err(|error| no_subscription(&error))?;
    let refused = made.iter().map(|made| made.result.status_code);
    if let Some(status) = refused.into_iter().find(StatusCode::is_bad) {
        inbox.push(Notification::Plc(PlcState::Run));
        log::info!(
            "the server does not report its state ({}), so a PLC in STOP is not noticed by it",
            meaning(status)
        );
    }
    Ok(())
}

/// The publishing interval, and the keep-alive count, as revised by the server.
fn revised(session: &Session, id: u32, asked: (Nanos, u32)) -> (Nanos, u32) {
    let state = session.subscription_state.lock();
    let Some(one) = state.get(id) else {
        return asked;
    };
    let interval = i64::try_from(one.publishing_interval().as_nanos()).map(Nanos);
    (interval.unwrap_or(asked.0), one.max_keep_alive_count())
}

fn no_subscription(error: &Error) -> BusError {
    BusError::Refused(format!(
        "the server gives no subscription ({}); see how many it has, and for how many clients",
        meaning(error.status())
    ))
}

/// How many times `interval` fits into `span`.
fn count(span: Nanos, interval: Nanos) -> u32 {
    u32::try_from(span.0 / interval.0.max(1)).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_that_does_not_say_its_state_is_believed_to_run() {
        let says = |value: ServerState| state(&DataValue::new_now(value as i32));
        assert_eq!(says(ServerState::Suspended), Some(PlcState::Stop));
        assert_eq!(says(ServerState::Unknown), Some(PlcState::Run));
        let bad = |status| {
            state(&DataValue {
                status: Some(status),
                ..DataValue::default()
            })
        };
        assert_eq!(bad(StatusCode::BadNotSupported), Some(PlcState::Run));
        assert_eq!(bad(StatusCode::BadWaitingForInitialData), None);
    }
}
