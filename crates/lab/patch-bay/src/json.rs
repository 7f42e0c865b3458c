//! The board as JSON.

use std::fmt::{self, Display, Write as _};

use tickbus_dispatcher::{ChannelState, ClientState, Label, Number, Pin};
use tickbus_web::Differences;

use crate::model::{Cable, Gone, Model, Shared, Shown};
use crate::place::Place;

impl Differences for Shared {
    fn number(&self) -> u64 {
        self.with(|model| model.number)
    }

    fn since(&self, seen: Option<u64>) -> (u64, String) {
        self.with(|model| (model.number, state(model, model.seen(seen))))
    }
}

/// The board in one line; with `seen`, what has changed since the state with this number.
fn state(model: &Model, seen: Option<u64>) -> String {
    let mut json = String::new();
    // Writing to a String cannot fail.
    let _ = match seen {
        None => write_all(model, &mut json),
        Some(seen) => write_changes(model, seen, &mut json),
    };
    json
}

fn write_all(model: &Model, json: &mut String) -> fmt::Result {
    json.push_str("{\"full\":true,\"clients\":[");
    let clients = model.clients.iter();
    write_list(json, clients, |json, client| {
        write_client(json, &client.state)
    })?;
    json.push_str("],\"connections\":[");
    write_list(json, model.cables.iter(), write_cable)?;
    json.push_str("],\"places\":{");
    write_list(json, model.layout.places.iter(), write_place)?;
    json.push_str("}}");
    Ok(())
}

/// The parts in which nothing has changed are left out. A client that has gone and come again is in two lists.
fn write_changes(model: &Model, seen: u64, json: &mut String) -> fmt::Result {
    json.push('{');
    let gone = || {
        let all = model.gone.iter().rev();
        all.take_while(|(number, _)| *number > seen)
            .map(|(_, gone)| gone)
    };
    let clients = gone().filter_map(|gone| match gone {
        Gone::Client(name) => Some(name),
        Gone::Cable(_) => None,
    });
    write_part(json, "gone", ('[', ']'), clients, |json, name| {
        write!(json, "\"{name}\"")
    })?;
    let inputs = gone().filter_map(|gone| match gone {
        Gone::Cable(sink) => Some(sink),
        Gone::Client(_) => None,
    });
    write_part(json, "cut", ('[', ']'), inputs, |json, sink| {
        write!(json, "\"{sink}\"")
    })?;
    let clients = model.clients.iter().filter(|client| client.shaped > seen);
    write_part(json, "clients", ('[', ']'), clients, |json, client| {
        write_client(json, &client.state)
    })?;
    let clients = model.clients.iter();
    let clients = clients.filter(|client| client.shaped <= seen && client.newest > seen);
    write_part(json, "values", ('{', '}'), clients, |json, client| {
        write_values(json, client, seen)
    })?;
    let cables = model
        .cables
        .iter()
        .filter(|(_, cable)| cable.changed > seen);
    write_part(json, "connections", ('[', ']'), cables, write_cable)?;
    let places = model
        .layout
        .places
        .iter()
        .filter(|(_, place)| place.changed > seen);
    write_part(json, "places", ('{', '}'), places, write_place)?;
    json.push('}');
    Ok(())
}

/// A list under its key, unless it is empty.
fn write_part<T>(
    json: &mut String,
    key: &str,
    (open, close): (char, char),
    list: impl Iterator<Item = T>,
    write: impl Fn(&mut String, T) -> fmt::Result,
) -> fmt::Result {
    let mut list = list.peekable();
    if list.peek().is_none() {
        return Ok(());
    }
    let comma = if json.len() > 1 { "," } else { "" };
    write!(json, "{comma}\"{key}\":{open}")?;
    write_list(json, list, write)?;
    json.push(close);
    Ok(())
}

fn write_list<T>(
    json: &mut String,
    list: impl Iterator<Item = T>,
    write: impl Fn(&mut String, T) -> fmt::Result,
) -> fmt::Result {
    for (at, it) in list.enumerate() {
        if at > 0 {
            json.push(',');
        }
        write(json, it)?;
    }
    Ok(())
}

fn write_client(json: &mut String, client: &ClientState) -> fmt::Result {
    let device = &client.device;
    write!(
        json,
        "{{\"name\":\"{}\",\"role\":\"{}\",\"address\":\"{}\",\"channels\":[",
        device.name,
        device.role.keyword(),
        device.peer
    )?;
    write_list(json, client.channels.iter(), |json, channel| {
        write!(
            json,
            "{{\"channel\":\"{}\",\"label\":{},\"value\":{},\"forced\":{}}}",
            channel.channel,
            Labelled(channel.label.as_ref()),
            Quoted(channel.value),
            Quoted(channel.forced)
        )
    })?;
    json.push_str("]}");
    Ok(())
}

/// `"PUMP":{"Q1":"24","I1":["0","7.5"]}`: values, and the forced ones behind them.
fn write_values(json: &mut String, client: &Shown, seen: u64) -> fmt::Result {
    write!(json, "\"{}\":{{", client.state.device.name)?;
    let channels = client.state.channels.iter().zip(&client.changed);
    let changed = channels.filter(|(_, changed)| **changed > seen);
    write_list(json, changed, |json, (channel, _)| {
        let ChannelState {
            channel,
            value,
            forced,
            ..
        } = channel;
        match forced {
            None => write!(json, "\"{channel}\":{}", Quoted(*value)),
            Some(_) => write!(
                json,
                "\"{channel}\":[{},{}]",
                Quoted(*value),
                Quoted(*forced)
            ),
        }
    })?;
    json.push('}');
    Ok(())
}

fn write_cable(json: &mut String, (sink, cable): (&Pin, &Cable)) -> fmt::Result {
    write!(
        json,
        "{{\"input\":\"{sink}\",\"output\":\"{}\",\"awake\":{}}}",
        cable.source, cable.is_awake
    )
}

fn write_place(json: &mut String, (name, place): (&String, &Place)) -> fmt::Result {
    write!(
        json,
        "\"{name}\":{{\"x\":{},\"y\":{},\"folded\":{},\"group\":{}}}",
        place.spot.x,
        place.spot.y,
        place.is_folded,
        Labelled(place.group.as_ref())
    )
}

/// A number as text, which rounds nothing, or `null`.
struct Quoted(Option<Number>);

impl Display for Quoted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Some(number) => write!(f, "\"{number}\""),
            None => f.write_str("null"),
        }
    }
}

/// A label as text, or `null`. Of the texts here, only labels can contain characters to escape.
struct Labelled<'a>(Option<&'a Label>);

impl Display for Labelled<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(label) = self.0 else {
            return f.write_str("null");
        };
        f.write_char('"')?;
        // A label has no control characters.
        for sign in label.as_str().chars() {
            if matches!(sign, '"' | '\\') {
                f.write_char('\\')?;
            }
            f.write_char(sign)?;
        }
        f.write_char('"')
    }
}
