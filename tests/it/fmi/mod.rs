//! FMI, without foreign programs: FMUs in C as machine and as PLC, wrong and hostile FMUs, and exported FMUs.
#![cfg(not(no_cc))]
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

mod export;
mod faults;
mod fit;
mod fixture;
pub(crate) mod run;
mod three;
mod wrong;
