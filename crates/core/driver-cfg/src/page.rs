//! The `[page]` table.

use std::path::PathBuf;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table, Value, shown};
use tickbus_net::{Address, Host};

/// The default port of a page.
const PORT: u16 = 20080;

/// The default time that signals stay forced when nobody looks.
const GRACE: Nanos = Nanos::from_secs(10);

/// The shortest time that can be stated: reloading a page interrupts it for a moment.
const LEAST_GRACE: Nanos = Nanos::from_secs(1);

/// The default memory of the history, in bytes.
const HISTORY: usize = 64 << 20;

/// The least and the most memory that the history can have, in MB.
const HISTORY_MB: std::ops::RangeInclusive<usize> = 1..=4096;

/// The longest path of a picture, in characters.
const PATH_LIMIT: usize = 1000;

/// The keys of the table.
pub(crate) const KEYS: &[Key] = &[
    Key::new(
        "listen",
        Shape::ADDRESS,
        "Where the page is served; port 0 lets the system choose one",
    )
    .or("\"127.0.0.1:20080\""),
    Key::new(
        "grace",
        Shape::Duration,
        "How long signals stay forced when no viewer has the token any more; at least 1s",
    )
    .or("\"10s\""),
    Key::new(
        "keep_forced",
        Shape::Boolean,
        "true: signals stay forced until they are released, or the driver closes",
    )
    .or("false"),
    Key::new(
        "picture",
        Shape::Pattern("\\S.*\\.[sS][vV][gG]"),
        "An SVG drawing of the machine, relative to the folder of this file",
    ),
    Key::new(
        "token_file",
        Shape::Label(PATH_LIMIT),
        "The file in which the token survives a restart, relative to the folder of this file",
    ),
    Key::new(
        "edit",
        Shape::Boolean,
        "true: the page edits this file, and the line takes its changes; on this computer alone",
    )
    .or("false"),
    Key::new(
        "history",
        Shape::Any(&[Shape::Pattern("[0-9]+ ?[MG]B"), Shape::Whole(0, 0)]),
        "The memory for every change of the last ticks, which the bar of time shows; 0 switches it off",
    )
    .or("\"64 MB\""),
];

/// The live page of a driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PageOptions {
    /// The address that serves the page; with port 0 the system chooses a port.
    pub listen: Address,
    /// How long signals stay forced once nobody with the token looks any more; `None` for as long as the driver runs.
    pub grace: Option<Nanos>,
    /// The picture of the machine as written in the file: relative to the folder of the driver.cfg.
    pub picture: Option<PathBuf>,
    /// The file that keeps the page's token across restarts, relative to the folder of the driver.cfg.
    pub token_file: Option<PathBuf>,
    /// True if the page edits the driver.cfg; the page then listens [on this computer alone](Self::listens_here).
    pub edit: bool,
    /// The memory for the ticks that the bar of time shows, in bytes; 0 for none.
    pub history: usize,
}

impl Default for PageOptions {
    /// Listens on port 20080 of this machine only, releases forced signals after 10 s, and has no picture.
    fn default() -> Self {
        Self {
            listen: Address::local(PORT),
            grace: Some(GRACE),
            picture: None,
            token_file: None,
            edit: false,
            history: HISTORY,
        }
    }
}

impl PageOptions {
    pub(super) fn read(mut table: Table<'_>) -> Option<Self> {
        let [
            listen,
            grace,
            keep_forced,
            picture,
            token_file,
            edit,
            history,
        ] = [
            "listen",
            "grace",
            "keep_forced",
            "picture",
            "token_file",
            "edit",
            "history",
        ]
        .map(|key| table.take(key));
        table.finish();
        let usual = Self::default();
        let listen = listen.map_or(Some(usual.listen), |value| Address::read(&value));
        let keeps = keep_forced.as_ref().map_or(Some(false), Value::boolean);
        let why = "a page that is loaded again is away for a moment";
        let stated = grace
            .as_ref()
            .map(|value| value.duration_from(LEAST_GRACE, why));
        if let (Some(value), Some(true)) = (&grace, keeps) {
            value.wrong(
                "signals that stay forced have no \"grace\"",
                "remove it, or \"keep_forced\"",
            );
            return None;
        }
        let picture = picture.map(|value| {
            let right = "name an SVG file, such as \"rig.svg\"";
            let file = PathBuf::from(value.label(PATH_LIMIT, right)?);
            let is_svg = file
                .extension()
                .is_some_and(|ending| ending.eq_ignore_ascii_case("svg"));
            if !is_svg {
                let what = format!("\"{}\" does not end in .svg", file.display());
                value.wrong(
                    what,
                    "name a drawing in SVG; docs/live-page.md tells how one is made",
                );
            }
            is_svg.then_some(file)
        });
        let token_file = token_file.map(|value| {
            let right = "name a file, such as \"page.token\"; it is made";
            value.label(PATH_LIMIT, right).map(PathBuf::from)
        });
        let edits = edit.as_ref().map_or(Some(false), Value::boolean);
        let listen = listen?;
        if let (Some(value), Some(true)) = (&edit, edits)
            && !Self::is_here(&listen)
        {
            value.wrong(
                format!("this page is served on {listen}, and other computers must not edit this file"),
                "listen on 127.0.0.1, and let others in by a tunnel (ssh -L), or remove \"edit\": a driver.cfg names \
                 libraries, which run as you",
            );
            return None;
        }
        let grace = match (keeps?, stated) {
            (true, _) => None,
            (false, None) => usual.grace,
            (false, Some(stated)) => Some(stated?),
        };
        Some(Self {
            listen,
            grace,
            picture: match picture {
                None => None,
                Some(picture) => Some(picture?),
            },
            token_file: match token_file {
                None => None,
                Some(file) => Some(file?),
            },
            edit: edits?,
            history: history.map_or(Some(usual.history), |value| history_of(&value))?,
        })
    }

    /// Returns true if the page listens on this computer alone.
    pub fn listens_here(&self) -> bool {
        Self::is_here(&self.listen)
    }

    fn is_here(listen: &Address) -> bool {
        match &listen.host {
            Host::Ip(ip) => ip.is_loopback(),
            Host::Name(name) => name.eq_ignore_ascii_case("localhost"),
        }
    }
}

/// The memory of the history in bytes, written as `64 MB`, `1 GB` or 0.
fn history_of(value: &Value<'_>) -> Option<usize> {
    let right = format!(
        "write the memory in quotes with its unit, from \"{} MB\" to \"{} GB\", or 0 for no history",
        HISTORY_MB.start(),
        HISTORY_MB.end() / 1024
    );
    if value.is_integer() && value.written() == "0" {
        return Some(0);
    }
    let text = value.text(&right)?;
    let in_unit = |unit, factor| {
        let number: &str = text.strip_suffix(unit)?;
        let number = number.strip_suffix(' ').unwrap_or(number);
        let is_plain = number.bytes().all(|byte| byte.is_ascii_digit());
        let number = number.parse::<usize>().ok().filter(|_| is_plain)?;
        number.checked_mul(factor)
    };
    let megabytes = in_unit("MB", 1).or_else(|| in_unit("GB", 1024));
    let megabytes = megabytes.filter(|megabytes| HISTORY_MB.contains(megabytes));
    if megabytes.is_none() {
        let what = format!("\"{}\" is no memory for the history", shown(text));
        value.wrong(what, right);
    }
    megabytes?.checked_mul(1 << 20)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Config;

    fn read(page: &str) -> Result<Option<PageOptions>, String> {
        let text = format!(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\n\
             [[signal]]\nname = \"a\"\naddress = \"%IX0.0\"\n{page}"
        );
        let config = Config::parse("driver.cfg", &text, &crate::KINDS);
        config
            .map(|config| config.page)
            .map_err(|wrong| wrong.to_string())
    }

    #[test]
    fn a_page_has_what_is_stated_and_else_what_is_usual() {
        assert_eq!(read(""), Ok(None));
        assert_eq!(read("[page]\n"), Ok(Some(PageOptions::default())));
        let page = read(
            "[page]\nlisten = \"0.0.0.0:0\"\ngrace = \"1min\"\npicture = \"pictures/rig.svg\"\n\
             token_file = \"page.token\"\n",
        );
        let page = page.expect("right").expect("there");
        assert_eq!(page.listen.to_string(), "0.0.0.0:0");
        assert_eq!(page.grace, Some(Nanos::from_secs(60)));
        assert_eq!(page.picture, Some(PathBuf::from("pictures/rig.svg")));
        assert_eq!(page.token_file, Some(PathBuf::from("page.token")));
        assert!(!page.edit);
        for listen in ["127.0.0.1:0", "[::1]:0", "localhost:0"] {
            let page = read(&format!("[page]\nlisten = \"{listen}\"\nedit = true\n"));
            assert!(page.expect("right").expect("there").edit, "{listen}");
        }
        for (history, bytes) in [
            ("\"1 MB\"", 1 << 20),
            ("\"2GB\"", 2 << 30),
            ("0", 0),
            ("\"64 MB\"", HISTORY),
        ] {
            let page = read(&format!("[page]\nhistory = {history}\n")).expect("right");
            assert_eq!(page.expect("there").history, bytes, "{history}");
        }
        let keeps = read("[page]\nkeep_forced = true\n").expect("right");
        assert_eq!(keeps.expect("there").grace, None);
    }

    #[test]
    fn mistakes_are_told_where_they_stand() {
        for (page, told) in [
            ("[page]\nlisten = \"20080\"\n", "driver.cfg:11:10: "),
            ("[page]\nlisten = \"localhost\"\n", "has no port"),
            ("[page]\ngrace = \"1ms\"\n", "is away for a moment"),
            ("[page]\ngrace = 5\n", "driver.cfg:11:9: "),
            (
                "[page]\nkeep_forced = true\ngrace = \"1min\"\n",
                "have no \"grace\"",
            ),
            ("[page]\nkeep_forced = 1\n", "driver.cfg:11:15: "),
            ("[page]\nedit = 1\n", "driver.cfg:11:8: "),
            (
                "[page]\nlisten = \"0.0.0.0:0\"\nedit = true\n",
                "driver.cfg:12:8: this page is served on 0.0.0.0:0, and other computers",
            ),
            (
                "[page]\nlisten = \"labpc:80\"\nedit = true\n",
                "other computers",
            ),
            ("[page]\nhistory = 64\n", "driver.cfg:11:11: "),
            ("[page]\nhistory = \"64\"\n", "is no memory for the history"),
            ("[page]\nhistory = \"5 GB\"\n", "from \"1 MB\" to \"4 GB\""),
            (
                "[page]\nhistory = \"-1 MB\"\n",
                "is no memory for the history",
            ),
            (
                "[page]\nhistory = \"1 KB\"\n",
                "is no memory for the history",
            ),
            ("[page]\nhistory = \"é\"\n", "is no memory for the history"),
            ("[page]\npicture = \"rig.png\"\n", "does not end in .svg"),
            (
                "[page]\npictures = \"rig.svg\"\n",
                "did you mean \"picture\"?",
            ),
            ("[[page]]\n", "driver.cfg:10:"),
        ] {
            let wrong = read(page).expect_err(page);
            assert!(wrong.contains(told), "{wrong}");
        }
    }
}
