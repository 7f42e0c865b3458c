//! The nets that programs in other languages show on the page of this process.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tickbus_base::time::Nanos;
use tickbus_binding::Refusal;
use tickbus_driver::Code;
use tickbus_net::Address;

use crate::page::{self, NetsPlace};

/// The nets on the page, by their handles.
static TABLE: Mutex<Table> = Mutex::new(Table {
    last: 0,
    open: BTreeMap::new(),
});

struct Table {
    /// The last handle. None is given twice.
    last: i64,
    open: BTreeMap<i64, Arc<NetsPlace>>,
}

fn table() -> MutexGuard<'static, Table> {
    // Nets are in the table as a whole, or not.
    TABLE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the nets of a handle. The table is free again while they are used.
fn nets(handle: i64) -> Result<Arc<NetsPlace>, Refusal> {
    let table = table();
    let found = table.open.get(&handle).cloned();
    found.ok_or_else(|| {
        let what = if (1..=table.last).contains(&handle) {
            "these nets are closed"
        } else {
            "no nets were opened with this number"
        };
        refused(what)
    })
}

fn refused(what: impl std::fmt::Display) -> Refusal {
    Refusal::new(Code::BadArgument, what)
}

/// Opens nets under a heading on the page of this process, which is served at this address unless there is one already.
/// Returns their handle.
pub(crate) fn open(address: &str, title: &str) -> Result<i64, Refusal> {
    let listen: Address = address
        .parse()
        .map_err(|mistake| refused(format!("the page's address: {mistake}")))?;
    let place = page::show_nets(title, &listen)?;
    let mut table = table();
    table.last += 1;
    let handle = table.last;
    table.open.insert(handle, Arc::new(place));
    Ok(handle)
}

/// The address of the page with these nets.
pub(crate) fn url(handle: i64) -> Result<String, Refusal> {
    Ok(nets(handle)?.url())
}

/// Hands over the drawings.
pub(crate) fn draw(handle: i64, json: &str) -> Result<(), Refusal> {
    nets(handle)?.draw(json).map_err(refused)
}

/// Waits until a state is wanted, at most this long.
pub(crate) fn wanted(handle: i64, patience: Nanos) -> Result<bool, Refusal> {
    Ok(nets(handle)?.wanted(patience))
}

/// Hands over a state.
pub(crate) fn put(handle: i64, json: &str) -> Result<(), Refusal> {
    nets(handle)?.put(json).map_err(refused)
}

/// Takes the nets from the page.
pub(crate) fn close(handle: i64) -> Result<(), Refusal> {
    let place = nets(handle)?;
    table().open.remove(&handle);
    place.leave();
    Ok(())
}
