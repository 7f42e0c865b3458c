//! The page about the experiment: pictures of the paths, and the figures.

use std::fmt::Write as _;
use std::io::{self, Write};

use maud::{DOCTYPE, Markup, PreEscaped, html};
use tickbus_report::still_head;

use crate::experiment::{Experiment, Kind, LOCK_STEP_ERROR};
use crate::metrics::{Metrics, thinned};
use crate::path::{CORNERS, Point};

const OWN_STYLE: &str = include_str!("page.css");

/// A picture of the page: its heading, its experiment, and a caption.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    /// The heading.
    pub heading: &'a str,
    /// The experiment that the picture shows.
    pub of: &'a Experiment,
    /// The sentence below the picture.
    pub caption: &'a str,
}

/// Writes the page. It is self-contained, and the same experiments give the same bytes.
///
/// # Errors
///
/// Errors of `out`.
pub fn write(
    pictures: &[Picture<'_>],
    experiments: &[Experiment],
    out: &mut dyn Write,
) -> io::Result<()> {
    let title = "A servo robot, in lock-step and free-wheeling";
    let frame = Frame::around(pictures);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (PreEscaped(still_head(title, OWN_STYLE)))
            body {
                header {
                    h1 { (title) }
                    p.source {
                        "Two axes and a PLC program that closes their position loops, run again and again. \
                         Machine and program are the same in each picture; what differs is how they keep time."
                    }
                    dl.facts { (facts(experiments)) }
                }
                main {
                    section id="paths" {
                        h2 { "Paths" }
                        div.paths {
                            @for picture in pictures { (figure(*picture, frame)) }
                        }
                        p.note {
                            "The wide grey line is the commanded path, with its legs numbered in the order of travel; \
                             the thin lines are what the tool did, in one of the runs drawn in another colour. The scale is the same in each picture, one square is \
                             100 mm."
                        }
                    }
                    section id="figures" { h2 { "Figures" } (table(experiments)) }
                    section id="meaning" { h2 { "What one sees" } (meaning(pictures)) }
                }
                footer {
                    p {
                        "Made by tickbus " (env!("CARGO_PKG_VERSION")) ". This file is complete: it loads nothing, and sends nothing."
                    }
                }
            }
        }
    };
    out.write_all(page.into_string().as_bytes())
}

fn facts(experiments: &[Experiment]) -> Markup {
    let lock_step = || experiments.iter().filter(|e| e.kind == Kind::LockStep);
    let runs: usize = lock_step().map(|e| e.runs.len()).sum();
    let steps = lock_step().flat_map(|e| &e.runs).map(Vec::len).max();
    let hashes = || lock_step().flat_map(|e| &e.hashes);
    let equal = hashes()
        .filter(|hash| Some(*hash) == hashes().next())
        .count();
    let largest = lock_step()
        .map(|of| of.metrics.largest_error)
        .fold(0.0, f64::max);
    let class = if equal == runs { "good" } else { "bad" };
    html! {
        div class=(class) { dt { "Equal to the last bit, in lock-step" } dd { (equal) " of " (runs) " runs" } }
        div class=(class) { dt { "Trace hash" } dd.hash { (hashes().next().map_or("", String::as_str)) } }
        div { dt { "Steps of 1 ms, each run" } dd { (steps.unwrap_or(0)) } }
        div { dt { "Off the path at most, in lock-step" } dd { (millimetres(Kind::LockStep, largest)) " mm" } }
    }
}

/// The part of the plane that all pictures show, in mm, with z upwards.
#[derive(Clone, Copy, Debug)]
struct Frame {
    low: Point,
    high: Point,
}

impl Frame {
    fn around(pictures: &[Picture<'_>]) -> Self {
        let mut frame = Self {
            low: CORNERS[0],
            high: CORNERS[0],
        };
        let runs = pictures.iter().flat_map(|picture| &picture.of.runs);
        for point in runs.flatten().chain(&CORNERS) {
            for axis in [0, 1] {
                frame.low[axis] = frame.low[axis].min(point[axis] - 20.0);
                frame.high[axis] = frame.high[axis].max(point[axis] + 20.0);
            }
        }
        frame
    }

    fn view_box(self) -> String {
        format!(
            "{:.0} {:.0} {:.0} {:.0}",
            self.low[0],
            -self.high[1],
            self.high[0] - self.low[0],
            self.high[1] - self.low[1]
        )
    }

    /// Returns lines at every 100 mm.
    fn grid(self) -> String {
        let mut data = String::new();
        for axis in [0, 1] {
            let (low, high) = ((self.low[axis] / 100.0).ceil(), self.high[axis] / 100.0);
            let mut at = low;
            while at <= high {
                let at_mm = at * 100.0;
                let _ = if axis == 0 {
                    write!(data, "M{at_mm} {:.0}V{:.0}", -self.high[1], -self.low[1])
                } else {
                    write!(data, "M{:.0} {}H{:.0}", self.low[0], -at_mm, self.high[0])
                };
                at += 1.0;
            }
        }
        data
    }
}

fn figure(picture: Picture<'_>, frame: Frame) -> Markup {
    let Picture {
        heading,
        of,
        caption,
    } = picture;
    html! {
        figure {
            h3 { (heading) }
            svg.path viewBox=(frame.view_box()) role="img" aria-label={ (heading) ": paths of the tool in " (of.runs.len()) " runs" } {
                path.grid d=(frame.grid()) {}
                path.commanded d=(line(&CORNERS)) {}
                @for run in &of.runs { path.run d=(line(&thinned(run))) {} }
                @for (leg, ends) in CORNERS.windows(2).enumerate() {
                    @let [x, y] = beside(ends);
                    text x=(format!("{x:.0}")) y=(format!("{y:.0}")) { (leg + 1) }
                }
            }
            figcaption { (caption) }
        }
    }
}

/// Returns the place of a leg's number: inside the path, beside the leg's middle.
fn beside(ends: &[Point]) -> Point {
    let middle = [0, 1].map(|axis| f64::midpoint(ends[0][axis], ends[1][axis]));
    // Towards the middle of the whole path.
    let inwards = [250.0 - middle[0], 120.0 - middle[1]];
    let length = (inwards[0] * inwards[0] + inwards[1] * inwards[1]).sqrt();
    [
        middle[0] + 52.0 * inwards[0] / length,
        -(middle[1] + 52.0 * inwards[1] / length) + 9.0,
    ]
}

/// Returns a polyline as SVG, with z upwards, in tenths of a millimetre.
fn line(points: &[Point]) -> String {
    let mut data = String::with_capacity(points.len() * 12);
    for (at, [x, z]) in points.iter().enumerate() {
        let _ = write!(data, "{}{x:.1} {:.1}", if at == 0 { "M" } else { "L" }, -z);
    }
    data
}

fn table(experiments: &[Experiment]) -> Markup {
    html! {
        p.note {
            "E: largest distance from the commanded path. D: largest distance of two runs at equal simulation time. G: largest \
             distance between the paths of two runs, whatever the time. All in mm."
        }
        div.wide tabindex="0" {
            table {
                thead {
                    tr {
                        th scope="col" { "experiment" }
                        th.n.more scope="col" { "runs" }
                        th.n scope="col" { "E, mean" }
                        th.n.more scope="col" { "E, largest" }
                        th.n scope="col" { "D" }
                        th.n scope="col" { "G" }
                    }
                }
                tbody {
                    @for of in experiments {
                        @let Metrics { error, largest_error, difference, deviation } = of.metrics;
                        tr {
                            th.name scope="row" { (of.name) }
                            td.n.more { (of.runs.len()) }
                            td.n { (millimetres(of.kind, error)) }
                            td.n.more { (millimetres(of.kind, largest_error)) }
                            td.n { (millimetres(of.kind, difference)) }
                            td.n { (millimetres(of.kind, deviation)) }
                        }
                    }
                }
            }
        }
    }
}

fn meaning(pictures: &[Picture<'_>]) -> Markup {
    let worst = pictures
        .iter()
        .map(|p| p.of.metrics.error)
        .fold(0.0, f64::max);
    let times = worst / LOCK_STEP_ERROR;
    html! {
        p {
            "In lock-step all runs lie on one another, and 0.35 mm beside the commanded path: that is what this program does with \
             these axes, so it can be judged, and a change of it can be tested. Free-wheeling, the same program with the same axes \
             is up to " (format!("{times:.0}")) " times as far off, and no two runs are alike. What one sees there is not the \
             program but the link and the load of the computer: a collision in the simulation may be none at the machine, and one \
             at the machine may not be seen. A faster link makes the error smaller, and leaves it to chance all the same."
        }
    }
}

/// Formats a length. In lock-step all digits are the same in every run, and an exact zero is written as `0`.
fn millimetres(of: Kind, value: f64) -> String {
    match of {
        Kind::LockStep if value == 0.0 => "0".to_owned(),
        Kind::LockStep => format!("{value:.7}"),
        _ if value < 10.0 => format!("{value:.2}"),
        _ => format!("{value:.1}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn experiment(kind: Kind, runs: Vec<Vec<Point>>) -> Experiment {
        Experiment::new("<b>", kind, runs)
    }

    #[test]
    fn the_page_shows_each_run_and_loads_nothing() {
        let run: Vec<Point> = (0..=200).map(|z| [0.0, f64::from(z)]).collect();
        let off: Vec<Point> = run.iter().map(|&[x, z]| [x - 110.0, z]).collect();
        let mut lock_step = experiment(Kind::LockStep, vec![run.clone(), run.clone()]);
        lock_step.hashes = vec!["00ff".to_owned(); 2];
        let experiments = [lock_step, experiment(Kind::WallClock(50), vec![run, off])];
        let pictures = experiments.each_ref().map(|of| Picture {
            heading: "a & b",
            of,
            caption: "c",
        });
        let mut page = Vec::new();
        write(&pictures, &experiments, &mut page).expect("memory does not fail");
        let page = String::from_utf8(page).expect("it is UTF-8");
        assert_eq!(page.matches("class=\"run\"").count(), 4);
        assert!(page.contains("2 of 2 runs") && page.contains("00ff"));
        // The second experiment is 110 mm off in one of two runs.
        for figure in [">55.0<", ">110.0<", ">0<"] {
            assert!(page.contains(figure), "{figure}");
        }
        assert!(
            page.contains("viewBox=\"-130 -320 650 340\""),
            "room for all runs"
        );
        assert!(page.contains("a &amp; b") && !page.contains("<b>"));
        for outside in ["://", "url(", "src=", "<script", "@import"] {
            assert!(!page.contains(outside), "{outside}");
        }
    }
}
