//! Processor time, as Linux counts it for each thread.

use std::fs;
use std::path::{Path, PathBuf};

/// The processor time of this process, and of its children if these count too, in microseconds. The first number of
/// `schedstat` is the time of a thread on a processor, in nanoseconds.
pub(crate) fn processor_us(with_children: bool) -> f64 {
    let own = std::process::id().to_string();
    let listed = |folder: &Path| -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect()
    };
    let is_child = |process: &Path| {
        let status = fs::read_to_string(process.join("status")).unwrap_or_default();
        let parent = status.lines().find_map(|line| line.strip_prefix("PPid:\t"));
        parent == Some(&own)
    };
    let mut processes = vec![Path::new("/proc").join(&own)];
    if with_children {
        processes.extend(
            listed(Path::new("/proc"))
                .into_iter()
                .filter(|it| is_child(it)),
        );
    }
    let tasks = processes
        .iter()
        .flat_map(|process| listed(&process.join("task")));
    tasks
        .map(|task| {
            let times = fs::read_to_string(task.join("schedstat")).unwrap_or_default();
            let time = times
                .split(' ')
                .next()
                .and_then(|time| time.parse::<f64>().ok());
            time.unwrap_or(0.0) / 1000.0
        })
        .sum()
}
