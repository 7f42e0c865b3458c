//! The key `real_time` of `[driver]`.

use tickbus_base::RealTime;
use tickbus_base::toml_text::{Key, Shape, Value};

const SHAPE: &str = "write real_time = { priority = 50 }, with cpu = 1, lock_memory = true and required = true as you need them";

/// The keys of the table.
pub(crate) const KEYS: &[Key] = &[
    Key::new(
        "priority",
        Shape::Whole(1, 99),
        "The priority in the system's real-time class",
    ),
    Key::new(
        "cpu",
        Shape::Whole(0, 1023),
        "The number of the only processor that runs the threads of the bus and of a hosted program",
    ),
    Key::new(
        "lock_memory",
        Shape::Boolean,
        "true: all memory of the process stays in the computer's memory",
    )
    .or("false"),
    Key::new(
        "required",
        Shape::Boolean,
        "true: the driver does not open if the system refuses one of them",
    )
    .or("false"),
];

/// Reads the table.
pub(crate) fn read_real_time(value: &Value<'_>) -> Option<RealTime> {
    let mut table = value.table("real_time", SHAPE)?;
    let (priority, cpu) = (table.take("priority"), table.take("cpu"));
    let (lock_memory, required) = (table.take("lock_memory"), table.take("required"));
    table.finish();
    let flag = |value: Option<Value<'_>>| value.and_then(|value| value.boolean());
    let real_time = RealTime {
        priority: priority
            .as_ref()
            .and_then(|value| value.whole(1..=99))
            .and_then(|number| u8::try_from(number).ok()),
        cpu: cpu
            .as_ref()
            .and_then(|value| value.whole(0..=1023))
            .and_then(|number| u16::try_from(number).ok()),
        lock_memory: flag(lock_memory).unwrap_or_default(),
        required: flag(required).unwrap_or_default(),
    };
    if priority.is_none() && cpu.is_none() && !real_time.lock_memory {
        value.wrong("real_time asks for nothing", SHAPE);
        return None;
    }
    Some(real_time)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Config, Kinds};

    fn read(real_time: &str) -> Result<Option<RealTime>, String> {
        let text = format!(
            "[driver]\nid = 1\nname = \"x\"\nreal_time = {real_time}\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\n\
             [[signal]]\nname = \"In\"\naddress = \"%IX0.0\"\n"
        );
        let config = Config::parse("driver.cfg", &text, &Kinds::LOOPBACK);
        let config = config.map(|config| config.real_time);
        config.map_err(|mistakes| mistakes.to_string())
    }

    #[test]
    fn each_key_is_read_and_none_is_needed() {
        let all = read("{ priority = 50, cpu = 1, lock_memory = true, required = true }");
        let expected = RealTime {
            priority: Some(50),
            cpu: Some(1),
            lock_memory: true,
            required: true,
        };
        assert_eq!(all, Ok(Some(expected)));
        let cpu = read("{ cpu = 0 }").expect("right").expect("a setting");
        assert_eq!(
            (cpu.priority, cpu.cpu, cpu.lock_memory),
            (None, Some(0), false)
        );
    }

    #[test]
    fn each_mistake_is_reported_at_its_place() {
        for (wrong, told) in [
            (
                "{ priority = 100 }",
                "driver.cfg:4:26: \"priority\" is 100; write a whole number from 1 to 99",
            ),
            ("{ cpu = -1 }", "driver.cfg:4:21: \"cpu\" is -1; "),
            (
                "{ required = true }",
                "driver.cfg:4:13: real_time asks for nothing; ",
            ),
            ("{ lock_memory = 1 }", "driver.cfg:4:29: "),
            ("{ prio = 1 }", "unknown key"),
            ("50", "driver.cfg:4:13: "),
        ] {
            let mistakes = read(wrong).expect_err(wrong);
            assert!(mistakes.contains(told), "{wrong}: {mistakes}");
        }
    }
}
