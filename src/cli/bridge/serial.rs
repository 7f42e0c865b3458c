//! `tickbus bridge serial DEVICE`: an ASCII driver on a serial line as a client of the dispatcher.

use std::path::PathBuf;

use super::say;
use crate::cli::Outcome;
use crate::cli::lab::{dialled, key};
use tickbus_base::os::{Parity, SerialSettings};
use tickbus_base::time::{Monotonic, Stop};
use tickbus_bridge::serial::{Device, Hosting, VirtualPort, run as carry};
use tickbus_bridge::{AsciiBridge, LineEnd};
use tickbus_dispatcher::{Key, PORT};
use tickbus_net::Address;

/// Pass lines of text between a serial line and the dispatcher, for the ASCII driver of a SCADA system.
///
/// The program at the serial line uses the protocol of clients in docs/dispatcher.md. The bridge reconnects when the
/// dispatcher or the port was gone, and joins the client again.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The name of the serial port in the system.
    #[arg(required_unless_present = "pty", conflicts_with = "pty")]
    device: Option<String>,

    /// Create a virtual serial port of this name instead, for a driver on this machine.
    #[arg(long, value_name = "LINK")]
    pty: Option<PathBuf>,

    /// The address of the dispatcher.
    #[arg(long, value_name = "HOST:PORT", default_value_t = Address::local(PORT), value_parser = dialled)]
    dispatcher: Address,

    /// The file with the key of the laboratory, if it has one.
    #[arg(long, value_name = "FILE", value_parser = key)]
    key_file: Option<Key>,

    /// Bits per second.
    #[arg(long, value_name = "NUMBER", conflicts_with = "pty", default_value_t = 9600, value_parser = clap::value_parser!(u32).range(1..))]
    baud: u32,

    /// The parity bit.
    #[arg(long, value_enum, conflicts_with = "pty", default_value_t = ParityBit::None)]
    parity: ParityBit,

    /// The end of lines to the serial side; any of these is accepted from there.
    #[arg(long, value_enum, default_value_t = End::Crlf)]
    line_end: End,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum ParityBit {
    None,
    Even,
    Odd,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum End {
    Lf,
    Crlf,
    Cr,
}

pub(super) fn run(arguments: &Arguments, stop: &Stop) -> Outcome {
    let failed = |reason: String| {
        say(&format!("failed reason={reason:?}"));
        Outcome::BusFailed
    };
    let device = match (&arguments.pty, &arguments.device) {
        (Some(link), _) => match VirtualPort::new(link) {
            Ok(port) => Device::Virtual(port),
            Err(error) => {
                return failed(format!(
                    "cannot make a virtual port {} ({error}); give --pty the name of a link that does not exist yet",
                    link.display()
                ));
            }
        },
        (None, device) => {
            let settings = SerialSettings {
                baud: arguments.baud,
                parity: match arguments.parity {
                    ParityBit::None => Parity::None,
                    ParityBit::Even => Parity::Even,
                    ParityBit::Odd => Parity::Odd,
                },
                two_stop_bits: false,
                seven_bits: false,
                rs485: false,
            };
            Device::Port(device.clone().unwrap_or_default(), settings)
        }
    };
    if let Some(link) = &arguments.pty {
        say(&format!("virtual port {}", link.display()));
    }
    let mut bridge = AsciiBridge::new(match arguments.line_end {
        End::Lf => LineEnd::Lf,
        End::Crlf => LineEnd::CrLf,
        End::Cr => LineEnd::Cr,
    })
    .with_key(arguments.key_file.clone());
    let hosting = Hosting {
        clock: &*Monotonic::shared(),
        stop,
        news: &mut say,
    };
    if let Err(reason) = carry(&mut bridge, device, &arguments.dispatcher, hosting) {
        return failed(reason);
    }
    let traffic = bridge.traffic();
    say(&format!(
        "ok said={} heard={} overtaken={} dropped={}",
        traffic.said, traffic.heard, traffic.overtaken, traffic.dropped
    ));
    Outcome::Done
}
