//! Parsed driver.cfg files. Several worlds have the same file, and parsing it takes longer than a life of its driver.

use std::cell::RefCell;
use std::collections::VecDeque;

use tickbus_driver_cfg::Config;

/// The number of files that are kept: one for each end, and one for each way to replay a recording.
const KEPT: usize = 12;

/// A parsed driver.cfg.
struct Known {
    path: String,
    text: String,
    config: Config,
}

thread_local! {
    static KNOWN: RefCell<VecDeque<Known>> = const { RefCell::new(VecDeque::new()) };
}

/// Parses a driver.cfg, unless this thread did so recently.
///
/// # Panics
///
/// tickbus refuses the file. The files of worlds are valid.
pub(crate) fn parse(path: &str, text: String) -> Config {
    let known = KNOWN.with_borrow(|files| {
        let known = files
            .iter()
            .find(|known| known.text == text && known.path == path);
        known.map(|known| known.config.clone())
    });
    known.unwrap_or_else(|| {
        let config = Config::parse(path, &text, &crate::kinds::KINDS)
            .unwrap_or_else(|why| panic!("a world that tickbus refuses:\n{why}\n{text}"));
        let path = path.to_owned();
        KNOWN.with_borrow_mut(|files| {
            files.truncate(KEPT - 1);
            files.push_front(Known {
                path,
                text,
                config: config.clone(),
            });
        });
        config
    })
}
