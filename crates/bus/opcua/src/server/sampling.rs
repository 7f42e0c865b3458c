//! The times of monitored items.

use opcua_server::node_manager::RequestContext;
use opcua_server::{MonitoredItemHandle, Subscription};

use tickbus_base::time::Nanos;

use super::watched::Rhythm;

/// The rhythm of an item with a sampling interval in milliseconds and a queue. With a queue the client sees
/// every sample, without one the value at the time of publishing.
pub(super) fn rhythm(sampling: f64, queue: usize, publishing: Nanos) -> Rhythm {
    let sampling = millis(sampling);
    let span = if queue > 1 {
        sampling
    } else {
        sampling.max(publishing)
    };
    Rhythm { sampling, span }
}

/// The publishing interval of the subscription that an item belongs to.
pub(super) fn publishing(context: &RequestContext, item: MonitoredItemHandle) -> Nanos {
    let of_session = context
        .subscriptions
        .get_session_subscriptions(context.session_id);
    of_session.map_or(Nanos::ZERO, |of_session| {
        let of_session = of_session.lock();
        let interval = of_session
            .get(item.subscription_id)
            .map(Subscription::publishing_interval);
        interval.map_or(Nanos::ZERO, |interval| {
            Nanos(i64::try_from(interval.as_nanos()).unwrap_or(i64::MAX))
        })
    })
}

/// A span in milliseconds; a negative one means the publishing interval.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a sampling interval, in nanoseconds"
)]
pub(super) fn millis(millis: f64) -> Nanos {
    Nanos((millis.max(0.0) * 1e6) as i64)
}
