//! The nets of a program: names, conditions, and drawings.

use serde::{Deserialize, Serialize};

use crate::drawing;

/// The longest text of all nets, in bytes: a net of 12,000 places has 9 MB.
const LONGEST: usize = 32 << 20;

/// The most nets of one program.
const MOST: usize = 1000;

/// All nets of a program.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Layout {
    /// x and y of the dots of few tokens, from the middle of a place, by the number of tokens. More tokens are a number.
    #[serde(default)]
    dots: Vec<Vec<f32>>,
    pub(crate) nets: Vec<Net>,
}

/// One net.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Net {
    pub(crate) name: String,
    pub(crate) svg: String,
    pub(crate) places: Vec<String>,
    pub(crate) transitions: Vec<Transition>,
    #[serde(default)]
    pub(crate) inputs: Vec<String>,
    #[serde(default)]
    pub(crate) outputs: Vec<String>,
}

/// One transition.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Transition {
    name: String,
    /// The parts of its condition.
    #[serde(default)]
    parts: Vec<Part>,
}

/// One part of a condition.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Part {
    text: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    input: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    net: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    place: Option<String>,
}

/// Reads the nets of a program, or says what is wrong.
pub(crate) fn read(json: &str) -> Result<Layout, String> {
    let wrong = |what: String| format!("the nets cannot be shown: {what}");
    if json.len() > LONGEST {
        return Err(wrong(format!(
            "their drawings have {} bytes, and the most is {LONGEST}; show fewer nets, or smaller ones",
            json.len()
        )));
    }
    let layout: Layout = serde_json::from_str(json)
        .map_err(|why| wrong(format!("their JSON is not as docs/petri.md says: {why}")))?;
    let count = layout.nets.len();
    if count > MOST {
        return Err(wrong(format!(
            "there are {count}, and the most is {MOST}; show fewer"
        )));
    }
    for net in &layout.nets {
        drawing::check(&net.svg, net.places.len(), net.transitions.len())
            .map_err(|what| wrong(format!("the drawing of \"{}\" {what}", net.name)))?;
    }
    Ok(layout)
}
