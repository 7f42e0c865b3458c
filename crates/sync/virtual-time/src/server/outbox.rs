//! The messages that are to be sent.

use super::{Phase, Seat, Server, ToClient};
use crate::Ended;

/// A message to be sent, with the seat of its receiver; its content is looked up when it is sent.
#[derive(Debug)]
pub(super) enum Out {
    Start(usize),
    Step(usize),
    Waiting(usize),
    Meet(usize),
    Members(usize, usize),
    Until(usize),
    Save(usize, u64),
    Restore(usize),
    End(usize),
    Refused(usize, Box<Ended>),
}

impl Out {
    /// The receiver.
    pub(super) const fn seat(&self) -> usize {
        match self {
            Self::Start(seat)
            | Self::Step(seat)
            | Self::Waiting(seat)
            | Self::Meet(seat)
            | Self::Members(seat, _)
            | Self::Until(seat)
            | Self::Save(seat, _)
            | Self::Restore(seat)
            | Self::End(seat)
            | Self::Refused(seat, _) => *seat,
        }
    }
}

impl Server<'_> {
    /// The next message, and the seat of its receiver.
    pub fn poll(&mut self) -> Option<(usize, ToClient<'_>)> {
        let out = self.outbox.pop_front()?;
        let seat = out.seat();
        let message = match (out, &self.phase, self.seats[seat]) {
            (Out::Step(_), Phase::Running(barrier, _), Seat::Client(client)) => ToClient::Step {
                step: barrier.step(),
                reads: barrier.snapshot(client),
            },
            (Out::Step(_), Phase::Running(..), Seat::Back(_)) => {
                self.replayed(seat).expect("it is asked again")
            }
            (
                Out::Start(_),
                Phase::Running(barrier, _),
                Seat::Client(client) | Seat::Back(client),
            ) => ToClient::Start {
                step: self.settings.step,
                reads: barrier.read_types(client),
            },
            (Out::Waiting(_), ..) => ToClient::Waiting(&self.waits_for),
            (Out::Meet(_), ..) => ToClient::Meet(self.token()),
            (Out::Members(_, own), ..) => match &self.meeting {
                Some(meeting) => ToClient::Members(own, &meeting.list),
                // The client of another seat has left in the meantime; a new token makes this one forget the meeting.
                None => ToClient::Meet(0),
            },
            (Out::Until(_), ..) => ToClient::Until(self.until()),
            (Out::Save(_, step), ..) => ToClient::Save(step),
            (Out::Restore(_), Phase::Running(barrier, _), Seat::Back(client)) => {
                self.rejoining.state(client, barrier)
            }
            (Out::Refused(_, ended), ..) => {
                self.seats[seat] = Seat::Free;
                self.refused = Err(*ended);
                ToClient::End(&self.refused)
            }
            (Out::End(_), Phase::Ended(outcome), _) => {
                self.seats[seat] = Seat::Free;
                ToClient::End(outcome)
            }
            (out, ..) => unreachable!("{out:?} does not outlive its phase"),
        };
        Some((seat, message))
    }
}
