//! The web room: where live pages are served.
//!
//! A [`Site`] brings the files of a page, makes its state when somebody looks, and carries out changes. The [`Room`] has
//! the rest: one thread, a token without which nothing can be changed, the refusal of requests from other sites, limits,
//! and server-sent events of which every viewer gets the newest: the whole state, or what it lacks of it.
//!
//! It stands on hyper, not on the framework axum around it: axum's own server has no limit of time for headers nor of
//! connections, and a page has so few paths that a `match` is their router.

mod feed;
mod guard;
mod patient;
mod room;
mod seats;
mod serve;
mod site;
mod token;

pub use room::{Limits, Room, Serving};
pub use site::{Answer, Asset, Change, Differences, Document, Outcome, Refused, Site, State, Verb};

/// What the scripts of every page share: the token, asking, listening.
pub const CLIENT: &str = include_str!("client.js");

/// The script that reads the events, as a worker for all tabs of a browser; `client.js` expects it at `/stream.js`.
pub const STREAM: &str = include_str!("stream.js");
