//! The studio: a driver.cfg in a browser, edited in a table with the checker's words at the cell, and its line beside it.
//!
//! A studio is a page beside the live page: what runs is shown there, forced there,
//! and fills the values of the table. Every edit is written into the file at once, keeps comments and order, and can be
//! undone. A file that another program changes meanwhile is read again; nothing of it is overwritten.

mod assets;
mod beside;
mod browse;
mod check;
mod desk;
mod document;
mod edit;
mod explore;
mod file;
mod history;
mod layout;
mod line;
mod literal;
mod news;
mod places;
mod propose;
mod rename;
mod running;
mod sheet;
mod site;
mod tables;
mod tags;
mod take;

#[cfg(test)]
mod running_tests;
#[cfg(test)]
mod tests;

pub use beside::Seat;
pub use line::{Machine, Opened};
pub use running::{Read, Running};
pub use site::{Settings, Studio, Unsaved};
