//! The line of a reader of code carriers: any bytes, in pieces and with pauses, to a reader and to a client that waits for an
//! answer.
//!
//! The first byte says which command the client waits for. Each piece has its length and the pause before it in front.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus_base::time::Nanos;
use tickbus_bus_identification::{
    Access, COMMAND_LIMIT, Carrier, CarrierType, Client, Command, Family, HEADS, Head, Heads, Outcome, Reader, Timing,
};

const TIMING: Timing = Timing {
    baud: 9600,
    timeout: Nanos::from_secs(1),
};

fuzz_target!(|data: &[u8]| {
    let Some((first, mut stream)) = data.split_first() else {
        return;
    };
    let (_, kind) = CarrierType::ALL[usize::from(first % 4)];
    let mut heads: [Head; HEADS] = Default::default();
    for head in &mut heads[..3] {
        head.is_connected = true;
    }
    heads[0].carrier = Some(Carrier::new(kind, b"\x03one"));
    heads[1].carrier = Some(Carrier::new(CarrierType::Idc1K, b"two"));
    let mut reader = Reader::new(heads, TIMING);
    let mut client = Client::new(kind, TIMING);
    let mut now = Nanos::from_secs(1);
    let length = first >> 4;
    let access = match first >> 2 & 3 {
        0 => Access::Read { address: 0, length },
        1 => Access::ReadNumber,
        2 => Access::ReadPage(0),
        _ => Access::Reset,
    };
    let heads = if first & 0x80 == 0 { Heads::One(1) } else { Heads::All };
    let is_auto = first & 0x40 != 0;
    client.ask(now, &Command::Access { heads, is_auto, access });
    while let [length, pause, rest @ ..] = stream {
        let (piece, behind) = rest.split_at(rest.len().min(usize::from(*length)));
        stream = behind;
        now += Nanos::from_millis(i64::from(*pause));
        for family in [Family::Idc, Family::Imc40] {
            if let Ok(Some((command, length))) = Command::parse(piece, family) {
                let mut made = Vec::new();
                command.append(family, &mut made);
                assert!(length <= COMMAND_LIMIT && made.len() == length);
            }
        }
        reader.hear(now, piece);
        reader.turn(now);
        // Every other time its client does not take the answers.
        if pause % 2 == 0 {
            let count = reader.to_write().len();
            reader.wrote(count);
        }
        assert!(reader.head(1).carrier.as_ref().is_some_and(|carrier| carrier.octets.len() == kind.size()));
        client.hear(now, piece);
        outcomes(&mut client, now, &access);
    }
    now += Nanos::from_secs(60);
    outcomes(&mut client, now, &access);
    assert!(!client.is_busy(), "each command comes to its end");
});

fn outcomes(client: &mut Client, now: Nanos, access: &Access<'_>) {
    while let Some(outcome) = client.poll(now) {
        let Outcome::Answered(answer) = outcome else {
            continue;
        };
        assert_eq!(answer.length, client.data().len());
        match access {
            _ if !answer.status.is_done() => assert_eq!(answer.length, 0),
            Access::Read { length, .. } => assert_eq!(answer.length, usize::from(*length)),
            Access::ReadPage(_) => assert_eq!(answer.length, 32),
            Access::Reset => assert_eq!(answer.length, 0),
            _ => {}
        }
    }
}
