//! The addresses under which browsers of other devices open a room, and a QR code for the camera of a phone.

use std::fmt::Write as _;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::atomic::{AtomicBool, Ordering};

use qrcode::{Color, EcLevel, QrCode};

/// Interfaces of containers and virtual machines, which no other device reaches, by how their names begin.
const INNER: [&str; 8] = [
    "docker",
    "br-",
    "veth",
    "virbr",
    "vmnet",
    "vboxnet",
    "cni",
    "vEthernet",
];

/// Addresses reserved for documentation: the route to them is the one to the world. Nothing is sent there.
const FAR: [SocketAddr; 2] = [
    SocketAddr::new(IpAddr::V4(Ipv4Addr::new(203, 0, 113, 1)), 9),
    SocketAddr::new(
        IpAddr::V6(Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1)),
        9,
    ),
];

/// The light modules around a QR code that a reader needs.
const QUIET: usize = 4;

/// White on black from the part of the palette that themes of terminals leave alone.
const COLOURS: &str = "\x1b[38;5;231;48;5;16m";

/// How a page is opened.
#[derive(Clone, Debug)]
pub struct Invitation {
    url: String,
    /// The URLs for other devices, the best one first.
    others: Vec<String>,
    port: u16,
    is_here: bool,
}

impl Invitation {
    /// The way to the page that is served at `bound`, with this URL.
    pub(crate) fn new(url: String, bound: SocketAddr) -> Self {
        let port = bound.port();
        let (_, path) = url.split_at(url.find(&format!(":{port}/")).unwrap_or(url.len()));
        let is_here = bound.ip().is_loopback();
        let others = if is_here {
            Vec::new()
        } else if bound.ip().is_unspecified() {
            let found = if_addrs::get_if_addrs().unwrap_or_default();
            let found = found.into_iter().map(|it| (it.name.clone(), it.ip()));
            let world = FAR.map(|far| tickbus_net::route(far).ok());
            let own = sorted(found.collect(), &world, bound.is_ipv4());
            let in_url = |ip| match ip {
                IpAddr::V4(ip) => format!("http://{ip}{path}"),
                IpAddr::V6(ip) => format!("http://[{ip}]{path}"),
            };
            own.into_iter().map(in_url).collect()
        } else {
            vec![url.clone()]
        };
        Self {
            url,
            others,
            port,
            is_here,
        }
    }

    /// Leaves out the token, for a page on which nothing can be changed.
    #[must_use]
    pub fn without_token(mut self) -> Self {
        for url in [&mut self.url].into_iter().chain(&mut self.others) {
            let end = url.find('#').unwrap_or(url.len());
            url.truncate(end);
        }
        self
    }

    /// The lines that a terminal shows below the address: the other addresses, and a QR code of the best one. For a page that only
    /// this computer opens, one line, once in a process: that `setting` opens it for others, with the page's port for `PORT`. Not for
    /// logs, since it has the token.
    pub fn for_terminal(&self, setting: &str) -> String {
        static IS_TOLD: AtomicBool = AtomicBool::new(false);

        let mut text = String::new();
        // Writing to a string cannot fail.
        if self.is_here {
            if !IS_TOLD.swap(true, Ordering::Relaxed) {
                let setting = setting.replace("PORT", &self.port.to_string());
                let _ = writeln!(
                    text,
                    "    for this computer alone; {setting} opens it for a phone"
                );
            }
            return text;
        }
        let Some(best) = self.others.first() else {
            return "    this computer has no address in a network, so no other device opens the page\n"
                .to_owned();
        };
        for url in self.others.iter().filter(|url| **url != self.url) {
            let _ = writeln!(text, "    {url}");
        }
        if let Ok(code) = QrCode::with_error_correction_level(best, EcLevel::L) {
            text += &draw(&code);
        }
        text
    }
}

/// Sorts the addresses that other devices can open: first those on the way to the `world`, IPv4 first, last those of
/// containers and virtual machines.
fn sorted(
    mut found: Vec<(String, IpAddr)>,
    world: &[Option<IpAddr>],
    is_only_v4: bool,
) -> Vec<IpAddr> {
    found.retain(|(_, ip)| match ip {
        IpAddr::V4(ip) => !ip.is_loopback(),
        // A browser takes no address that is valid on one link alone.
        IpAddr::V6(ip) => !is_only_v4 && !ip.is_loopback() && !ip.is_unicast_link_local(),
    });
    found.sort_by_key(|(name, ip)| {
        let is_inner = INNER.iter().any(|inner| name.starts_with(inner));
        let is_self_assigned = matches!(ip, IpAddr::V4(ip) if ip.is_link_local());
        (
            is_inner,
            is_self_assigned,
            !world.contains(&Some(*ip)),
            ip.is_ipv6(),
            *ip,
        )
    });
    found.dedup_by_key(|(_, ip)| *ip);
    found.into_iter().map(|(_, ip)| ip).collect()
}

/// Draws a code with two modules in each character.
fn draw(code: &QrCode) -> String {
    let width = code.width();
    let colours = code.to_colors();
    let whole = width + 2 * QUIET;
    let is_light = |x: usize, y: usize| {
        let inside = |at: usize| at.checked_sub(QUIET).filter(|at| *at < width);
        match (inside(x), inside(y)) {
            (Some(x), Some(y)) => colours[y * width + x] == Color::Light,
            // Below the last row of an odd number nothing is drawn.
            _ => y < whole,
        }
    };
    // A console of Windows may not know the colours, and is dark.
    let (begin, end) = if cfg!(windows) {
        ("", "")
    } else {
        (COLOURS, "\x1b[0m")
    };
    let mut text = String::new();
    for y in (0..whole).step_by(2) {
        text += begin;
        text.extend(
            (0..whole).map(|x| match (is_light(x, y), is_light(x, y + 1)) {
                (true, true) => '█',
                (true, false) => '▀',
                (false, true) => '▄',
                (false, false) => ' ',
            }),
        );
        text += end;
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(all: &[(&str, &str)]) -> Vec<(String, IpAddr)> {
        let one = |(name, ip): &(&str, &str)| (name.to_string(), ip.parse().expect("an address"));
        all.iter().map(one).collect()
    }

    fn texts(all: &[IpAddr]) -> Vec<String> {
        all.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn the_address_on_the_way_to_the_world_is_first_and_a_bridge_of_docker_last() {
        let all = [
            ("lo", "127.0.0.1"),
            ("lo", "::1"),
            ("docker0", "172.17.0.1"),
            ("eth1", "169.254.3.4"),
            ("eth0", "10.0.0.7"),
            ("wlan0", "fe80::1"),
            ("wlan0", "fd00::9"),
            ("wlan0", "192.168.0.9"),
        ];
        let world = [Some("192.168.0.9".parse().expect("an address")), None];
        assert_eq!(
            texts(&sorted(found(&all), &world, false)),
            [
                "192.168.0.9",
                "10.0.0.7",
                "fd00::9",
                "169.254.3.4",
                "172.17.0.1"
            ]
        );
        assert_eq!(
            texts(&sorted(found(&all), &world, true)),
            ["192.168.0.9", "10.0.0.7", "169.254.3.4", "172.17.0.1"],
            "a page at 0.0.0.0 has no IPv6"
        );
    }

    #[test]
    fn a_page_of_this_computer_tells_once_how_a_phone_opens_it() {
        let bound = "127.0.0.1:20080".parse().expect("an address");
        let invitation = Invitation::new("http://127.0.0.1:20080/#token=12".to_owned(), bound);
        let told = invitation.for_terminal("listen = \"0.0.0.0:PORT\" in [page]");
        assert!(
            told.contains("; listen = \"0.0.0.0:20080\" in [page] opens"),
            "{told}"
        );
        assert_eq!(invitation.for_terminal(""), "");
    }

    #[test]
    fn a_page_at_one_address_has_a_code_of_this_address() {
        let bound = "192.0.2.7:81".parse().expect("an address");
        let invitation = Invitation::new("http://lab.example:81/#token=12".to_owned(), bound);
        let told = invitation.for_terminal("");
        let bare = |line: &str| line.trim_start_matches(COLOURS).to_owned();
        assert!(
            bare(&told).starts_with('█'),
            "no second line with it: {told}"
        );
        assert_eq!(
            invitation.clone().without_token().others,
            ["http://lab.example:81/"]
        );
        // The quiet zone: four modules at each side.
        let lines: Vec<&str> = told.lines().collect();
        for line in [lines[0], lines[1]] {
            let drawn = bare(line);
            let mut drawn = drawn.trim_end_matches("\x1b[0m").chars();
            assert!(drawn.all(|it| it == '█'), "{line}");
        }
        assert!(bare(lines[2]).starts_with("████ "), "{}", lines[2]);
    }
}
