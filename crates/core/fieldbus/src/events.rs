//! The peer's changes that are reported one by one.

/// The events that `events` in `[fieldbus]` requests, in addition to the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Events {
    /// No events.
    #[default]
    None,
    /// Every change of a received signal.
    Changes,
    /// Every write of a received signal, changed or not; for buses that [learn of
    /// writes](crate::BusKind::LEARNS_OF_WRITES).
    Writes,
}
