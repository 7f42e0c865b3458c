//! Browsing the tags of a peer, folder by folder, before a driver.cfg names them.

use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;

/// One entry of a folder. Its texts are the peer's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tag {
    /// The name within the folder.
    pub name: String,
    /// The peer's id of the tag, with which its contents are asked for.
    pub id: String,
    /// True if there can be further tags in it.
    pub opens: bool,
    /// The type in the peer's own words; empty for a folder.
    pub type_name: String,
    /// True if this end can read the value.
    pub is_readable: bool,
    /// True if this end can write the value.
    pub is_writable: bool,
    /// The peer's description of the tag; can be empty.
    pub comment: String,
    /// How the tag becomes a signal; `None` for a folder, and the reason why the tag cannot.
    pub signal: Option<Result<Place, String>>,
}

/// How a tag becomes a signal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The address for `[fieldbus.at]`.
    pub at: String,
    /// The type.
    pub data_type: DataType,
}

/// The contents of a folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Listing {
    /// The entries, in the order of the peer.
    pub tags: Vec<Tag>,
    /// A remark about the listing, such as what it leaves out; can be empty.
    pub told: String,
}

/// A wish to a bus that browses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// The contents of the folder with this id; empty for the outermost one.
    Folder(String),
    /// Nothing at the moment: keep the connection until this time, or until the stop of the examination is woken.
    Rest(Nanos),
    /// The end of the connection.
    End,
}

/// Somebody who browses.
pub trait Browsing {
    /// The next wish.
    fn wanted(&mut self) -> Wanted;

    /// Takes the contents of a folder, or why the peer does not list them.
    fn found(&mut self, id: &str, listing: Result<Listing, String>);
}
