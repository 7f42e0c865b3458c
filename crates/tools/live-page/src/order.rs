//! The changes that a request can order.

use tickbus_base::percent_decoded;
use tickbus_web::{Change, Refused, Verb};

/// A change ordered by a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Order {
    /// Force signals to values, all from the same tick on.
    Force {
        /// The driver's id.
        driver: i32,
        /// The signals' names, and the values as they were written.
        values: Vec<(String, String)>,
    },
    /// End the forces of signals, in the same tick.
    Release {
        /// The driver's id.
        driver: i32,
        /// The signals' names.
        signals: Vec<String>,
    },
    /// Give the simulation's model a fault, or end it.
    Fault {
        /// The driver's id.
        driver: i32,
        /// The fault's name.
        name: String,
        /// The value, as it was written; `None` ends the fault.
        value: Option<String>,
    },
    /// End the forces of all signals of all drivers, and the faults of their models.
    ReleaseAll,
}

/// The order in a request: `PUT /force/4711/LA1%20run` with the value as its body, `DELETE` of the same path, `DELETE
/// /force`, or `PUT` and `DELETE /fault/4711/hose` for a fault of the simulation's model. `PUT /force/4711` has pairs of
/// names and values in its body, `DELETE /force/4711` names.
///
/// # Errors
///
/// Not a valid order; carries what would be.
pub fn order(change: &Change) -> Result<Order, Refused> {
    const RIGHT: &str = "PUT or DELETE /force/ID/SIGNAL or /fault/ID/NAME, with the driver's id and the name in percent-encoding";
    let refused = |status, text: String| Err(Refused { status, text });
    let path = change.path.strip_prefix("/force");
    let rest = path.map(|rest| rest.trim_end_matches('/'));
    match (rest, change.verb) {
        (Some(""), Verb::Delete) => return Ok(Order::ReleaseAll),
        (Some(""), Verb::Put) => {
            return refused(405, format!("it is not said what is to be forced; {RIGHT}"));
        }
        _ => {}
    }
    let fault = change.path.strip_prefix("/fault");
    let path = path.or(fault).and_then(|rest| rest.strip_prefix('/'));
    if let Some(id) = rest.and_then(|rest| rest.strip_prefix('/'))
        && let Ok(driver) = id.parse()
    {
        return several(driver, change);
    }
    let Some((id, name)) = path.and_then(|rest| rest.split_once('/')) else {
        return refused(404, format!("there is nothing to change here; {RIGHT}"));
    };
    let Ok(driver) = id.parse() else {
        return refused(400, format!("the path has no id of a driver; {RIGHT}"));
    };
    let Ok(signal) = String::from_utf8(percent_decoded(name)) else {
        return refused(400, "the name in the path is not UTF-8".to_owned());
    };
    if fault.is_some() {
        return Ok(Order::Fault {
            driver,
            name: signal,
            value: (change.verb == Verb::Put).then(|| change.body.clone()),
        });
    }
    Ok(match change.verb {
        Verb::Put => Order::Force {
            driver,
            values: vec![(signal, change.body.clone())],
        },
        Verb::Delete => Order::Release {
            driver,
            signals: vec![signal],
        },
    })
}

/// The order for several signals of a driver.
fn several(driver: i32, change: &Change) -> Result<Order, Refused> {
    let wrong = |right: &str| {
        let text = format!("the body does not name the signals; send {right}");
        move |_: serde_json::Error| Refused { status: 400, text }
    };
    Ok(match change.verb {
        Verb::Put => {
            let values = serde_json::from_str(&change.body);
            let values = values.map_err(wrong("[[\"NAME\", \"VALUE\"], …]"))?;
            Order::Force { driver, values }
        }
        Verb::Delete => {
            let signals = serde_json::from_str(&change.body);
            let signals = signals.map_err(wrong("[\"NAME\", …]"))?;
            Order::Release { driver, signals }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(verb: Verb, path: &str, body: &str) -> Result<Order, u16> {
        let change = Change {
            verb,
            path: path.to_owned(),
            body: body.to_owned(),
        };
        order(&change).map_err(|refused| refused.status)
    }

    #[test]
    fn a_change_is_an_order_or_a_mistake() {
        let signal = || "LA1 run".to_owned();
        let force = Order::Force {
            driver: 4711,
            values: vec![(signal(), "TRUE".to_owned())],
        };
        assert_eq!(read(Verb::Put, "/force/4711/LA1%20run", "TRUE"), Ok(force));
        let release = Order::Release {
            driver: 4711,
            signals: vec!["a/b".to_owned()],
        };
        for path in [
            "/force/4711/a/b",
            "/force/4711/a%2Fb",
            "/force/4711/%61%2fb",
        ] {
            assert_eq!(read(Verb::Delete, path, ""), Ok(release.clone()), "{path}");
        }
        let pairs = r#"[["a", "1"], ["b", "5 once"]]"#;
        let values = [("a", "1"), ("b", "5 once")].map(|(a, b)| (a.to_owned(), b.to_owned()));
        let force = Order::Force {
            driver: 7,
            values: values.into(),
        };
        assert_eq!(read(Verb::Put, "/force/7", pairs), Ok(force));
        let signals = ["a", "b"].map(str::to_owned).into();
        let release = Order::Release { driver: 7, signals };
        assert_eq!(
            read(Verb::Delete, "/force/7/", r#"["a", "b"]"#),
            Ok(release)
        );
        assert_eq!(read(Verb::Delete, "/force/7", "a"), Err(400));
        for (verb, value) in [(Verb::Put, Some("0.4".to_owned())), (Verb::Delete, None)] {
            let fault = Order::Fault {
                driver: 7,
                name: "a hose".to_owned(),
                value,
            };
            assert_eq!(read(verb, "/fault/7/a%20hose", "0.4"), Ok(fault));
        }
        for path in ["/force", "/force/"] {
            assert_eq!(read(Verb::Delete, path, ""), Ok(Order::ReleaseAll));
            assert_eq!(read(Verb::Put, path, "1"), Err(405));
        }
        for (path, status) in [
            ("/", 404),
            ("/forced", 404),
            ("/signals", 404),
            ("/force/4711", 400),
            ("/fault", 404),
            ("/fault/x/hose", 400),
            ("/force/x/LA1", 400),
            ("/force/99999999999/LA1", 400),
            ("/force/1/%FF", 400),
        ] {
            assert_eq!(read(Verb::Put, path, "1"), Err(status), "{path}");
        }
    }
}
