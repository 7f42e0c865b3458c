//! The number of files and sockets that this process may have.

/// Raises the limit of open files as far as the system allows without special rights; returns the limit.
#[cfg(unix)]
pub fn raise_open_files() -> usize {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit {
        current: limit.maximum,
        ..limit
    };
    let current = match setrlimit(Resource::Nofile, raised) {
        Ok(()) => limit.maximum,
        Err(_) => limit.current,
    };
    current.map_or(usize::MAX, |most| {
        usize::try_from(most).unwrap_or(usize::MAX)
    })
}

/// There is no limit to raise.
#[cfg(not(unix))]
pub fn raise_open_files() -> usize {
    usize::MAX
}
