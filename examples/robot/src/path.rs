//! The commanded path.

use tickbus_base::time::Nanos;

/// A point of the plane in mm: x, z.
pub type Point = [f64; 2];

/// The corners of the path; the tool stops at each of them.
pub const CORNERS: [Point; 6] = [
    [0.0, 0.0],
    [0.0, 200.0],
    [150.0, 300.0],
    [350.0, 300.0],
    [500.0, 200.0],
    [500.0, 0.0],
];

/// The speed along the path, in mm/s.
const SPEED: f64 = 300.0;
/// The acceleration and the deceleration along the path, in mm/s².
const ACCELERATION: f64 = 1500.0;

/// A straight piece of the path, from stop to stop.
#[derive(Clone, Copy, Debug)]
struct Leg {
    /// The time at which the leg begins, in seconds.
    begin: f64,
    from: Point,
    to: Point,
    length: f64,
}

impl Leg {
    /// Returns the time that the leg takes, in seconds. Every leg is long enough to reach [`SPEED`].
    fn duration(&self) -> f64 {
        let ramp = SPEED / ACCELERATION;
        2.0 * ramp + (self.length - SPEED * ramp) / SPEED
    }

    /// Returns the distance travelled `time` seconds after the leg began.
    fn travelled(&self, time: f64) -> f64 {
        let (ramp, duration) = (SPEED / ACCELERATION, self.duration());
        if time <= 0.0 {
            0.0
        } else if time < ramp {
            ACCELERATION * time * time / 2.0
        } else if time <= duration - ramp {
            SPEED * ramp / 2.0 + SPEED * (time - ramp)
        } else if time < duration {
            let left = duration - time;
            self.length - ACCELERATION * left * left / 2.0
        } else {
            self.length
        }
    }
}

/// The commanded position over time: legs with a trapezoidal speed profile.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    legs: [Leg; CORNERS.len() - 1],
    duration: f64,
}

impl Default for Path {
    fn default() -> Self {
        let mut duration = 0.0;
        let legs = std::array::from_fn(|at| {
            let (from, to) = (CORNERS[at], CORNERS[at + 1]);
            let leg = Leg {
                begin: duration,
                from,
                to,
                length: distance(from, to),
            };
            duration += leg.duration();
            leg
        });
        Self { legs, duration }
    }
}

impl Path {
    /// Returns the time from the first corner to the last, in seconds.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Returns the commanded position at `time`.
    pub fn at(&self, time: Nanos) -> Point {
        #[expect(clippy::cast_precision_loss, reason = "exact up to 104 days")]
        let time = time.0 as f64 / 1e9;
        let leg = self.legs.iter().rev().find(|leg| time >= leg.begin);
        leg.map_or(CORNERS[0], |leg| {
            let share = leg.travelled(time - leg.begin) / leg.length;
            [0, 1].map(|axis| leg.from[axis] + share * (leg.to[axis] - leg.from[axis]))
        })
    }
}

/// Returns the distance of two points in mm.
///
/// Does not use `hypot`, whose last bit differs from library to library.
pub fn distance(a: Point, b: Point) -> f64 {
    let (dx, dz) = (b[0] - a[0], b[1] - a[1]);
    (dx * dx + dz * dz).sqrt()
}

/// Returns the distance of a point from the nearest point of a polyline, in mm; infinite if the line has no points.
pub fn distance_from(line: &[Point], point: Point) -> f64 {
    let to_first = line.first().map_or(f64::INFINITY, |&p| distance(p, point));
    line.windows(2)
        .map(|ends| distance_from_segment(ends[0], ends[1], point))
        .fold(to_first, f64::min)
}

fn distance_from_segment(from: Point, to: Point, point: Point) -> f64 {
    let (dx, dz) = (to[0] - from[0], to[1] - from[1]);
    let square = dx * dx + dz * dz;
    if square == 0.0 {
        return distance(from, point);
    }
    let along = ((point[0] - from[0]) * dx + (point[1] - from[1]) * dz) / square;
    let along = along.clamp(0.0, 1.0);
    distance([from[0] + along * dx, from[1] + along * dz], point)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_path_lasts_as_long_as_its_legs() {
        // 2 legs of 200 mm up and down, 2 slanted legs of sqrt(32500) mm, 1 leg of 200 mm; each takes 0.2 s longer than
        // at full speed.
        let seconds = (600.0 + 2.0 * 32_500.0_f64.sqrt()) / 300.0 + 5.0 * 0.2;
        assert!((Path::default().duration() - seconds).abs() < 1e-12);
        assert!((seconds - 4.201_850).abs() < 1e-6);
    }

    #[test]
    fn the_tool_stops_at_each_corner_and_keeps_the_limits_between() {
        let path = Path::default();
        let corners = path.legs.map(|leg| leg.begin).into_iter();
        for (at, seconds) in corners.chain([path.duration()]).enumerate() {
            #[expect(clippy::cast_possible_truncation, reason = "a few seconds")]
            let nanos = (seconds * 1e9).ceil() as i64;
            assert!(distance(path.at(Nanos(nanos)), CORNERS[at]) < 1e-9, "{at}");
        }
        assert_eq!(path.at(Nanos::from_secs(100)), CORNERS[5]);
        assert_eq!(path.at(Nanos(-1)), CORNERS[0]);
        let mut before = 0.0;
        for millis in 1..4300 {
            let [a, b] = [millis - 1, millis].map(|at| path.at(Nanos::from_millis(at)));
            assert!(distance_from(&CORNERS, b) < 1e-12);
            let speed = distance(a, b) * 1e3;
            assert!(speed < SPEED + 1e-6 && (speed - before).abs() < ACCELERATION / 1e3 + 1e-6);
            before = speed;
        }
    }

    #[test]
    fn the_distance_from_a_line_is_that_from_its_nearest_point() {
        let line = [[0.0, 0.0], [10.0, 0.0], [10.0, 0.0], [10.0, 10.0]];
        for (point, expected) in [
            ([5.0, 3.0], 3.0),
            ([-3.0, -4.0], 5.0),
            ([12.0, 4.0], 2.0),
            ([9.0, 8.0], 1.0),
        ] {
            assert!((distance_from(&line, point) - expected).abs() < 1e-12);
        }
        assert!(distance_from(&[], [0.0, 0.0]).is_infinite());
    }
}
