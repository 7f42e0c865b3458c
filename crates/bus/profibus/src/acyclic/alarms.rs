//! The alarms of a station: they are in its diagnosis one by one, and its master acknowledges each (DP-V1).

use std::collections::VecDeque;

use tickbus_fieldbus::faults::AlarmKind;

/// The octets of an alarm's block before its data.
const HEAD: usize = 4;

/// The most alarms that wait; the oldest is lost then.
const WAITING: usize = 32;

/// The sequence numbers of alarms.
const SEQUENCE: u8 = 32;

/// The bits of `Alarm_Specifier` beside the sequence number.
const WITHOUT_SEQUENCE: u8 = 0b111;

/// The alarms that may be unacknowledged at a time, by `Alarm_Mode`; 0 means one of each type.
const MODES: [usize; 8] = [0, 2, 4, 8, 12, 16, 24, 32];

/// The alarms that a device can send.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AlarmSupport {
    /// The types, as bits of the second octet of DPV1 in `Set_Prm`.
    pub types: u8,
    /// The most alarms that can be unacknowledged at a time; 0 if it is only one of each type.
    pub sequence: u8,
}

impl AlarmSupport {
    /// All types, and any number.
    pub const ALL: Self = Self {
        types: 0b1110_1100,
        sequence: SEQUENCE,
    };
}

/// The bit with which a master enables a type, in the second octet of DPV1.
pub(crate) const fn enable_bit(kind: AlarmKind) -> u8 {
    match kind {
        AlarmKind::Diagnosis => 1 << 5,
        AlarmKind::Process => 1 << 6,
        AlarmKind::Pull | AlarmKind::Plug => 1 << 7,
        AlarmKind::Status => 1 << 3,
        AlarmKind::Update => 1 << 2,
    }
}

/// The cause of an alarm, for as long as it lasts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Alarm {
    /// The type.
    pub kind: AlarmKind,
    /// The slot, 0 to 254.
    pub slot: u8,
    /// The device's own octets, at most 59.
    pub data: Vec<u8>,
}

/// One alarm on its way.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Message {
    alarm: Alarm,
    /// `Alarm_Specifier`: whether an error appears or disappears, and the sequence number.
    specifier: u8,
}

impl Message {
    fn is(&self, slot: u8, kind: u8, specifier: u8) -> bool {
        let own = (self.alarm.slot, self.alarm.kind as u8, self.specifier);
        own == (slot, kind, specifier)
    }
}

/// The alarms of a station.
#[derive(Debug, Default)]
pub(crate) struct Alarms {
    support: AlarmSupport,
    /// The types that the owner's parameters enable.
    enabled: u8,
    /// The most unacknowledged alarms; `None` for one of each type.
    most: Option<usize>,
    causes: Vec<Alarm>,
    waiting: VecDeque<Message>,
    /// In the diagnosis, until the owner has read it.
    offered: Option<Message>,
    unacknowledged: Vec<Message>,
    sequence: u8,
    /// Alarms that the owner has not enabled.
    dropped: Vec<(AlarmKind, u8)>,
}

impl Alarms {
    pub(crate) fn new(support: AlarmSupport) -> Self {
        Self {
            support,
            ..Self::default()
        }
    }

    /// The owner's parameters: the second and the third octet of DPV1. Its connection begins anew, so that it acknowledges
    /// no alarm that it has read before, and one that it has not read waits again.
    pub(crate) fn enable(&mut self, types: u8, mode: u8) {
        self.unacknowledged.clear();
        if let Some(mut own) = self.offered.take() {
            own.specifier &= WITHOUT_SEQUENCE;
            self.waiting.push_front(own);
        }
        self.enabled = types & self.support.types;
        let most = MODES[usize::from(mode & 7)].min(self.support.sequence.into());
        self.most = (most > 0).then_some(most);
    }

    /// The owner leaves, and with it all alarms; errors that last are told to the next one.
    pub(crate) fn clear(&mut self) {
        self.enabled = 0;
        let causes = self.causes.iter();
        let errors = causes.filter(|cause| cause.kind == AlarmKind::Diagnosis);
        let appears = |cause: &Alarm| Message {
            alarm: cause.clone(),
            specifier: 1,
        };
        self.waiting = errors.map(appears).collect();
        self.offered = None;
        self.unacknowledged.clear();
    }

    /// The causes that are there now: new ones raise an alarm, as does the end of an error and of a missing module.
    pub(crate) fn raise(&mut self, now: &[Alarm]) {
        let before = std::mem::replace(&mut self.causes, now.to_vec());
        for gone in before.iter().filter(|cause| !now.contains(cause)) {
            let (kind, specifier) = match gone.kind {
                AlarmKind::Diagnosis => {
                    let mut others = now.iter();
                    let is_same = |own: &Alarm| (own.kind, own.slot) == (gone.kind, gone.slot);
                    // The slot is good again, or still has another error.
                    (gone.kind, if others.any(is_same) { 3 } else { 2 })
                }
                AlarmKind::Pull => (AlarmKind::Plug, 0),
                _ => continue,
            };
            self.push(
                Alarm {
                    kind,
                    ..gone.clone()
                },
                specifier,
            );
        }
        for new in now.iter().filter(|cause| !before.contains(cause)) {
            let appears = u8::from(new.kind == AlarmKind::Diagnosis);
            self.push(new.clone(), appears);
        }
    }

    fn push(&mut self, alarm: Alarm, specifier: u8) {
        if self.waiting.len() == WAITING {
            self.waiting.pop_front();
        }
        self.waiting.push_back(Message { alarm, specifier });
    }

    /// Puts the next alarm into the diagnosis, if there is room for one; returns true for news.
    pub(crate) fn offer(&mut self) -> bool {
        if self.offered.is_some() {
            return false;
        }
        let (enabled, dropped) = (self.enabled, &mut self.dropped);
        self.waiting.retain(|own| {
            let is_enabled = enabled & enable_bit(own.alarm.kind) != 0;
            if !is_enabled {
                dropped.push((own.alarm.kind, own.alarm.slot));
            }
            is_enabled
        });
        let waits = |own: &Message| {
            if let Some(most) = self.most {
                return self.unacknowledged.len() < most;
            }
            let mut others = self.unacknowledged.iter();
            others.all(|other| other.alarm.kind != own.alarm.kind)
        };
        let Some(place) = self.waiting.iter().position(waits) else {
            return false;
        };
        self.offered = self.waiting.remove(place);
        if let (Some(own), Some(_)) = (&mut self.offered, self.most) {
            own.specifier |= self.sequence << 3;
            self.sequence = (self.sequence + 1) % SEQUENCE;
        }
        true
    }

    /// The block in the diagnosis.
    pub(crate) fn block(&self) -> Option<Vec<u8>> {
        let Message { alarm, specifier } = self.offered.as_ref()?;
        let length = u8::try_from(HEAD + alarm.data.len()).expect("an alarm has few octets");
        let mut block = vec![length, alarm.kind as u8, alarm.slot, *specifier];
        block.extend_from_slice(&alarm.data);
        Some(block)
    }

    /// The owner has read the diagnosis.
    pub(crate) fn read(&mut self) {
        self.unacknowledged.extend(self.offered.take());
    }

    /// The owner acknowledges an alarm; false if it has not got that one.
    pub(crate) fn acknowledge(&mut self, slot: u8, kind: u8, specifier: u8) -> bool {
        let mut all = self.unacknowledged.iter();
        let found = all.position(|own| own.is(slot, kind, specifier));
        found.is_some_and(|place| {
            self.unacknowledged.remove(place);
            true
        })
    }

    /// True while a slot has an error.
    pub(crate) fn has_error(&self) -> bool {
        let mut causes = self.causes.iter();
        causes.any(|cause| cause.kind == AlarmKind::Diagnosis)
    }

    /// The alarms that the owner has not enabled, since the last call.
    pub(crate) fn take_dropped(&mut self) -> Vec<(AlarmKind, u8)> {
        std::mem::take(&mut self.dropped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alarm(kind: AlarmKind, slot: u8) -> Alarm {
        Alarm {
            kind,
            slot,
            data: vec![0xAB],
        }
    }

    /// Reads the alarm in the diagnosis.
    fn next(alarms: &mut Alarms) -> Option<Vec<u8>> {
        alarms.offer();
        let block = alarms.block();
        alarms.read();
        block
    }

    #[test]
    fn one_alarm_of_each_type_waits_for_its_acknowledgement() {
        let mut alarms = Alarms::new(AlarmSupport::ALL);
        alarms.enable(0xFF, 0);
        let [first, second] = [2, 3].map(|slot| alarm(AlarmKind::Process, slot));
        let error = alarm(AlarmKind::Diagnosis, 4);
        alarms.raise(&[first.clone(), second.clone(), error.clone()]);
        assert!(alarms.offer());
        assert!(!alarms.offer(), "one at a time");
        assert_eq!(next(&mut alarms), Some(vec![5, 2, 2, 0, 0xAB]));
        assert_eq!(next(&mut alarms), Some(vec![5, 1, 4, 1, 0xAB]));
        assert_eq!(next(&mut alarms), None);
        for wrong in [(3, 2, 0), (2, 1, 0), (2, 2, 8)] {
            assert!(!alarms.acknowledge(wrong.0, wrong.1, wrong.2), "{wrong:?}");
        }
        assert!(alarms.acknowledge(2, 2, 0));
        assert!(!alarms.acknowledge(2, 2, 0), "once");
        assert_eq!(next(&mut alarms), Some(vec![5, 2, 3, 0, 0xAB]));
        // The process alarms end without another one; the error leaves when the last one is acknowledged.
        assert!(alarms.has_error());
        alarms.raise(&[]);
        assert!(!alarms.has_error());
        assert_eq!(next(&mut alarms), None);
        assert!(alarms.acknowledge(4, 1, 1));
        assert_eq!(next(&mut alarms), Some(vec![5, 1, 4, 2, 0xAB]));
    }

    #[test]
    fn several_alarms_are_numbered_up_to_what_master_and_device_allow() {
        let mut alarms = Alarms::new(AlarmSupport {
            sequence: 3,
            ..AlarmSupport::ALL
        });
        alarms.enable(0xFF, 2);
        let all: Vec<Alarm> = (1..=4)
            .map(|slot| alarm(AlarmKind::Process, slot))
            .collect();
        alarms.raise(&all);
        let read: Vec<_> = (0..4).map(|_| next(&mut alarms)).collect();
        let expected = [1, 2, 3].map(|slot| Some(vec![5, 2, slot, (slot - 1) << 3, 0xAB]));
        assert_eq!(read[..3], expected);
        assert_eq!(read[3], None);
        assert!(alarms.acknowledge(2, 2, 1 << 3), "in any order");
        assert_eq!(next(&mut alarms), Some(vec![5, 2, 4, 3 << 3, 0xAB]));
    }

    #[test]
    fn a_second_error_of_a_slot_and_a_module_that_comes_back_are_told() {
        let mut alarms = Alarms::new(AlarmSupport::ALL);
        alarms.enable(0xFF, 7);
        let one = alarm(AlarmKind::Diagnosis, 1);
        let other = Alarm {
            data: vec![1],
            ..one.clone()
        };
        let pulled = alarm(AlarmKind::Pull, 5);
        alarms.raise(&[one.clone(), other.clone(), pulled]);
        alarms.raise(&[other]);
        let read: Vec<_> = std::iter::from_fn(|| next(&mut alarms)).collect();
        let expected: [&[u8]; 5] = [
            &[5, 1, 1, 1, 0xAB],
            &[5, 1, 1, 1 | 1 << 3, 1],
            &[5, 3, 5, 2 << 3, 0xAB],
            &[5, 1, 1, 3 | 3 << 3, 0xAB],
            &[5, 4, 5, 4 << 3, 0xAB],
        ];
        assert_eq!(read, expected);
    }

    #[test]
    fn new_parameters_forget_what_was_read_and_keep_what_was_not() {
        let mut alarms = Alarms::new(AlarmSupport::ALL);
        alarms.enable(0xFF, 1);
        alarms.raise(&[1, 2, 3].map(|slot| alarm(AlarmKind::Process, slot)));
        assert_eq!(next(&mut alarms), Some(vec![5, 2, 1, 0, 0xAB]));
        assert!(alarms.offer());
        alarms.enable(0xFF, 0);
        assert!(!alarms.acknowledge(1, 2, 0), "of the connection before");
        assert_eq!(next(&mut alarms), Some(vec![5, 2, 2, 0, 0xAB]));
        assert!(alarms.acknowledge(2, 2, 0));
        assert!(alarms.offer());
        // The type is no longer enabled.
        alarms.enable(0x20, 0);
        assert_eq!(next(&mut alarms), None);
        assert_eq!(alarms.take_dropped(), [(AlarmKind::Process, 3)]);
    }

    #[test]
    fn an_error_that_lasts_is_told_to_the_next_master() {
        let mut alarms = Alarms::new(AlarmSupport::ALL);
        alarms.enable(0xFF, 0);
        alarms.raise(&[alarm(AlarmKind::Diagnosis, 4), alarm(AlarmKind::Process, 5)]);
        for _ in 0..2 {
            assert_eq!(next(&mut alarms), Some(vec![5, 1, 4, 1, 0xAB]));
            alarms.clear();
            alarms.enable(0xFF, 0);
        }
        alarms.clear();
        alarms.raise(&[]);
        alarms.enable(0xFF, 7);
        assert_eq!(next(&mut alarms), Some(vec![5, 1, 4, 1, 0xAB]));
        assert_eq!(next(&mut alarms), Some(vec![5, 1, 4, 2 | 1 << 3, 0xAB]));
        assert_eq!(next(&mut alarms), None);
    }

    #[test]
    fn alarms_that_the_master_has_not_enabled_are_dropped_and_told() {
        let mut alarms = Alarms::new(AlarmSupport {
            types: 0x20,
            sequence: 0,
        });
        alarms.enable(0xFF, 7);
        let causes = [alarm(AlarmKind::Process, 1), alarm(AlarmKind::Diagnosis, 2)];
        alarms.raise(&causes);
        assert_eq!(next(&mut alarms), Some(vec![5, 1, 2, 1, 0xAB]), "no number");
        assert_eq!(alarms.take_dropped(), [(AlarmKind::Process, 1)]);
        alarms.clear();
        assert!(!alarms.acknowledge(2, 1, 1));
    }
}
