//! A master's requests before it exchanges data: `Set_Prm` and `Chk_Cfg`.

use tickbus_base::time::Nanos;

use super::{Process, State, Station, diagnosis};
use crate::event::{Event, Leaving};
use crate::parameters::Parameters;

impl Station {
    /// `Set_Prm`: always acknowledged; the diagnosis shows whether the parameters were right.
    pub(super) fn parameterise(
        &mut self,
        now: Nanos,
        master: u8,
        data: &[u8],
        process: &mut impl Process,
    ) {
        if self.owner.is_some_and(|owner| owner != master) {
            return;
        }
        self.refused = None;
        // The last exchange's answer may be the reason why the master restarts.
        self.is_pending = false;
        let Some(parameters) = Parameters::read(data) else {
            let why = format!("{} octets, expected at least 7", data.len());
            return self.refuse(now, master, why, process);
        };
        if parameters.unlock {
            if self.state != State::WaitPrm {
                self.leave(now, Leaving::Released { master }, process);
            }
            return;
        }
        if parameters.lock {
            let own = self.identity.ident;
            if parameters.ident != own {
                let why = format!(
                    "expected ident {own:04X}, received {:04X}",
                    parameters.ident
                );
                return self.refuse(now, master, why, process);
            }
            let watchdog = parameters.watchdog(self.identity.dpv1);
            if watchdog == Some(Nanos(0)) {
                let why = "the watchdog is on, and its time is 0".to_owned();
                return self.refuse(now, master, why, process);
            }
            if parameters.sync && !self.identity.sync || parameters.freeze && !self.identity.freeze
            {
                let why = "SYNC or FREEZE, which its GSD does not have".to_owned();
                self.refuse(now, master, why, process);
                self.faults = diagnosis::Faults {
                    not_supported: true,
                    ..diagnosis::Faults::default()
                };
                return;
            }
            match self.identity.user.check(parameters.user) {
                Ok(None) => {}
                Ok(Some(unusual)) => log::debug!("station {}: {unusual}", self.address),
                Err(why) => return self.refuse(now, master, why, process),
            }
            self.faults = diagnosis::Faults::default();
            self.has_sync = parameters.sync;
            self.has_freeze = parameters.freeze;
            self.is_synced &= parameters.sync;
            self.is_held &= parameters.sync;
            self.is_frozen &= parameters.freeze;
            self.group = parameters.group;
            self.watchdog = watchdog;
            self.fail_safe = self.identity.fail_safe || parameters.fail_safe(self.identity.dpv1);
            self.heard = now;
            let is_enabled = parameters.enables_dpv1(self.identity.dpv1);
            self.acyclic.reset(is_enabled);
            let [types, mode] = parameters.alarms().filter(|_| is_enabled).unwrap_or([0; 2]);
            self.acyclic.alarms.enable(types, mode);
            self.offer_alarm();
            if self.state == State::WaitPrm {
                self.owner = Some(master);
                self.state = State::WaitCfg;
                process.tell(self.address, now, Event::Parameterised { master });
            }
        }
        if parameters.min_tsdr != 0 {
            self.min_tsdr = parameters.min_tsdr;
        }
    }

    fn refuse(&mut self, now: Nanos, master: u8, why: String, process: &mut impl Process) {
        self.leave(now, Leaving::Parameters { master, why }, process);
        self.faults = diagnosis::Faults {
            parameters: true,
            ..diagnosis::Faults::default()
        };
        self.refused = Some(master);
    }

    /// `Chk_Cfg`, also always acknowledged.
    pub(super) fn check(
        &mut self,
        now: Nanos,
        master: u8,
        data: &[u8],
        process: &mut impl Process,
    ) {
        if let Some(why) = self.identity.configuration.difference(data) {
            self.leave(now, Leaving::Configuration { master, why }, process);
            self.faults.configuration = true;
            return;
        }
        self.faults.configuration = false;
        if self.state == State::WaitCfg {
            self.state = State::DataExch;
            process.tell(self.address, now, Event::Exchanges { master });
            self.offer_alarm();
        }
    }
}
