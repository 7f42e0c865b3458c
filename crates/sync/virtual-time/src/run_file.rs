//! The file of a run, as `tickbus sync` reads it.

use std::path::{Path, PathBuf};

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Mistakes, Table, Value, load_text, parse_text};

use crate::declaration::{LONGEST_NAME, check_name};
use crate::server::MOST_CLIENTS;
use crate::{Exchange, Meeting, Pacing, Settings, StartCondition};

/// The content of a run file.
#[derive(Clone, Debug, PartialEq)]
pub struct RunFile {
    /// The settings of the server.
    pub settings: Settings,
    /// The meeting place of server and clients.
    pub meeting: Meeting,
    /// The script with the server's logic.
    pub logic: Option<PathBuf>,
}

impl RunFile {
    /// Reads the file at `path`.
    ///
    /// # Errors
    ///
    /// With every mistake in it.
    pub fn load(path: &Path) -> Result<Self, Mistakes> {
        let text = load_text(path)?;
        let folder = path.parent().unwrap_or_else(|| Path::new(""));
        Self::parse(&path.display().to_string(), &text, folder)
    }

    /// Reads the text of a run file; its paths are relative to `folder`.
    ///
    /// # Errors
    ///
    /// The same as for [`load`](Self::load).
    pub fn parse(file: &str, text: &str, folder: &Path) -> Result<Self, Mistakes> {
        parse_text(file, text, |mut root| {
            let right = "write a [sync] table with step, clients and listen";
            let sync = root.require("sync", right);
            root.finish();
            read(sync?.table("[sync]", right)?, folder)
        })
    }
}

fn read(mut table: Table<'_>, folder: &Path) -> Option<RunFile> {
    let step = table.require("step", "add the server's step, such as step = \"1ms\"");
    let clients = table.require(
        "clients",
        "add clients = [\"plc\", \"machine\"], or their number",
    );
    let listen = table.take("listen");
    let shared_memory = table.take("shared_memory");
    let until = table.take("until");
    let pace = table.take("pace");
    let hang = table.take("hang");
    let join = table.take("join");
    let rejoin = table.take("rejoin");
    let logic = table.take("logic");
    let direct = table.take("direct");
    table.require_one_of(
        &["listen", "shared_memory"],
        "add listen = \"127.0.0.1:20060\", or shared_memory = \"cell\" for processes of this computer",
    );
    if let (Some(_), Some(both)) = (&listen, &shared_memory) {
        both.wrong(
            "\"shared_memory\" stands beside \"listen\"",
            "remove one of them: all clients of a run meet the server in the same way",
        );
    }
    if let (Some(direct), Some(_)) = (&direct, &shared_memory) {
        direct.wrong(
            "\"direct\" stands beside \"shared_memory\"",
            "remove it: through shared memory the server is no detour",
        );
    }
    if let (Some(_), Some(rejoin)) = (&shared_memory, &rejoin) {
        rejoin.wrong(
            "\"rejoin\" stands beside \"shared_memory\"",
            "write listen in place of shared_memory: only over TCP a member can come back",
        );
    }
    if let (Some(_), Some(rejoin)) = (&direct, &rejoin) {
        rejoin.wrong(
            "\"rejoin\" stands beside \"direct\"",
            "remove one of them: the server keeps for a member that comes back what it passes on itself",
        );
    }
    table.finish();

    let meeting = match (listen, shared_memory) {
        (Some(listen), _) => Meeting::read(&listen),
        (None, name) => {
            name.and_then(|value| Meeting::read_name(&value).map(Meeting::SharedMemory))
        }
    };
    let step = step.and_then(|value| value.duration());
    let start = clients.and_then(|value| start_condition(&value));
    let steps = until.map_or(Some(None), |value| steps(&value, step).map(Some));
    let pacing = pace.map_or(Some(Pacing::Fast), |value| pacing(&value));
    let hang = hang.map_or(Some(None), |value| value.duration().map(Some));
    let join = join.map_or(Some(None), |value| value.duration().map(Some));
    let rejoin = rejoin.map_or(Some(None), |value| value.duration().map(Some));
    let logic = logic.map_or(Some(None), |value| {
        let path = value.text("write the path of the script, as seen from this file")?;
        Some(Some(folder.join(path)))
    });
    let direct = direct.map_or(Some(false), |value| value.boolean());
    let rejoin = rejoin?;
    let exchange = if direct? {
        Exchange::Direct
    } else {
        Exchange::ByServer { rejoin }
    };
    let standard = Settings::new(step?, start?);
    let settings = Settings {
        steps: steps?,
        pacing: pacing?,
        hang: hang?.unwrap_or(standard.hang),
        join: join?.unwrap_or(standard.join),
        exchange,
        ..standard
    };
    Some(RunFile {
        settings,
        meeting: meeting?,
        logic: logic?,
    })
}

fn start_condition(value: &Value<'_>) -> Option<StartCondition> {
    let right = "write the names of the clients, such as [\"plc\", \"machine\"], or their number";
    if value.is_integer() {
        let count = value.whole(1..=MOST_CLIENTS as i128)?;
        return usize::try_from(count).ok().map(StartCondition::Count);
    }
    let list = value.list(right)?;
    if !(1..=MOST_CLIENTS).contains(&list.len()) {
        let what = format!("\"clients\" has {} names", list.len());
        value.wrong(what, format!("a run has 1 to {MOST_CLIENTS} clients"));
        return None;
    }
    let mut names: Vec<String> = Vec::new();
    let mut is_right = true;
    for element in &list {
        let Some(name) = element.label(LONGEST_NAME, right) else {
            is_right = false;
            continue;
        };
        if let Err(mistake) = check_name("client", name) {
            element.refuse(mistake);
            is_right = false;
        } else if names.iter().any(|other| other == name) {
            let what = format!("the client \"{name}\" stands here twice");
            element.wrong(what, "name each client once");
            is_right = false;
        }
        names.push(name.to_owned());
    }
    is_right.then_some(StartCondition::Names(names))
}

/// The number of steps until this time.
fn steps(value: &Value<'_>, step: Option<Nanos>) -> Option<u64> {
    let until = value.duration()?;
    let step = step?;
    if until.0 % step.0 != 0 {
        let (below, above) = (until.0 / step.0, until.0 / step.0 + 1);
        value.wrong(
            format!("\"until\" is {until}, which is no whole number of steps of {step}"),
            match below {
                0 => format!("write \"{step}\""),
                _ if step.0.checked_mul(above).is_none() => {
                    format!("write \"{}\"", step.times(below))
                }
                _ => format!(
                    "write \"{}\" or \"{}\"",
                    step.times(below),
                    step.times(above)
                ),
            },
        );
        return None;
    }
    Some((until.0 / step.0).unsigned_abs())
}

fn pacing(value: &Value<'_>) -> Option<Pacing> {
    let right = "write \"fast\", or a number: 1 is real time, 10 is ten times as fast";
    if value.as_text() == Some("fast") {
        return Some(Pacing::Fast);
    }
    let factor = value.number(right)?;
    if factor <= 0.0 {
        value.wrong(format!("\"pace\" is {}", value.written()), right);
        return None;
    }
    Some(Pacing::Times(factor))
}

#[cfg(test)]
mod tests {
    use tickbus_net::Address;

    use super::*;

    fn parse(text: &str) -> Result<RunFile, Mistakes> {
        RunFile::parse("cell.toml", text, Path::new("folder"))
    }

    #[test]
    fn a_file_says_how_the_server_runs() {
        let file = parse(
            "[sync]\nlisten = \"127.0.0.1:0\"\nstep = \"2ms\"\nclients = [\"plc\", \"robot\"]\nuntil = \"1s\"\n\
             pace = 2.5\nhang = \"3s\"\njoin = \"1min\"\nrejoin = \"30s\"\nlogic = \"cell.rhai\"\n",
        )
        .expect("it is right");
        let names = ["plc", "robot"].map(str::to_owned).to_vec();
        let expected = Settings {
            steps: Some(500),
            pacing: Pacing::Times(2.5),
            hang: Nanos::from_secs(3),
            join: Nanos::from_secs(60),
            exchange: Exchange::ByServer {
                rejoin: Some(Nanos::from_secs(30)),
            },
            ..Settings::new(Nanos::from_millis(2), StartCondition::Names(names))
        };
        assert_eq!(file.settings, expected);
        assert_eq!(file.meeting, Meeting::Tcp(Address::local(0)));
        assert_eq!(file.logic.as_deref(), Some(Path::new("folder/cell.rhai")));
        let local = parse("sync = { listen = \"unix:/run/cell\", step = \"1ms\", clients = 2 }\n");
        assert_eq!(
            local.expect("it is right").meeting.to_string(),
            "unix:/run/cell"
        );
        let file = parse("sync = { shared_memory = \"cell\", step = \"1ms\", clients = 2 }\n");
        let file = file.expect("it is right");
        let expected = Settings::new(Nanos::from_millis(1), StartCondition::Count(2));
        assert_eq!(file.settings, expected);
        assert_eq!(file.meeting, Meeting::SharedMemory("cell".to_owned()));
    }

    #[test]
    fn every_mistake_is_told_at_its_place() {
        let mistakes = parse(
            "[sync]\nstep = \"3ms\"\nclients = [\"a\", \"a\", \" b\"]\nuntil = \"10ms\"\npace = -1\nhang = \"0s\"\n\
             listen = \"nowhere\"\nshared_memory = \"x\"\nlogik = \"x\"\n[other]\n",
        );
        let text = mistakes.expect_err("it is wrong").to_string();
        let expected = [
            "cell.toml:3:17: the client \"a\" stands here twice; name each client once",
            "cell.toml:3:22: element 3 of \"clients\" has blanks around it: \" b\"; write \"b\"",
            "cell.toml:4:9: \"until\" is 10ms, which is no whole number of steps of 3ms; write \"9ms\" or \"12ms\"",
            "cell.toml:5:8: \"pace\" is -1; write \"fast\", or a number: 1 is real time, 10 is ten times as fast",
            "cell.toml:6:8: \"hang\" is no time at all; write a longer duration",
            "cell.toml:7:10: the address \"nowhere\" has no port; write a host and a port, such as \"127.0.0.1:20030\"",
            "cell.toml:8:17: \"shared_memory\" stands beside \"listen\"; remove one of them: all clients of a run meet \
             the server in the same way",
            "cell.toml:9:1: unknown key \"logik\" in [sync]; did you mean \"logic\"?",
            "cell.toml:10:2: unknown key \"other\" in the file; keys here are sync",
        ];
        assert_eq!(text, expected.join("\n"));
    }

    #[test]
    fn a_run_shorter_than_a_step_is_told_to_have_one() {
        let text =
            "[sync]\nstep = \"1ms\"\nuntil = \"500us\"\nlisten = \"127.0.0.1:0\"\nclients = 1\n";
        let told = parse(text).expect_err("it is wrong").to_string();
        assert!(
            told.ends_with("whole number of steps of 1ms; write \"1ms\""),
            "{told}"
        );
    }

    #[test]
    fn a_run_that_ends_with_virtual_time_is_told_the_last_whole_step() {
        let text = "[sync]\nstep = \"1ms\"\nuntil = \"9223372036854775807ns\"\nlisten = \"127.0.0.1:0\"\nclients = 1\n";
        let told = parse(text).expect_err("it is wrong").to_string();
        assert!(
            told.ends_with("whole number of steps of 1ms; write \"9223372036854ms\""),
            "{told}"
        );
    }

    #[test]
    fn what_is_missing_is_told_with_what_to_write() {
        let text = parse("[sync]\n").expect_err("it is empty").to_string();
        for part in [
            "[sync] has no \"step\"; add the server's step",
            "[sync] has no \"clients\"; add clients",
            "[sync] has no \"listen\" and no \"shared_memory\"; add listen",
        ] {
            assert!(text.contains(part), "{part} in {text}");
        }
        for (clients, part) in [
            ("0", "\"clients\" is 0"),
            ("[]", "\"clients\" has 0 names"),
            ("\"plc\"", "\"clients\" is a text"),
        ] {
            let text = format!("[sync]\nstep=\"1ms\"\nlisten=\"127.0.0.1:0\"\nclients={clients}\n");
            let told = parse(&text).expect_err("it is wrong").to_string();
            assert!(told.contains(part), "{part} in {told}");
        }
    }
}
