//! Which changes by the peer are reported one by one.

/// What `events` in `[fieldbus]` asks for, in addition to the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Events {
    /// Nothing.
    #[default]
    None,
    /// Every change of a signal that is received.
    Changes,
    /// Every write of such a signal, changed or not; for buses that [learn of writes](crate::BusKind::LEARNS_OF_WRITES).
    Writes,
}
