//! The keys of a mapping that only SIL Kit has.

use tickbus_base::toml_text::{Table, Value};

use crate::mapping::{Engine, LONGEST, Mapping};

/// A mapping for SIL Kit; the name in the federation is the participant's.
pub type SilKitMapping = Mapping<SilKitSettings>;

/// Where the simulation is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SilKitSettings {
    /// The address of the registry, such as `silkit://localhost:8500`.
    pub registry: String,
}

/// The place of a value in the simulation: publishers and subscribers match by topic and labels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// The name of the topic.
    pub name: String,
    /// The labels.
    pub labels: Vec<Label>,
}

/// A label of a topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    /// The key.
    pub key: String,
    /// The value.
    pub value: String,
    /// The other end may be without this label.
    pub optional: bool,
}

impl Engine for SilKitSettings {
    type Key = Topic;
    const TABLE: &'static str = "silkit";
    const NAME: &'static str = "participant";
    const NEEDS_STEP: bool = true;

    fn read(table: &mut Table<'_>) -> Option<Self> {
        let right = "write the registry's address, such as \"silkit://localhost:8500\"";
        let Some(value) = table.take("registry") else {
            return Some(Self {
                registry: "silkit://localhost:8500".to_owned(),
            });
        };
        let registry = value.label(LONGEST, right)?;
        if !registry.starts_with("silkit://") {
            let what = format!("\"{registry}\" does not start with silkit://");
            value.wrong(what, right);
            return None;
        }
        Some(Self {
            registry: registry.to_owned(),
        })
    }

    fn key(table: &mut Table<'_>, variable: Option<&str>) -> Option<Topic> {
        let topic = table.take("topic");
        let labels = table.take("labels");
        let labels = labels.map_or(Some(Vec::new()), |value| read_labels(&value));
        let name = match topic {
            Some(value) => value.label(LONGEST, "write the topic, such as \"Temperature\""),
            None => variable,
        };
        Some(Topic {
            name: name?.to_owned(),
            labels: labels?,
        })
    }
}

fn read_labels(value: &Value<'_>) -> Option<Vec<Label>> {
    let right = "write a list such as [{ key = \"Instance\", value = \"1\" }]";
    let read = value.list(right)?.into_iter().map(|element| {
        let mut table = element.table("labels", right)?;
        let key = table.require("key", "add the label's key");
        let text = table.require("value", "add the label's value");
        let optional = table.take("optional");
        table.finish();
        let optional = optional.map_or(Some(false), |value| value.boolean());
        Some(Label {
            key: key?.label(LONGEST, right)?.to_owned(),
            value: text?.label(LONGEST, right)?.to_owned(),
            optional: optional?,
        })
    });
    // All of them are read, for all their mistakes.
    let read: Vec<Option<Label>> = read.collect();
    read.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use tickbus_base::time::Nanos;
    use tickbus_image::signal::DataType;

    use super::*;

    #[test]
    fn a_file_maps_variables_to_topics() {
        let text = "[silkit]\nclient = \"silkit\"\nparticipant = \"tickbus\"\nstep = \"1ms\"\n\
            [[silkit.publish]]\nvariable = \"speed\"\ntype = \"REAL\"\n\
            [[silkit.subscribe]]\nvariable = \"temp\"\ntopic = \"Temperature\"\ntype = \"REAL\"\ninitial = 0.5\n\
            labels = [{ key = \"Instance\", value = \"1\", optional = true }]\n";
        let mapping = SilKitMapping::parse("demo.toml", text).expect("it is right");
        assert_eq!(mapping.name, "tickbus");
        assert_eq!(mapping.step, Some(Nanos::from_millis(1)));
        assert_eq!(mapping.engine.registry, "silkit://localhost:8500");
        let speed = &mapping.publish[0];
        assert_eq!(
            (&*speed.key.name, speed.data_type),
            ("speed", DataType::Real)
        );
        let temperature = &mapping.subscribe[0];
        assert_eq!(temperature.key.name, "Temperature");
        assert_eq!(temperature.initial, u64::from(0.5_f32.to_bits()));
        let label = Label {
            key: "Instance".to_owned(),
            value: "1".to_owned(),
            optional: true,
        };
        assert_eq!(temperature.key.labels, [label]);
    }

    #[test]
    fn every_mistake_is_told_at_its_place() {
        let text = "[silkit]\nclient = \"a\"\nregistry = \"localhost:8500\"\n\
            [[silkit.publish]]\nvariable = \"a\"\ntpic = \"b\"\ntype = \"INT\"\nlabels = [{ key = \"c\" }]\n";
        let told = SilKitMapping::parse("demo.toml", text).expect_err("it is wrong");
        let told = told.to_string();
        for part in [
            "demo.toml:1:1: [silkit] has no \"step\"; add the time between two steps",
            "demo.toml:3:12: \"localhost:8500\" does not start with silkit://; write the registry's address",
            "demo.toml:6:1: unknown key \"tpic\"",
            "has no \"value\"; add the label's value",
        ] {
            assert!(told.contains(part), "{part} in {told}");
        }
    }
}
