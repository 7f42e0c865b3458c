//! The keys of one kind of bus, for the schema of a driver.cfg.

use tickbus_base::toml_text::Key;

/// The keys of one kind of bus.
#[derive(Clone, Copy, Debug)]
pub struct KindKeys {
    /// The kind's name.
    pub name: &'static str,
    /// True if `events` can be `"writes"`.
    pub learns_of_writes: bool,
    /// True if `role` can be `"observer"`.
    pub can_observe: bool,
    /// True if the tags of the peer can be browsed.
    pub browses: bool,
    /// The keys in `[fieldbus]`, in groups.
    pub keys: &'static [&'static [Key]],
    /// Those of which a file has at least one; empty if it can be without all of them.
    pub one_of: &'static [&'static str],
    /// The keys in a `[[station]]`.
    pub station_keys: &'static [Key],
}
