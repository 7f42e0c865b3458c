//! Any request to change something on the live page, and any value for a signal of any type.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus_image::signal::{Area, Conversions, DataType, Plan, Scale, Signal, SignalTable};
use tickbus_live_page::{Order, order, parse_value};
use tickbus_web::{Change, Verb};

fuzz_target!(|data: &[u8]| {
    let Some((first, rest)) = data.split_first() else {
        return;
    };
    let text = String::from_utf8_lossy(rest);
    let (path, body) = text.split_once('\n').unwrap_or((&text, ""));
    let verb = if first & 1 == 0 {
        Verb::Put
    } else {
        Verb::Delete
    };
    let change = Change {
        verb,
        path: path.to_owned(),
        body: body.trim().to_owned(),
    };
    match order(&change) {
        Ok(Order::Force { values, .. }) => {
            assert_eq!(verb, Verb::Put);
            // Several signals are a list in the body.
            let is_one = values.len() == 1 && values[0].1 == change.body;
            assert!(is_one || change.body.starts_with('['), "{values:?}");
        }
        Ok(Order::Fault {
            value: Some(value), ..
        }) => assert_eq!((verb, value), (Verb::Put, change.body.clone())),
        Ok(Order::Release { .. } | Order::ReleaseAll | Order::Fault { value: None, .. }) => {
            assert_eq!(verb, Verb::Delete)
        }
        Err(refused) => assert!((400..500).contains(&refused.status) && !refused.text.is_empty()),
    }
    let data_type = DataType::ALL[usize::from(first >> 1) % DataType::ALL.len()];
    let mut signal = Signal::new("s", Area::Input, 0, data_type);
    if first & 0x80 != 0 && data_type != DataType::Bool {
        signal.scale = Scale::through([0.0, 27_648.0], [-5.0, 250.0]);
    }
    if let Ok(slot) = parse_value(&change.body, &signal) {
        // What is taken fits: nothing is bent on its way into the frame.
        let table = SignalTable::of_one_station(8, 0, vec![signal]);
        let plan = Plan::new(&table, 0, Area::Input);
        let conversions = plan.encode(&[slot], &mut [0; 8]);
        assert_eq!(
            conversions,
            Conversions::default(),
            "{} {data_type}",
            change.body
        );
    }
});
