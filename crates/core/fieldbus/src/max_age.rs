//! The limit of age of a line, which can change while the line runs.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use tickbus_base::time::Nanos;

/// The age beyond which data are stale, for all who compare with it. Reading it takes no lock.
#[derive(Clone, Debug)]
pub struct MaxAge(Arc<AtomicI64>);

impl MaxAge {
    /// The limit by which data older than `max_age` are stale.
    pub fn new(max_age: Nanos) -> Self {
        Self(Arc::new(AtomicI64::new(max_age.0)))
    }

    /// The present limit.
    #[inline]
    pub fn get(&self) -> Nanos {
        Nanos(self.0.load(Ordering::Relaxed))
    }

    /// Sets another limit, which applies from the next comparison on.
    pub fn set(&self, max_age: Nanos) {
        self.0.store(max_age.0, Ordering::Relaxed);
    }
}
