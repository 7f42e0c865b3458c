//! The verdict on time: delay, jitter, slow sampling and races in each direction, from the statistics of one end.
//!
//! These are the four ways in which a link between a simulation and a PLC falsifies a run (H. Carlsson, B. Svensson,
//! F. Danielsson and B. Lennartson, "Methods for Reliable Simulation-Based PLC Code Verification", IEEE Transactions on
//! Industrial Informatics 8 (2012) 267).

use maud::{Markup, html};
use tickbus_base::time::Nanos;

use super::RunStatistics;
use super::html::{count, counted, span};
use super::tables;

/// The two directions, and the statistics' keys of what was swallowed there.
const WAYS: [(&str, &str); 2] = [
    ("machine to PLC", "swallowed_inputs"),
    ("PLC to machine", "swallowed_outputs"),
];

/// A part of the way of values from one side to the other, as far as this end sees it.
struct Stage {
    /// Index of the direction.
    way: usize,
    /// From where to where.
    part: &'static str,
    /// Least, median and greatest delay; `None` if the statistics have none.
    delay: Option<[Nanos; 3]>,
}

impl Stage {
    /// The absolute jitter of real-time theory: greatest minus least delay.
    fn jitter(&self) -> Option<Nanos> {
        self.delay.map(|[least, _, greatest]| greatest - least)
    }
}

/// The stages that the statistics tell of; none if they are not those of one end of a line.
fn stages(statistics: &RunStatistics) -> Vec<Stage> {
    let (written, read) = match statistics.get("role") {
        Some("device") => (0, 1),
        Some("controller") => (1, 0),
        _ => return Vec::new(),
    };
    let stage = |way, part, key| Stage {
        way,
        part,
        delay: delay(statistics, key),
    };
    let has = |key| statistics.get(key).is_some();
    match (has("ticks"), has("plc.scans")) {
        // A simulation with the program in the same process.
        (true, true) => vec![
            stage(written, "from tick to bus", "sent_age"),
            stage(written, "from bus to scan", "plc.age"),
            stage(read, "from bus to tick", "age"),
        ],
        (true, false) => vec![
            stage(written, "from tick to bus", "sent_age"),
            stage(read, "from bus to tick", "age"),
        ],
        (false, _) => vec![
            stage(written, "from scan to bus", "sent_age"),
            stage(read, "from bus to scan", "plc.age"),
        ],
    }
}

fn delay(statistics: &RunStatistics, key: &str) -> Option<[Nanos; 3]> {
    let micros = |value| {
        let text = statistics.get(&format!("{key}.{value}_us"))?;
        let micros: f64 = text.parse().ok()?;
        #[expect(clippy::cast_possible_truncation, reason = "at most an hour")]
        let nanos = (micros * 1e3).round() as i64;
        Some(Nanos(nanos))
    };
    Some([micros("min")?, micros("p50")?, micros("max")?])
}

/// Says if signals that changed in one tick can reach the PLC in different scans.
fn races(statistics: &RunStatistics) -> &'static str {
    let has = |key| statistics.get(key).is_some();
    if (has("ticks") && has("plc.scans")) || has("sdsp.hash") {
        "Races: none, since the program gets all signals of a tick at once."
    } else {
        "Races: not measured, since this end does not see which telegrams a scan of the PLC combines."
    }
}

fn swallowed(statistics: &RunStatistics, way: usize) -> u64 {
    let text = statistics.get(WAYS[way].1);
    text.and_then(|text| text.parse().ok()).unwrap_or_default()
}

/// The table of the page.
pub(super) fn table(statistics: &RunStatistics) -> Markup {
    let stages = stages(statistics);
    let rows = html! {
        @for stage in &stages {
            tr {
                th scope="row" { (WAYS[stage.way].0) ", " (stage.part) }
                @let [least, median, greatest] = match stage.delay {
                    Some(delay) => delay.map(span),
                    None => ["–"; 3].map(str::to_owned),
                };
                td.n { (least) } td.n { (median) } td.n { (greatest) }
                td.n { (stage.jitter().map_or_else(|| "–".to_owned(), span)) }
                td.n { (count(swallowed(statistics, stage.way))) }
            }
        }
    };
    let headings = [
        "Direction",
        ">Least delay",
        ">Median",
        ">Greatest",
        ">Jitter",
        ">Swallowed",
    ];
    html! {
        @if !stages.is_empty() {
            (tables::table(
                "wide",
                "Jitter is the greatest delay minus the least; swallowed are the changes that were sampled too slowly",
                &headings,
                &rows,
            ))
            p { (races(statistics)) }
        }
    }
}

impl RunStatistics {
    /// The verdict on time as lines of text: each part of the way with its delay and jitter, then what was swallowed, and
    /// races. Empty if these are not the statistics of one end of a line.
    pub fn time(&self) -> Vec<String> {
        let stages = stages(self);
        if stages.is_empty() {
            return Vec::new();
        }
        let delays = stages.iter().filter_map(|stage| {
            let ([least, median, greatest], jitter) = (stage.delay?, stage.jitter()?);
            Some(format!(
                "{}, {}: delay {} to {}, median {}, jitter {}",
                WAYS[stage.way].0,
                stage.part,
                span(least),
                span(greatest),
                span(median),
                span(jitter)
            ))
        });
        let swallowed = WAYS.iter().enumerate().map(|(way, (name, _))| {
            let changes = counted(swallowed(self, way), "change", "changes");
            format!("{name}: {changes} swallowed")
        });
        let races = std::iter::once(races(self).to_owned());
        delays.chain(swallowed).chain(races).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENT: &str =
        "sent_age.count=4\nsent_age.min_us=100.0\nsent_age.p50_us=400.0\nsent_age.max_us=1100.0\n";

    fn time(text: &str) -> Vec<String> {
        RunStatistics::read(text).time()
    }

    #[test]
    fn each_direction_has_its_delay_its_jitter_and_its_swallowed_changes() {
        let device = format!("role=device\nticks=9\n{SENT}swallowed_inputs=3\nage.count=0\n");
        assert_eq!(
            time(&device),
            [
                "machine to PLC, from tick to bus: delay 100 µs to 1.1 ms, median 400 µs, jitter 1 ms",
                "machine to PLC: 3 changes swallowed",
                "PLC to machine: 0 changes swallowed",
                "Races: not measured, since this end does not see which telegrams a scan of the PLC combines.",
            ]
        );
        let program = format!("role=controller\nplc.scans=9\n{SENT}swallowed_outputs=1\n");
        let program = time(&program);
        assert!(program[0].starts_with("PLC to machine, from scan to bus: delay 100 µs"));
        assert_eq!(program[2], "PLC to machine: 1 change swallowed");
        let hosted = "role=device\nticks=9\nplc.scans=9\nplc.age.min_us=0.0\nplc.age.p50_us=1.0\nplc.age.max_us=2.0\n";
        let hosted = time(hosted);
        assert!(hosted[0].starts_with("machine to PLC, from bus to scan: delay 0 ns to 2 µs"));
        assert!(hosted[3].starts_with("Races: none"), "{hosted:?}");
        assert!(time("ticks=9\nplc.scans=7\n").is_empty());
    }

    #[test]
    fn the_table_has_a_row_for_each_part_of_the_way() {
        let page = |text: &str| table(&RunStatistics::read(text)).into_string();
        let found = page(&format!("role=device\nticks=9\n{SENT}swallowed_inputs=3\n"));
        assert!(
            found.contains("machine to PLC, from tick to bus</th><td class=\"n\">100 µs</td>"),
            "{found}"
        );
        assert!(found.contains("PLC to machine, from bus to tick</th><td class=\"n\">–</td>"));
        assert_eq!(page("ticks=9\n"), "");
    }
}
