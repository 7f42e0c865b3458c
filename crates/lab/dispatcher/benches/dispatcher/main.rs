//! The dispatcher compared with a bare hub that only passes lines on, and with NATS and Mosquitto where they are installed,
//! in alternating rounds of one run.
//!
//! Value lines through one pair of clients, written one by one and 64 at a time; through 100 pairs; the latency at 500
//! lines/s; 1,000 active clients beside 10,000 idle ones. Medians over the rounds; prints one `rust NAME VALUE` per line on
//! stdout.
//!
//! Pin it to one core from outside: waking another core costs more than everything measured here.
#![allow(missing_docs, reason = "a bench")]
#![allow(
    clippy::cast_precision_loss,
    clippy::naive_bytecount,
    reason = "counts are small, and a call per byte more is the same for all"
)]

#[cfg(unix)]
mod hub;
#[cfg(unix)]
mod measure;
#[cfg(unix)]
mod mosquitto;
#[cfg(unix)]
mod nats;

fn main() {
    #[cfg(unix)]
    measure::run();
}
