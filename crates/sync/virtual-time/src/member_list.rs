//! The list by which the clients of a run find each other.

use tickbus_base::time::Nanos;

use crate::Declaration;

/// The clients of a run that exchange their values without the server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MemberList {
    /// A number that tells this meeting from others.
    pub token: u64,
    /// The virtual time of one step of the server.
    pub step: Nanos,
    /// The place in the list of the client that reads it.
    pub own: usize,
    /// The addresses and the declarations, in the order of the names.
    pub members: Vec<(String, Declaration)>,
}

impl MemberList {
    /// The longest list, in bytes on the wire.
    pub(crate) const LONGEST: usize = 1 << 20;

    /// True if the list is short enough for the wire, with a few bytes to spare.
    pub(crate) fn fits(&self) -> bool {
        let name = |name: &String| 2 + name.len();
        let member = |(address, declaration): &(String, Declaration)| {
            let writes = declaration
                .writes
                .iter()
                .map(|variable| name(&variable.name));
            let reads = declaration.reads.iter().map(name);
            // The multiple, the interval and two counts.
            16 + name(address)
                + name(&declaration.name)
                + writes.sum::<usize>()
                + reads.sum::<usize>()
        };
        32 + self.members.iter().map(member).sum::<usize>() <= Self::LONGEST
    }
}
