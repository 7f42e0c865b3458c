//! Dispatchers on many hosts as one laboratory, over Zenoh.
//!
//! Liveliness tokens show which dispatchers are there, and each dispatcher subscribes to its letters. The content of
//! letters, and the loss of some, are left to the dispatcher.

use std::fs;

use tickbus_base::Mistake;
use tickbus_dispatcher::{Door, HostId, Post, is_name};

#[cfg(feature = "zenoh")]
mod network;

/// The settings for finding other dispatchers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// The name of the laboratory, by the rules for names of clients. Laboratories with other names on the same network
    /// are ignored.
    pub laboratory: String,
    /// Endpoints of Zenoh to connect to, such as `tcp/192.168.0.10:7447`: of routers or other dispatchers. Without any,
    /// peers in the local network are found by multicast.
    pub connect: Vec<String>,
    /// Endpoints of Zenoh to listen on; without any Zenoh chooses a port on all networks.
    pub listen: Vec<String>,
}

/// Why a laboratory cannot be joined.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Failure {
    /// An option is wrong.
    Options(Mistake),
    /// Zenoh failed; the text has the reason and the remedy.
    Network(String),
}

/// A network that is joined.
pub struct Joined {
    /// The identity of this dispatcher in the laboratory.
    pub host: HostId,
    /// Transports letters. Dropping it leaves the network.
    pub post: Box<dyn Post>,
}

impl std::fmt::Debug for Joined {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Joined")
            .field("host", &self.host)
            .finish_non_exhaustive()
    }
}

/// Joins a laboratory. Letters from the others go through `door`; its dispatcher must be a member of a federation.
///
/// # Errors
///
/// An option is wrong, Zenoh cannot listen, or this was built without Zenoh.
pub fn join(options: &Options, door: &Door) -> Result<Joined, Failure> {
    if !is_name(&options.laboratory) {
        return Err(Failure::Options(Mistake::new(
            format!(
                "\"{}\" cannot be the name of a laboratory",
                options.laboratory
            ),
            "write 1 to 63 letters, digits, _, - and .",
        )));
    }
    #[cfg(feature = "zenoh")]
    return network::join(options, door);
    #[cfg(not(feature = "zenoh"))]
    {
        let _ = door;
        Err(Failure::Options(Mistake::new(
            "this tickbus was built without Zenoh".to_owned(),
            "build it with cargo build --release --features zenoh",
        )))
    }
}

/// The name of this computer, if it can be determined.
pub fn computer_name() -> String {
    let kernel = fs::read_to_string("/proc/sys/kernel/hostname");
    let kernel = kernel.ok().map(|name| name.trim().to_owned());
    let names = ["COMPUTERNAME", "HOSTNAME"].into_iter();
    let names = names.filter_map(|name| std::env::var(name).ok());
    let mut all = kernel.into_iter().chain(names);
    all.find(|name| !name.is_empty())
        .unwrap_or_else(|| "host".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_base::time::Stop;

    fn mistake(laboratory: &str, connect: &str) -> String {
        let options = Options {
            laboratory: laboratory.to_owned(),
            connect: vec![connect.to_owned()],
            listen: Vec::new(),
        };
        match join(&options, &Door::new(&Stop::new())).expect_err("it is wrong") {
            Failure::Options(mistake) => mistake.to_string(),
            Failure::Network(why) => panic!("{why}"),
        }
    }

    #[test]
    fn wrong_options_are_refused_before_anything_is_opened() {
        let told = mistake("a/b", "tcp/1.2.3.4:5");
        assert!(
            told.starts_with("\"a/b\" cannot be the name of a laboratory; "),
            "{told}"
        );
        let told = mistake("lab", "192.168.0.1");
        if cfg!(feature = "zenoh") {
            assert!(
                told.starts_with("\"192.168.0.1\" is no endpoint of Zenoh"),
                "{told}"
            );
            let told = mistake("lab", "quic/1.2.3.4:5");
            assert!(told.contains("such as tcp/192.168.0.10:7447"), "{told}");
        } else {
            assert!(told.contains("--features zenoh"), "{told}");
        }
    }
}
