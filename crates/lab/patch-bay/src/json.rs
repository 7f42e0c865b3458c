//! The board as JSON.

use std::fmt::{self, Display, Write as _};

use tickbus_dispatcher::{ClientState, Label, Number, Snapshot};

/// The state of the page, in one line. Of its texts, only labels can contain characters to escape.
pub(crate) fn state(snapshot: &Snapshot) -> String {
    let mut json = String::new();
    // Writing to a String cannot fail.
    let _ = write(snapshot, &mut json);
    json
}

fn write(snapshot: &Snapshot, json: &mut String) -> fmt::Result {
    json.push_str("{\"clients\":[");
    for (at, client) in snapshot.clients.iter().enumerate() {
        comma(at, json);
        write_client(client, json)?;
    }
    json.push_str("],\"connections\":[");
    for (at, connection) in snapshot.connections.iter().enumerate() {
        comma(at, json);
        write!(
            json,
            "{{\"input\":\"{}\",\"output\":\"{}\",\"awake\":{}}}",
            connection.sink, connection.source, connection.is_awake
        )?;
    }
    json.push_str("]}");
    Ok(())
}

fn write_client(client: &ClientState, json: &mut String) -> fmt::Result {
    let device = &client.device;
    write!(
        json,
        "{{\"name\":\"{}\",\"role\":\"{}\",\"address\":\"{}\",\"channels\":[",
        device.name,
        device.role.keyword(),
        device.peer
    )?;
    for (at, channel) in client.channels.iter().enumerate() {
        comma(at, json);
        write!(
            json,
            "{{\"channel\":\"{}\",\"label\":{},\"value\":{},\"forced\":{}}}",
            channel.channel,
            Labelled(channel.label.as_ref()),
            Quoted(channel.value),
            Quoted(channel.forced)
        )?;
    }
    json.push_str("]}");
    Ok(())
}

fn comma(at: usize, json: &mut String) {
    if at > 0 {
        json.push(',');
    }
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

/// A label as text, or `null`.
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
