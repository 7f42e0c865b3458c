//! PROFIBUS stations: what a request costs in the core with 1 to 100 of them on the line; and on a pseudo-terminal, as
//! pyprofibus drives them, against answers made in advance, in alternating rounds of one run: answers that are sent at
//! once, as no station may, and answers that wait for the 11 bits (22 us) that the standard asks for.
//!
//! Medians over the rounds; prints one `rust NAME VALUE` per line on stdout. Pin it to one core from outside.
#![allow(missing_docs, reason = "a bench")]

#[cfg(unix)]
#[path = "../tests/peers/pty.rs"]
mod pty;

#[cfg(not(unix))]
fn main() {}

#[cfg(unix)]
fn main() {
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    core::run(measured);
    line::run(measured);
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Requests and answers without any port.
#[cfg(unix)]
mod core {
    use std::time::Instant;

    use tickbus::fieldbus::profibus::telegram::{Control, DATA_LIMIT, Frame};
    use tickbus::fieldbus::profibus::{
        Acyclic, Configuration, Event, Identity, Process, Segment, State, Station, UserParameters,
    };
    use tickbus::time::Nanos;

    struct Machine;

    impl Process for Machine {
        fn inputs(&mut self, _: u8, _: Nanos, inputs: &mut [u8]) -> bool {
            inputs.fill(1);
            true
        }
        fn delivered(&mut self, _: u8) {}
        fn outputs(&mut self, _: u8, _: Nanos, _: &[u8]) {}
        fn alive(&mut self, _: u8, _: Nanos) {}
        fn tell(&mut self, _: u8, _: Nanos, _: Event) {}
    }

    fn telegram(to: u8, control: u8, sap: Option<u8>, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        Frame {
            destination: to,
            source: 125,
            control: Control(control),
            dsap: sap,
            ssap: sap.map(|_| 62),
            data,
        }
        .append(&mut bytes);
        bytes
    }

    fn exchanging(stations: u8) -> Segment {
        let station = |address| {
            let identity = Identity {
                ident: 0x80E0,
                configuration: Configuration::of_sizes(8, 8),
                user: UserParameters::default(),
                sync: true,
                freeze: true,
                fail_safe: false,
                dpv1: false,
                max_diagnosis: DATA_LIMIT,
                acyclic: Acyclic::default(),
            };
            Station::new(address, identity)
        };
        let mut line = Segment::new(500_000, (0..stations).map(station).collect());
        let mut reply = Vec::new();
        for address in 0..stations {
            for bytes in [
                telegram(address, 0x49, None, &[]),
                vec![0xDC, 125, 125],
                telegram(address, 0x6D, Some(61), &[0x80, 0, 0, 11, 0x80, 0xE0, 0]),
                telegram(address, 0x5D, Some(62), &[0x17, 0x27]),
            ] {
                let heard = line.hear(Nanos(0), &bytes[..], &mut Machine, &mut reply);
                heard.expect("free addresses");
            }
        }
        assert!(
            line.stations()
                .all(|station| station.state() == State::DataExch)
        );
        line
    }

    pub(super) fn run(measured: bool) {
        let (rounds, requests) = if measured { (25, 200_000) } else { (1, 200) };
        let mut costs = Vec::new();
        for stations in [1, 10, 100] {
            let mut line = exchanging(stations);
            let both = [0x5D, 0x7D].map(|control| {
                let ask = |address| telegram(address, control, None, &[7; 8]);
                (0..stations).map(ask).collect::<Vec<_>>()
            });
            let mut reply = Vec::new();
            let spans = (0..rounds).map(|_| {
                let begun = Instant::now();
                let mut asked = 0;
                'round: loop {
                    for telegrams in &both {
                        for bytes in telegrams {
                            let heard = line.hear(Nanos(0), &bytes[..], &mut Machine, &mut reply);
                            assert!(heard.is_ok_and(|heard| heard.answer.is_some()));
                            asked += 1;
                            if asked == requests {
                                break 'round;
                            }
                        }
                    }
                }
                begun.elapsed().as_secs_f64() / f64::from(requests)
            });
            let cost = super::median(spans.collect());
            println!("rust profibus.core.{stations} {:.0}", 1.0 / cost);
            costs.push(cost);
        }
        // Each request passes all stations: linear is 10.
        println!("rust profibus.core.growth {:.2}", costs[2] / costs[1]);
    }
}

/// One station on a pseudo-terminal.
#[cfg(unix)]
mod line {
    use std::fs::{File, OpenOptions};
    use std::io::{Read as _, Write as _};
    use std::os::fd::AsFd as _;
    use std::path::Path;
    use std::process::Command;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::{Duration, Instant};

    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use tickbus::driver::Driver;
    use tickbus::driver_cfg::Config;
    use tickbus::fieldbus::profibus::advice::advise;
    use tickbus::fieldbus::profibus::telegram::{Frame, Telegram, append_short_ack};
    use tickbus::time::{Monotonic, Nanos, TimeHistogram};

    use super::pty;

    const ROOT: &str = env!("CARGO_MANIFEST_DIR");

    /// 11 bits at 500 kbit/s.
    const MIN_TSDR: Duration = Duration::from_micros(22);

    pub(super) fn run(measured: bool) {
        let (rounds, seconds, requests) = if measured {
            (5, 3.0, 10_000)
        } else {
            (1, 0.1, 20)
        };
        reply_times(requests);
        if !Path::new(&python()).exists() {
            println!("profibus: there is no pyprofibus to compare with");
            return;
        }
        let (mut ours, mut at_once, mut lawful) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..rounds {
            let line = pty::Line::new();
            let driver = device(&line);
            ours.push(exchanges(line.end(1), seconds));
            driver.close();
            at_once.push(echoed(Duration::ZERO, seconds));
            lawful.push(echoed(MIN_TSDR, seconds));
        }
        for (name, bare) in [("ratio", &at_once), ("ratio_lawful", &lawful)] {
            let ratios = ours.iter().zip(bare).map(|(own, bare)| own / bare);
            let ratio = super::median(ratios.collect());
            println!("rust profibus.pty.{name} {ratio:.3}");
        }
        println!("rust profibus.pty {:.0}", super::median(ours));
        println!("rust profibus.pty.bare {:.0}", super::median(at_once));
        println!("rust profibus.pty.bare_lawful {:.0}", super::median(lawful));
    }

    /// The exchanges with answers made in advance, each sent `wait` after its request was read.
    fn echoed(wait: Duration, seconds: f64) -> f64 {
        // A port of its own: one whose parity was asked for cannot be opened again with the same settings.
        let line = pty::Line::new();
        let over = Arc::new(AtomicBool::new(false));
        let answers = std::thread::spawn({
            let (over, end) = (Arc::clone(&over), open(line.end(0)));
            move || answer(end, wait, &over)
        });
        let count = exchanges(line.end(1), seconds);
        over.store(true, Ordering::Relaxed);
        answers.join().expect("it did not panic");
        count
    }

    fn python() -> String {
        format!("{ROOT}/target/peers/main/bin/python")
    }

    fn device(line: &pty::Line) -> Driver {
        let text = format!(
            "[driver]\nid = 1\nname = \"encoder\"\n[fieldbus]\nkind = \"profibus-device\"\ndevice = \"{}\"\n\
             baud = 500000\nmax_tsdr = 16000\nmax_age = \"5s\"\naddress = 8\ngsd = \"{ROOT}/tests/gsd/encoder.gsd\"\n\
             [[signal]]\nname = \"out\"\naddress = \"%QD0\"\ntype = \"UDINT\"\n\
             [[signal]]\nname = \"in\"\naddress = \"%ID0\"\ntype = \"UDINT\"\n",
            line.end(0).display()
        );
        let config = Config::parse("driver.cfg", &text, &tickbus::KINDS)
            .unwrap_or_else(|why| panic!("{why}"));
        Driver::open(config, Monotonic::shared()).expect("it opens")
    }

    /// How many exchanges pyprofibus completes.
    fn exchanges(end: &Path, seconds: f64) -> f64 {
        let output = Command::new(python())
            .arg(format!("{ROOT}/tests/peers/profibus_master.py"))
            .arg(end)
            .args(["500000", "8"])
            .arg(format!("{ROOT}/tests/gsd/encoder.gsd"))
            .arg("4 bytes in and out")
            .arg(seconds.to_string())
            .output()
            .expect("it runs");
        let told = String::from_utf8_lossy(&output.stdout);
        let count = told.rsplit("exchanges=").next().map(str::trim);
        let count = count.and_then(|count| count.parse().ok());
        count.unwrap_or_else(|| panic!("{told}{}", String::from_utf8_lossy(&output.stderr)))
    }

    fn open(end: &Path) -> File {
        let mut options = OpenOptions::new();
        options.read(true).write(true).open(end).expect("an end")
    }

    /// Reads within `patience`; 0 bytes if nothing comes.
    fn read_within(end: &mut File, bytes: &mut [u8], patience: Duration) -> usize {
        let timeout = Timespec {
            tv_sec: 0,
            tv_nsec: patience.subsec_nanos().into(),
        };
        let is_ready = {
            let fd = end.as_fd();
            let mut fds = [PollFd::new(&fd, PollFlags::IN)];
            poll(&mut fds, Some(&timeout)).is_ok_and(|count| count > 0)
        };
        if is_ready {
            end.read(bytes).unwrap_or(0)
        } else {
            0
        }
    }

    /// Answers each request with what a station would, without being one.
    fn answer(mut end: File, wait: Duration, over: &AtomicBool) {
        let frame = |control, sap: Option<u8>, data: &[u8]| {
            let mut bytes = Vec::new();
            Frame {
                destination: 2,
                source: 8,
                control: tickbus::fieldbus::profibus::telegram::Control(control),
                dsap: sap.map(|_| 62),
                ssap: sap,
                data,
            }
            .append(&mut bytes);
            bytes
        };
        let mut short = Vec::new();
        append_short_ack(&mut short);
        let status = frame(0x00, None, &[]);
        let diagnoses = [
            [0x02, 0x05, 0, 0xFF, 0xE4, 0xC0],
            [0x00, 0x0C, 0, 2, 0xE4, 0xC0],
        ];
        let [first, ready] = diagnoses.map(|octets| frame(0x08, Some(60), &octets));
        let data = frame(0x08, None, &[1, 2, 3, 4]);
        let (mut is_configured, mut buffer, mut bytes) = (false, Vec::new(), [0; 512]);
        while !over.load(Ordering::Relaxed) {
            let count = read_within(&mut end, &mut bytes, Duration::from_millis(50));
            let came = Instant::now();
            buffer.extend_from_slice(&bytes[..count]);
            while let Ok(Some((telegram, length))) = Telegram::parse(&buffer) {
                let reply = match telegram {
                    Telegram::Frame(frame) => match frame.dsap {
                        _ if frame.control.0 == 0x49 => Some(&status),
                        Some(60) if is_configured => Some(&ready),
                        Some(60) => Some(&first),
                        Some(61) => Some(&short),
                        Some(62) => {
                            is_configured = true;
                            Some(&short)
                        }
                        None => Some(&data),
                        Some(_) => None,
                    },
                    _ => None,
                };
                if let Some(reply) = reply {
                    while came.elapsed() < wait {
                        std::hint::spin_loop();
                    }
                    end.write_all(reply).expect("a line");
                }
                buffer.drain(..length);
            }
        }
    }

    /// From the last byte of a request to the first of its answer, as `tickbus profibus advise` measures it.
    fn reply_times(requests: u64) {
        let line = pty::Line::new();
        let driver = device(&line);
        let mut end = open(line.end(1));
        let mut replies = TimeHistogram::new();
        let mut answer = [0; 64];
        while replies.count() < requests {
            let sent = Instant::now();
            end.write_all(&[0x10, 0x08, 0x02, 0x49, 0x53, 0x16])
                .expect("a line");
            if read_within(&mut end, &mut answer, Duration::from_millis(200)) > 0 {
                let span = i64::try_from(sent.elapsed().as_nanos()).expect("a short time");
                replies.record(Nanos(span));
                while read_within(&mut end, &mut answer, Duration::from_micros(500)) > 0 {}
            }
        }
        driver.close();
        for (name, span) in [
            ("p50", replies.quantile(0.5)),
            ("p999", replies.quantile(0.999)),
            ("max", replies.longest()),
        ] {
            println!("rust profibus.reply.{name}_us {:.1}", span.as_micros());
        }
        for advice in advise(&replies, Nanos(0)) {
            let share = 100.0 * advice.in_time;
            println!("rust profibus.reply.in_time_{} {share:.1}", advice.baud);
            if let Some((_, slot)) = advice.bits {
                println!("rust profibus.slot_{} {slot}", advice.baud);
            }
        }
        print!("{}", replies.chart());
    }
}
