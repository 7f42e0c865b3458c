//! The page of running Petri nets.
//!
//! A program [joins](NetPage::join) with its nets, hands over their [drawings](Nets::draw) once, and a
//! [state](Nets::put) whenever one is [wanted](Nets::wanted), which is only while somebody looks. Several programs of a
//! process share the page. What they hand over is JSON, as docs/petri.md describes it; all of it is checked, because
//! names and drawings can come from files of others.

mod assets;
mod drawing;
mod layout;
mod page;
mod site;
mod state;

#[cfg(test)]
mod tests;

pub use page::{NetPage, Nets, Wanted};
