//! The web room, which serves live pages.
//!
//! A [`Site`] provides the files of a page, its state while there are viewers, and carries out changes. [`Pages`] are
//! the sites of one room. The [`Room`] does the rest: one thread, a token without which nothing can be changed, the refusal
//! of requests from other sites, limits, and server-sent events that give every viewer the newest state: all of it, or just
//! the differences.
//!
//! The room uses hyper, not the framework axum on top of it: axum's own server limits neither the time for headers nor
//! the number of connections, and a page has so few paths that a `match` suffices as their router.

mod events;
mod feed;
mod feeds;
mod guard;
mod invitation;
mod pages;
mod patient;
mod room;
mod seats;
mod serve;
mod site;
mod slim;
mod token;

pub use invitation::Invitation;
pub use pages::{Joined, Page, Pages};
pub use room::{Limits, Room, Serving};
pub use site::{
    Answer, Asset, Change, Differences, Document, Outcome, Refused, Site, State, Tab, Verb,
};
pub use slim::slim;

/// The shared parts of every page's scripts: the token, requests, events.
pub const CLIENT: &str = include_str!("client.js");

/// The script that reads the events, as a worker for all tabs of a browser; `client.js` expects it at `/stream.js`.
pub const STREAM: &str = include_str!("stream.js");

/// The script of the head that all pages of a room have: title, tabs, connection, access, counts and alarms, which it makes in
/// the element `top`. A page has `stream.js`, `client.js` and this before its own script, and calls `head.listen`.
pub const HEAD: &str = include_str!("head.js");

/// The script with which those of the pages make elements; they expect it at `/elements.js`.
pub const ELEMENTS: &str = include_str!("elements.js");

/// The style of that head; it follows `report.css`, which has the colours.
pub const STYLE: &str = include_str!("room.css");
