//! The jobs of a cycle whose answers are pending.

/// The jobs of a cycle whose answers are pending: as many at once as client and CPU have agreed on.
#[derive(Debug)]
pub(super) struct InFlight {
    /// The most jobs at once.
    limit: usize,
    /// The jobs by their references and their indexes in the cycle, in the order of the requests.
    jobs: Vec<(u16, usize)>,
    /// The index of the next job.
    next: usize,
    /// The answers count no more: once the last has come, the cycle begins again.
    is_void: bool,
}

impl InFlight {
    /// One job at a time, until more are agreed.
    pub(super) const fn new() -> Self {
        Self {
            limit: 1,
            jobs: Vec::new(),
            next: 0,
            is_void: false,
        }
    }

    pub(super) fn agree(&mut self, limit: u16) {
        self.limit = usize::from(limit);
        self.jobs.reserve(self.limit);
    }

    /// A cycle begins.
    pub(super) fn begin(&mut self) {
        debug_assert!(self.jobs.is_empty(), "one cycle at a time");
        self.next = 0;
        self.is_void = false;
    }

    /// The cycle has to begin again, once all answers have come.
    pub(super) fn void(&mut self) {
        self.is_void = true;
    }

    pub(super) const fn is_void(&self) -> bool {
        self.is_void
    }

    /// The index of the job to be sent now, of a cycle with `count` jobs.
    pub(super) fn next(&self, count: usize) -> Option<usize> {
        let has_room = self.jobs.len() < self.limit && !self.is_void;
        (has_room && self.next < count).then_some(self.next)
    }

    /// The next job was sent with this reference.
    pub(super) fn sent(&mut self, reference: u16) {
        self.jobs.push((reference, self.next));
        self.next += 1;
    }

    /// The job that is answered with this reference.
    pub(super) fn take(&mut self, reference: u16) -> Option<usize> {
        let place = self
            .jobs
            .iter()
            .position(|(asked, _)| *asked == reference)?;
        Some(self.jobs.remove(place).1)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.jobs.is_empty()
    }
}
