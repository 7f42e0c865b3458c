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

/// The remedy for an error that [`is_out_of_files`].
pub const OUT_OF_FILES: &str = "this process, or the computer, has as many files and sockets open as the system allows; \
                                raise the limit (ulimit -n, LimitNOFILE of systemd), or spread the drivers over several \
                                processes";

/// Returns true if the limit of open files is the reason of this error.
pub fn is_out_of_files(error: &std::io::Error) -> bool {
    #[cfg(unix)]
    {
        use rustix::io::Errno;

        let reason = Errno::from_io_error(error);
        matches!(reason, Some(Errno::MFILE | Errno::NFILE))
    }
    #[cfg(not(unix))]
    {
        let _ = error;
        false
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs::File;

    use super::*;

    #[test]
    fn only_the_limit_of_open_files_is_taken_for_it() {
        let error = |number| std::io::Error::from_raw_os_error(number);
        let numbers = [rustix::io::Errno::MFILE, rustix::io::Errno::NFILE];
        assert!(
            numbers
                .iter()
                .all(|errno| is_out_of_files(&error(errno.raw_os_error())))
        );
        let missing = File::open("/no such file").expect_err("it does not exist");
        assert!(!is_out_of_files(&missing) && !is_out_of_files(&std::io::Error::other("x")));
    }
}
