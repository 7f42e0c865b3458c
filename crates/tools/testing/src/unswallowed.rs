//! `nothing swallowed`: the expectation that no change came and went before the other side took a frame.

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_driver::Driver;
use tickbus_fieldbus::faults::unknown;
use tickbus_image::signal::SignalTable;

use super::watch::moment;

/// The expectation on all counted signals; with [`OF`] and a name after it, on one of them.
const ALL: &str = "nothing swallowed";
const OF: &str = "nothing swallowed of ";

/// Returns true if a text that is no condition on a signal means this expectation.
pub(super) fn is_meant(text: &str) -> bool {
    let text = text.trim().to_lowercase();
    text.starts_with("nothing") || text.contains("swal")
}

/// The signals of `nothing swallowed` and `nothing swallowed of NAME`; `None` if the text has another form.
pub(super) fn signals_of(text: &str, table: &SignalTable) -> Option<Result<Vec<usize>, Mistake>> {
    let text = text.trim();
    if table.position(text).is_some() {
        return None;
    }
    if text == ALL {
        let signals = table.signals.iter();
        // A latch loses nothing either.
        if !signals
            .clone()
            .any(|signal| signal.counts_swallowed() || signal.latch.is_some())
        {
            return Some(Err(Mistake::new(
                "no signal of this driver.cfg is counted",
                "set count_swallowed = true for those that matter",
            )));
        }
        let counted = signals.enumerate();
        let counted = counted.filter(|(_, signal)| signal.counts_swallowed());
        return Some(Ok(counted.map(|(index, _)| index).collect()));
    }
    let name = text.strip_prefix(OF)?.trim();
    Some(one_signal(name, table).map(|signal| vec![signal]))
}

fn one_signal(name: &str, table: &SignalTable) -> Result<usize, Mistake> {
    let index = table.position(name).ok_or_else(|| unknown(name, table))?;
    let signal = &table.signals[index];
    if signal.counts_swallowed() {
        return Ok(index);
    }
    Err(if signal.latch.is_some() {
        let what = format!("the latch of \"{}\" loses no change", shown(name));
        Mistake::new(what, "leave it out")
    } else {
        let what = format!("changes of \"{}\" are not counted", shown(name));
        Mistake::new(what, "set count_swallowed = true for it in the driver.cfg")
    })
}

/// The mistake in a text that means this expectation, and is at the wrong place or misspelt.
pub(super) fn mistake(text: &str, table: &SignalTable) -> Mistake {
    if signals_of(text, table).is_some() {
        return Mistake::new(
            format!("\"{}\" can only be expected", shown(text.trim())),
            format!("write expect = \"{ALL}\", or always = \"{ALL}\""),
        );
    }
    Mistake::new(
        format!("\"{}\" is no condition", shown(text.trim())),
        format!("write \"{ALL}\", or \"{OF}NAME\" for one signal"),
    )
}

/// The ticks at which changes of signals were swallowed first.
#[derive(Debug, Default)]
pub(super) struct First(Vec<Option<u64>>);

impl First {
    /// Watches a table of this many signals from the first tick on.
    pub(super) fn of(signals: usize) -> Self {
        Self(vec![None; signals])
    }

    /// Looks at the counts after `tick`.
    pub(super) fn look(&mut self, driver: &Driver, tick: u64) {
        if self.0.is_empty() {
            return;
        }
        for (signal, _) in driver.swallowed().counts().iter() {
            self.0[signal].get_or_insert(tick);
        }
    }

    /// A line for each of `signals` whose changes were swallowed, and the signal.
    pub(super) fn lines(
        &self,
        signals: &[usize],
        driver: &Driver,
        step: Nanos,
    ) -> Vec<(usize, String)> {
        let found = driver.swallowed().sentences().into_iter();
        let found = found.filter(|(signal, _)| signals.contains(signal));
        let line = |(signal, mut sentence): (usize, String)| {
            if let Some(Some(tick)) = self.0.get(signal) {
                sentence.push_str("; the first at ");
                sentence.push_str(&moment(*tick, step));
            }
            (signal, sentence)
        };
        found.map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_driver_cfg::{Config, Kinds};

    fn table(signals: &[(&str, &str, &str)]) -> SignalTable {
        let mut text =
            "[driver]\nid = 1\nname = \"T\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"l\"\n"
                .to_owned();
        for (name, address, more) in signals {
            let section = [
                "[[signal]]\nname = \"",
                name,
                "\"\naddress = \"",
                address,
                "\"\n",
                more,
                "\n",
            ];
            text.push_str(&section.concat());
        }
        Config::parse("t", &text, &Kinds::LOOPBACK)
            .unwrap_or_else(|mistakes| panic!("{mistakes}"))
            .table
    }

    #[test]
    fn what_cannot_be_swallowed_is_not_expected_and_what_is_not_counted_is_told() {
        let latched = ("Latched", "%IX0.0", "latch = \"rising\"");
        let all = table(&[
            latched,
            ("Plain", "%IX0.1", ""),
            ("Number", "%IW2", ""),
            (
                "nothing swallowed of it",
                "%IX0.2",
                "count_swallowed = false",
            ),
        ]);
        let of = |text: &str, table: &SignalTable| {
            signals_of(text, table).map(|found| found.map_err(|mistake| mistake.to_string()))
        };
        assert_eq!(of(" nothing swallowed ", &all), Some(Ok(vec![1])));
        assert_eq!(of("nothing swallowed of Plain", &all), Some(Ok(vec![1])));
        assert_eq!(of("nothing swallowed of it", &all), None, "it is a signal");
        assert_eq!(of("Plain", &all), None);
        assert_eq!(
            of("nothing swallowed of Latched", &all),
            Some(Err(
                "the latch of \"Latched\" loses no change; leave it out".to_owned()
            ))
        );
        assert_eq!(
            of("nothing swallowed", &table(&[latched])),
            Some(Ok(vec![]))
        );
        let numbers = of("nothing swallowed", &table(&[("Number", "%IW2", "")]));
        let none = numbers
            .expect("it is meant")
            .expect_err("nothing is counted");
        assert!(
            none.starts_with("no signal of this driver.cfg is counted; set"),
            "{none}"
        );
    }
}
