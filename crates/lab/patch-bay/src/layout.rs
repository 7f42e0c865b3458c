//! Where the boxes of clients are: moved, folded, grouped, and kept.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::fmt::Write as _;

use serde_json::Value;
use tickbus_base::time::Nanos;
use tickbus_dispatcher::{Channel, ClientState, Label};

use crate::arrange::{Placed, ROW, Size, Spot, arrange, beside, under};
use crate::layout_file::LayoutFile;
use crate::place::{FARTHEST, Place};

/// For this long a client that has come is placed again when its connections change: it states them after its name.
const SETTLING: Nanos = Nanos(2_000_000_000);

/// With more boxes than this, new ones are folded.
const OPEN: usize = 24;

/// More new boxes than this are arranged among themselves, below the others.
const MANY: usize = 50;

/// The most places that are kept.
const MOST: usize = 20_000;

/// The sizes of a box, in pixels; page.css has the same.
const WIDTH: i32 = 210;
const NAMED_WIDTH: i32 = 350;
const HEADER: i32 = 44;
const PADDING: i32 = 10;

/// The properties of a box that decide its size.
#[derive(Debug, Default)]
pub(crate) struct BoxShape {
    pub(crate) name: String,
    inputs: Vec<Channel>,
    outputs: Vec<Channel>,
    is_named: bool,
}

impl BoxShape {
    pub(crate) fn of(client: &ClientState) -> Self {
        let mut shape = Self::absent(&client.device.name);
        for channel in &client.channels {
            shape.add(channel.channel);
            shape.is_named |= channel.label.is_some();
        }
        shape
    }

    /// A client that only cables remember.
    pub(crate) fn absent(name: &str) -> Self {
        let name = name.to_owned();
        Self {
            name,
            ..Self::default()
        }
    }

    pub(crate) fn add(&mut self, channel: Channel) {
        let side = if channel.kind.is_output() {
            &mut self.outputs
        } else {
            &mut self.inputs
        };
        if !side.contains(&channel) {
            side.push(channel);
        }
    }

    fn size(&self, is_folded: bool) -> Size {
        let width = if self.is_named { NAMED_WIDTH } else { WIDTH };
        let rows = self.inputs.len().max(self.outputs.len());
        let rows = i32::try_from(rows).unwrap_or_default();
        let open = if is_folded { 0 } else { rows * ROW + PADDING };
        Size {
            width,
            height: HEADER + open,
        }
    }
}

/// All places, by the names of the clients.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    pub(crate) places: BTreeMap<String, Place>,
    /// The boxes that were there when boxes were last placed.
    here: HashSet<String>,
    file: Option<LayoutFile>,
}

impl Layout {
    pub(crate) fn new(places: BTreeMap<String, Place>, file: LayoutFile) -> Self {
        Self {
            places,
            file: Some(file),
            ..Self::default()
        }
    }

    /// Places new boxes; returns whether there is a new place.
    pub(crate) fn settle(
        &mut self,
        boxes: &[BoxShape],
        links: &[(usize, usize)],
        now: Nanos,
        number: u64,
    ) -> bool {
        let is_folded = boxes.len() > OPEN;
        let covering = self.covering(boxes);
        self.here = boxes.iter().map(|shape| shape.name.clone()).collect();
        for shape in boxes {
            if covering.contains(&*shape.name) {
                self.put(&shape.name, number, |place| {
                    place.settles = Some(now + SETTLING);
                });
            } else if let Some(place) = self.places.get_mut(&shape.name) {
                place.settles = place.settles.filter(|until| now < *until);
            } else {
                let mut place = Place::kept(Spot { x: 0, y: 0 }, is_folded, None);
                (place.changed, place.settles) = (number, Some(now + SETTLING));
                self.places.insert(shape.name.clone(), place);
            }
        }
        let is_new: Vec<bool> = boxes
            .iter()
            .map(|shape| self.places[&shape.name].settles.is_some())
            .collect();
        let count = is_new.iter().filter(|is_new| **is_new).count();
        if count == 0 {
            return false;
        }
        let sizes = self.sizes(boxes);
        let spots = if count == boxes.len() {
            arrange(&sizes, links)
        } else {
            self.among(boxes, &sizes, links, &is_new)
        };
        let mut is_changed = false;
        for (shape, spot) in boxes.iter().zip(spots) {
            is_changed |= self.put(&shape.name, number, |place| place.spot = within(spot));
        }
        self.forget(boxes);
        self.save();
        is_changed
    }

    /// The boxes that come back to a place that another one has got meanwhile. Only the headers count: an unfolded box may
    /// cover those below it.
    fn covering(&self, boxes: &[BoxShape]) -> HashSet<String> {
        let header = |shape: &BoxShape| {
            let place = self.places.get(&shape.name)?;
            let (spot, size) = (place.spot, shape.size(true));
            Some(Placed { spot, size })
        };
        let (stayed, come): (Vec<_>, Vec<_>) = boxes
            .iter()
            .partition(|shape| self.here.contains(&shape.name));
        let mut taken: Vec<Placed> = stayed.into_iter().filter_map(header).collect();
        let mut covering = HashSet::new();
        for shape in come {
            let Some(own) = header(shape) else { continue };
            if taken.iter().any(|other| other.covers(&own)) {
                covering.insert(shape.name.clone());
            } else {
                taken.push(own);
            }
        }
        covering
    }

    /// The places of all boxes, where some have theirs already.
    fn among(
        &self,
        boxes: &[BoxShape],
        sizes: &[Size],
        links: &[(usize, usize)],
        is_new: &[bool],
    ) -> Vec<Spot> {
        let mut spots: Vec<Spot> = boxes
            .iter()
            .map(|shape| self.places[&shape.name].spot)
            .collect();
        let mut done: Vec<bool> = is_new.iter().map(|is_new| !is_new).collect();
        let new: Vec<usize> = (0..boxes.len()).filter(|at| is_new[*at]).collect();
        let placed = |spots: &[Spot], at: usize| Placed {
            spot: spots[at],
            size: sizes[at],
        };
        let all = |spots: &[Spot], done: &[bool]| -> Vec<Placed> {
            let all = (0..boxes.len()).filter(|at| done[*at]);
            all.map(|at| placed(spots, at)).collect()
        };
        if new.len() > MANY {
            let local: HashMap<usize, usize> = new
                .iter()
                .enumerate()
                .map(|(place, at)| (*at, place))
                .collect();
            let pairs = links.iter();
            let pairs = pairs.filter_map(|(from, to)| Some((*local.get(from)?, *local.get(to)?)));
            let pairs: Vec<(usize, usize)> = pairs.collect();
            let parts: Vec<Size> = new.iter().map(|at| sizes[*at]).collect();
            let origin = under(&all(&spots, &done));
            for (at, spot) in new.iter().zip(arrange(&parts, &pairs)) {
                spots[*at] = Spot {
                    x: spot.x,
                    y: spot.y + origin.y,
                };
            }
            return spots;
        }
        for at in new {
            let near = |end: fn(&(usize, usize)) -> (usize, usize), spots: &[Spot]| {
                let ends = links
                    .iter()
                    .map(end)
                    .filter(|(own, other)| *own == at && done[*other]);
                ends.map(|(_, other)| placed(spots, other))
                    .collect::<Vec<_>>()
            };
            let sources = near(|(from, to)| (*to, *from), &spots);
            let sinks = near(|(from, to)| (*from, *to), &spots);
            spots[at] = beside(sizes[at], &sources, &sinks, &all(&spots, &done));
            done[at] = true;
        }
        spots
    }

    /// Arranges all boxes.
    pub(crate) fn arrange(&mut self, boxes: &[BoxShape], links: &[(usize, usize)], number: u64) {
        let spots = arrange(&self.sizes(boxes), links);
        for (shape, spot) in boxes.iter().zip(spots) {
            self.put(&shape.name, number, |place| place.spot = within(spot));
        }
        self.pin();
        self.save();
    }

    fn sizes(&self, boxes: &[BoxShape]) -> Vec<Size> {
        let sizes = boxes.iter().map(|shape| {
            let place = self.places.get(&shape.name);
            shape.size(place.is_some_and(|place| place.is_folded))
        });
        sizes.collect()
    }

    /// Changes a place; returns whether it is another one now.
    fn put(&mut self, name: &str, number: u64, change: impl FnOnce(&mut Place)) -> bool {
        let Some(place) = self.places.get_mut(name) else {
            return false;
        };
        let old = place.clone();
        change(place);
        let is_changed = *place != old;
        if is_changed {
            place.changed = number;
        }
        is_changed
    }

    /// Boxes stay where they are from now on: somebody works with them.
    pub(crate) fn pin(&mut self) {
        for place in self.places.values_mut() {
            place.settles = None;
        }
    }

    /// Carries out a viewer's change, such as `{"PUMP":{"x":40,"y":16,"folded":true,"group":"Hall 1"}}`. What is not named
    /// stays; a refused change changes nothing.
    ///
    /// # Errors
    ///
    /// The body is wrong; the text says what would be right.
    pub(crate) fn change(&mut self, body: &str, number: u64) -> Result<(), String> {
        let shape =
            "write such as {\"PUMP\":{\"x\":40,\"y\":16,\"folded\":true,\"group\":\"Hall 1\"}}";
        let wanted: BTreeMap<String, BTreeMap<String, Value>> = serde_json::from_str(body)
            .map_err(|error| format!("this is no layout ({error}); {shape}"))?;
        let mut places = Vec::new();
        for (name, wanted) in wanted {
            let Some(mut place) = self.places.get(&name).cloned() else {
                return Err(format!(
                    "there is no box {name:?}; boxes are clients that are here or have been here"
                ));
            };
            for (key, value) in wanted {
                let wrong = |right: &str| format!("\"{key}\":{value} of {name} is wrong; {right}");
                match key.as_str() {
                    "x" => place.spot.x = coordinate(&value).map_err(wrong)?,
                    "y" => place.spot.y = coordinate(&value).map_err(wrong)?,
                    "folded" => {
                        place.is_folded = value
                            .as_bool()
                            .ok_or_else(|| wrong("write true or false"))?;
                    }
                    "group" if value.is_null() => place.group = None,
                    "group" => {
                        let text = value.as_str().and_then(Label::read_text);
                        let right = "write a name of 1 to 120 printable characters, or null";
                        place.group = Some(text.ok_or_else(|| wrong(right))?);
                    }
                    _ => return Err(wrong("keys are x, y, folded and group")),
                }
            }
            places.push((name, place));
        }
        for (name, new) in places {
            self.put(&name, number, |place| *place = new);
        }
        self.save();
        Ok(())
    }

    /// Forgets absent clients if too many names have been here.
    fn forget(&mut self, boxes: &[BoxShape]) {
        let surplus = self.places.len().saturating_sub(MOST.max(boxes.len()));
        if surplus == 0 {
            return;
        }
        let here: HashSet<&str> = boxes.iter().map(|shape| &*shape.name).collect();
        let absent = self
            .places
            .keys()
            .filter(|name| !here.contains(name.as_str()));
        let absent: Vec<String> = absent.take(surplus).cloned().collect();
        for name in absent {
            self.places.remove(&name);
        }
    }

    fn save(&self) {
        if let Some(file) = &self.file {
            file.save(self.text());
        }
    }

    /// The text of the file.
    fn text(&self) -> String {
        let mut text = crate::layout_file::HEADING.to_owned();
        for (name, place) in &self.places {
            let Spot { x, y } = place.spot;
            // Writing to a String cannot fail.
            let _ = write!(text, "\"{name}\" = {{ x = {x}, y = {y}");
            if place.is_folded {
                text.push_str(", folded = true");
            }
            if let Some(group) = &place.group {
                let group = group.as_str().replace('\\', "\\\\").replace('"', "\\\"");
                let _ = write!(text, ", group = \"{group}\"");
            }
            text.push_str(" }\n");
        }
        text
    }
}

/// A spot that the file accepts.
fn within(Spot { x, y }: Spot) -> Spot {
    let within = |at: i32| at.clamp(0, FARTHEST);
    Spot {
        x: within(x),
        y: within(y),
    }
}

fn coordinate(value: &Value) -> Result<i32, &'static str> {
    let number = value.as_i64().and_then(|number| i32::try_from(number).ok());
    let number = number.filter(|number| (0..=FARTHEST).contains(number));
    number.ok_or("write a whole number of pixels from 0 to 1000000")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout_file;

    fn shape(name: &str) -> BoxShape {
        BoxShape::absent(name)
    }

    fn spot(layout: &Layout, name: &str) -> (i32, i32) {
        let Spot { x, y } = layout.places[name].spot;
        (x, y)
    }

    #[test]
    fn a_new_box_settles_and_moved_ones_stay() {
        let second = |seconds: i64| Nanos(seconds * 1_000_000_000);
        let mut layout = Layout::default();
        let mut boxes = vec![shape("LOGO"), shape("PUMP")];
        assert!(layout.settle(&boxes, &[], second(0), 1));
        // Its connection comes a moment later: the source moves to the left.
        assert!(layout.settle(&boxes, &[(1, 0)], second(1), 2));
        assert!(spot(&layout, "PUMP") < spot(&layout, "LOGO"));
        layout
            .change(
                r#"{"LOGO":{"x":700,"y":9,"group":"Hall"},"PUMP":{"folded":true}}"#,
                3,
            )
            .expect("right");
        let pump = spot(&layout, "PUMP");
        // Later connections move nothing; a new box finds its place to the right of its source.
        assert!(!layout.settle(&boxes, &[], second(9), 4));
        boxes.push(shape("LAMP"));
        assert!(layout.settle(&boxes, &[(0, 2)], second(10), 5));
        assert_eq!(
            (spot(&layout, "LOGO"), spot(&layout, "PUMP")),
            ((700, 9), pump)
        );
        assert!(spot(&layout, "LAMP").0 > 700);
        layout.pin();
        let lamp = spot(&layout, "LAMP");
        assert!(!layout.settle(&boxes, &[(2, 0)], second(10), 6));
        assert_eq!(spot(&layout, "LAMP"), lamp);
        layout.arrange(&boxes, &[(2, 0)], 7);
        assert!(spot(&layout, "LAMP") < spot(&layout, "LOGO"));
        assert_eq!(layout.places["LOGO"].changed, 7);
        // Boxes of a large laboratory come folded.
        let many: Vec<BoxShape> = (0..100).map(|at| shape(&format!("C{at}"))).collect();
        layout.settle(&many, &[(0, 1)], second(20), 8);
        assert!(layout.places["C99"].is_folded && !layout.places["LAMP"].is_folded);
    }

    #[test]
    fn a_box_that_returns_to_a_taken_place_gets_a_free_one() {
        let second = |seconds: i64| Nanos(seconds * 1_000_000_000);
        let mut layout = Layout::default();
        let all = || vec![shape("LOGO"), shape("PUMP"), shape("FAN")];
        layout.settle(&all(), &[], second(0), 1);
        layout
            .change(r#"{"LOGO":{"x":700,"y":90},"PUMP":{"x":0,"y":500}}"#, 2)
            .expect("right");
        let away = || vec![shape("LOGO"), shape("FAN")];
        layout.settle(&away(), &[], second(10), 3);
        // A box that returns to a free place stays there.
        assert!(!layout.settle(&all(), &[], second(20), 4));
        assert_eq!(spot(&layout, "PUMP"), (0, 500));
        layout.settle(&away(), &[], second(30), 5);
        layout
            .change(r#"{"LOGO":{"x":10,"y":480}}"#, 6)
            .expect("right");
        assert!(layout.settle(&all(), &[], second(40), 7));
        assert_eq!(spot(&layout, "LOGO"), (10, 480), "it has stayed");
        let (x, y) = spot(&layout, "PUMP");
        assert!(
            !(0..=218).contains(&x) || !(436..=524).contains(&y),
            "{x} {y}"
        );
        assert_eq!(layout.places["PUMP"].changed, 7);
    }

    #[test]
    fn a_place_beyond_the_last_one_is_never_kept() {
        let mut layout = Layout::default();
        let mut boxes = vec![shape("A")];
        layout.settle(&boxes, &[], Nanos(0), 1);
        layout
            .change(r#"{"A":{"x":1000000,"y":1000000}}"#, 2)
            .expect("right");
        boxes.push(shape("B"));
        layout.settle(&boxes, &[(0, 1)], Nanos(9_000_000_000), 3);
        let (x, y) = spot(&layout, "B");
        assert!(x <= FARTHEST && y <= FARTHEST, "{x} {y}");
    }

    #[test]
    fn a_wrong_change_is_refused_with_what_would_be_right() {
        let mut layout = Layout::default();
        layout.settle(&[shape("A"), shape("B")], &[], Nanos(0), 1);
        let before = layout.places.clone();
        for (body, part) in [
            ("", "this is no layout"),
            ("[]", "this is no layout"),
            (r#"{"A":{"x":1},"C":{"x":1}}"#, "there is no box \"C\""),
            (
                r#"{"A":{"x":1,"y":-1}}"#,
                "\"y\":-1 of A is wrong; write a whole number of pixels from 0 to 1000000",
            ),
            (r#"{"A":{"x":1.5}}"#, "write a whole number"),
            (r#"{"A":{"x":4294967296}}"#, "write a whole number"),
            (r#"{"A":{"folded":1}}"#, "write true or false"),
            (
                r#"{"A":{"group":" "}}"#,
                "write a name of 1 to 120 printable characters, or null",
            ),
            (r#"{"A":{"z":1}}"#, "keys are x, y, folded and group"),
        ] {
            let refused = layout.change(body, 2).expect_err(body);
            assert!(refused.contains(part), "{refused}");
            assert_eq!(layout.places, before, "{body}");
        }
    }

    #[test]
    fn a_layout_reads_what_was_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("patch.layout.toml");
        assert!(layout_file::load(&path).expect("no file").is_empty());
        let text = format!(
            "{}\"A.1\" = {{ x = 3, y = 1000000 }}\n\
             \"P@hall\" = {{ x = 0, y = 7, folded = true, group = \"Hall \\\"1\\\" \\\\ ä\" }}\n",
            layout_file::HEADING
        );
        std::fs::write(&path, &text).expect("it can be written");
        let places = layout_file::load(&path).expect("it is right");
        assert_eq!(
            places["P@hall"].group.as_ref().map(Label::as_str),
            Some("Hall \"1\" \\ ä")
        );
        let file = LayoutFile::start(path.clone(), |told| panic!("{told}")).expect("a thread");
        std::fs::remove_file(&path).expect("it is there");
        let mut layout = Layout::new(places, file);
        layout.change(r#"{"A.1":{"x":4}}"#, 1).expect("right");
        layout.change(r#"{"A.1":{"x":3}}"#, 2).expect("right");
        // Ends the thread, which saves first.
        drop(layout);
        assert_eq!(std::fs::read_to_string(&path).expect("it is saved"), text);
    }
}
