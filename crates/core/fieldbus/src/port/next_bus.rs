//! Another bus takes the place of a bus that has ended, at the same end of the image.

use tickbus_base::time::Nanos;

use super::Port;
use super::looks::Looks;
use crate::faults::Spoilt;
use crate::validity::Validity;

impl Port {
    /// The same port, for a bus that takes the place of the one before. Injected faults go on, and so do the counts of
    /// edges. What arrived from the peer so far does not count any more: data are stale until the next peer gives a sign of
    /// life, and then fail-safe values until it sends its own. The watchers, the names and the [farewell](Self::farewell) of the bus before are gone;
    /// the limit of age is that of the state of the line.
    #[must_use]
    pub fn for_next_bus(mut self, watchdog: Option<Nanos>) -> Self {
        let stations = self.stations();
        (self.spoilt, self.late) = (Spoilt::default(), Vec::new());
        let image = &mut self.image;
        self.looks = Looks::new(image.status.max_age());
        image.status.forget_bus();
        image.validity = Validity::new(stations);
        image.image.expect_other_peers();
        image.watchdog = watchdog;
        image.changes = Vec::new();
        (image.blind, image.ending, image.last_cycle) = (None, None, None);
        image.is_held = false;
        image.fresh_until = Nanos::ZERO;
        (image.next_log, image.next_age) = (Nanos::ZERO, Nanos::ZERO);
        image.hand_over();
        self
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use tickbus_base::time::{Manual, Nanos};
    use tickbus_image::{Receiver, StationStreams, image};

    use super::*;
    use crate::{Cause, LinkState, LinkStatus, PlcState, Role};

    fn at(millis: i64) -> Nanos {
        Nanos::from_millis(millis)
    }

    /// The bytes that a tick sees.
    #[derive(Default)]
    struct Seen(Vec<u8>);

    impl Receiver for Seen {
        fn levels(&mut self, bytes: &[u8]) {
            self.0 = bytes.to_vec();
        }

        fn edges(&mut self, _: usize, _: u32) {}
    }

    #[test]
    fn what_the_peer_of_the_bus_before_sent_does_not_count_until_the_next_peer_gives_a_sign_of_life()
     {
        let station = StationStreams {
            tx_fail_safe: Box::new([]),
            tx_latched: Box::new([]),
            tx_counted: Box::default(),
            rx_counted: Box::default(),
            rx_fail_safe: Box::new([0]),
            rx_latched: Box::new([]),
        };
        let (mut tick, bus) = image(vec![station]);
        let status = LinkStatus::new("test", at(100));
        let mut port = Port::new(bus, Manual::new(), Role::Device, None, status.clone());
        port.running("the first PLC is there");
        port.tell("address", "the first");
        port.received(0, at(1), &[1]);
        port.plc_state(0, at(2), PlcState::Stop);
        assert!(!tick.peers.is_valid(0));
        assert_eq!(status.link().cause, Cause::Stopped);
        status.limit().set(at(50));
        let mut port = port.for_next_bus(None);
        assert_eq!((port.max_age(), status.fact("address")), (at(50), None));
        port.opening("the next");
        port.running("the next PLC is there");
        // Neither the STOP of the PLC before nor the silence of the next one is a reason.
        assert_eq!(status.state(), LinkState::Running);
        let mut seen = Seen::default();
        tick.update();
        assert!(tick.read(0, (at(3), at(50)), &mut seen).stale);
        port.touch(0, at(3));
        tick.update();
        assert!(!tick.read(0, (at(3), at(50)), &mut seen).stale);
        assert_eq!(seen.0, [0], "what the first PLC sent is gone");
        port.received(0, at(4), &[5]);
        tick.update();
        tick.read(0, (at(4), at(50)), &mut seen);
        assert_eq!(seen.0, [5]);
    }
}
