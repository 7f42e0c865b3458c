//! The week: the time of day, and the cams of a weekly timer.

use tickbus_base::time::Nanos;

/// The days in the notation of programs.
pub(crate) const DAYS: [(&str, usize); 7] = [
    ("Mon", 0),
    ("Tue", 1),
    ("Wed", 2),
    ("Thu", 3),
    ("Fri", 4),
    ("Sat", 5),
    ("Sun", 6),
];

const DAY: Nanos = Nanos::from_secs(24 * 3600);

/// A moment of the week, by the clock on the wall.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WallTime {
    /// Days since Monday, 0 to 6.
    pub day: usize,
    /// Time since midnight, less than 24 hours.
    pub time: Nanos,
}

/// One cam: on at a time of some days, off at another time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cam {
    pub(crate) days: [bool; 7],
    pub(crate) on: Nanos,
    /// On the next day if it is not later than `on`.
    pub(crate) off: Nanos,
}

impl Cam {
    pub(crate) fn is_on(&self, wall: WallTime) -> bool {
        let WallTime { day, time } = wall;
        let (today, yesterday) = (self.days[day % 7], self.days[(day + 6) % 7]);
        if self.on < self.off {
            today && (self.on..self.off).contains(&time)
        } else {
            (today && time >= self.on) || (yesterday && time < self.off)
        }
    }

    /// The time until the next time of day at which this cam may switch.
    pub(crate) fn until_change(&self, wall: WallTime) -> Nanos {
        let until = |at: Nanos| match (at - wall.time).0.rem_euclid(DAY.0) {
            0 => DAY,
            span => Nanos(span),
        };
        until(self.on).min(until(self.off))
    }
}

/// Reads `06:30` or `06:30:15`, up to 24:00.
pub(crate) fn time_of_day(text: &str) -> Option<Nanos> {
    let mut seconds = 0;
    let mut parts = text.split(':');
    for (unit, most) in [(3600, 24), (60, 59), (1, 59)] {
        let Some(part) = parts.next() else {
            // Seconds may be left out.
            if unit == 1 {
                break;
            }
            return None;
        };
        if part.len() != 2 || !part.bytes().all(|byte| byte.is_ascii_digit()) {
            return None;
        }
        let number: i64 = part.parse().ok().filter(|number| *number <= most)?;
        seconds += number * unit;
    }
    let time = Nanos::from_secs(seconds);
    (parts.next().is_none() && time <= DAY).then_some(time)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(day: usize, text: &str) -> WallTime {
        let time = time_of_day(text).expect(text);
        WallTime { day, time }
    }

    #[test]
    fn a_cam_that_ends_on_the_next_day_is_on_at_night() {
        let mut cam = Cam {
            days: [false; 7],
            on: time_of_day("22:00").expect("a time"),
            off: time_of_day("06:00").expect("a time"),
        };
        cam.days[6] = true;
        for (day, time, is_on) in [
            (6, "05:59", false),
            (6, "21:59:59", false),
            (6, "22:00", true),
            (0, "00:00", true),
            (0, "05:59:59", true),
            (0, "06:00", false),
            (0, "23:00", false),
        ] {
            assert_eq!(cam.is_on(at(day, time)), is_on, "{day} {time}");
        }
        let hours = |wall| cam.until_change(wall).0 / Nanos::from_secs(3600).0;
        assert_eq!(hours(at(6, "21:00")), 1);
        assert_eq!(hours(at(6, "22:00")), 8);
        assert_eq!(hours(at(0, "06:00")), 16);
    }

    #[test]
    fn times_of_day_have_two_digits_each_and_end_with_the_day() {
        assert_eq!(time_of_day("24:00"), Some(DAY));
        assert_eq!(time_of_day("00:00:01"), Some(Nanos::from_secs(1)));
        for wrong in [
            "",
            "6:00",
            "06",
            "06:60",
            "24:00:01",
            "06:00:00:00",
            "25:00",
            "+6:00",
            "06:0x",
        ] {
            assert_eq!(time_of_day(wrong), None, "{wrong}");
        }
    }
}
