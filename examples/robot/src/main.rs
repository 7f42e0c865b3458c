//! The demo: runs everything, and writes the page.

use std::fs::File;
use std::io::BufWriter;

use tickbus_base::time::{Monotonic, Nanos};
use tickbus_robot::experiment::{Experiment, Kind};
use tickbus_robot::page::{self, Picture};
use tickbus_robot::{free_wheeling, wall_clock};

fn main() {
    let mut all = Vec::new();
    for update in [10, 50, 100] {
        let runs = (1..=10)
            .map(|seed| free_wheeling::run(seed, Nanos::from_millis(update), 4702))
            .collect();
        all.push(Experiment::new(
            format!("free-wheeling model, OPC each {update} ms"),
            Kind::Model,
            runs,
        ));
    }
    let clock = Monotonic::shared();
    for update in [10, 50] {
        let runs = std::thread::scope(|scope| {
            let runs: Vec<_> = (0..10)
                .map(|_| scope.spawn(|| wall_clock::run(&*clock, Nanos::from_millis(update), 4702)))
                .collect();
            runs.into_iter()
                .map(|run| run.join().expect("no panic"))
                .collect()
        });
        all.push(Experiment::new(
            format!("wall clock {update}"),
            Kind::WallClock,
            runs,
        ));
    }
    for e in &all {
        println!("{} {:?}", e.name, e.metrics);
    }
    let pictures = [
        Picture {
            heading: "a",
            of: &all[0],
            caption: ".",
        },
        Picture {
            heading: "Free",
            of: &all[1],
            caption: ".",
        },
        Picture {
            heading: "Wall",
            of: &all[4],
            caption: ".",
        },
    ];
    page::write(
        &pictures,
        &all,
        &mut BufWriter::new(File::create("/tmp/C/page.html").unwrap()),
    )
    .unwrap();
}
