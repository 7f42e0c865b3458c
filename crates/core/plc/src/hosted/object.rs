//! Determines the type of a program file from its first bytes, because the messages of the system's loader
//! ("wrong ELF class") do not help users.

use tickbus_base::Mistake;

/// The magic bytes of an ELF file.
const ELF: &[u8] = b"\x7FELF";

/// The target of a loadable file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Machine {
    bits: u8,
    big_endian: bool,
    /// ELF's number of the processor.
    number: u16,
}

/// Known processors, with their numbers in ELF.
const PROCESSORS: [(u16, &str); 8] = [
    (3, "x86"),
    (8, "MIPS"),
    (20, "PowerPC"),
    (21, "64-bit PowerPC"),
    (40, "ARM"),
    (62, "x86-64"),
    (183, "64-bit ARM"),
    (243, "RISC-V"),
];

impl Machine {
    /// The processor of this process, if known.
    pub(super) fn own() -> Option<Self> {
        let number = match std::env::consts::ARCH {
            "x86" => 3,
            "powerpc64" => 21,
            "arm" => 40,
            "x86_64" => 62,
            "aarch64" => 183,
            "riscv64" => 243,
            _ => return None,
        };
        let elf = cfg!(all(unix, not(target_vendor = "apple")));
        elf.then_some(Self {
            bits: u8::try_from(usize::BITS).unwrap_or(0),
            big_endian: cfg!(target_endian = "big"),
            number,
        })
    }

    fn name(self) -> String {
        let known = PROCESSORS.iter().find(|(number, _)| *number == self.number);
        let processor = known.map_or_else(
            || format!("processor no. {} of ELF", self.number),
            |(_, name)| (*name).to_owned(),
        );
        let order = if self.big_endian { ", big-endian" } else { "" };
        format!("{} bits, {processor}{order}", self.bits)
    }
}

/// Checks whether the file that begins with `bytes` can be loaded on `own`.
///
/// # Errors
///
/// The file is of another type; the message says which, and what to do.
pub(super) fn check(bytes: &[u8], own: Option<Machine>) -> Result<(), Mistake> {
    let build = "build a shared object from it (docs/own-plc-program.md)".to_owned();
    if bytes.is_empty() {
        return Err(Mistake::new("is an empty file", build));
    }
    let Some(own) = own else {
        // Other systems' formats are left to their loader.
        return Ok(());
    };
    if !bytes.starts_with(ELF) {
        let what = if bytes.starts_with(b"MZ") {
            "is a library for Windows".to_owned()
        } else if [&b"\xCF\xFA\xED\xFE"[..], b"\xCA\xFE\xBA\xBE"]
            .iter()
            .any(|magic| bytes.starts_with(magic))
        {
            "is a library for macOS".to_owned()
        } else {
            return Err(Mistake::new("is no shared object", build));
        };
        return Err(Mistake::new(
            what,
            format!("build it for this system ({})", own.name()),
        ));
    }
    let header = bytes.get(..20).and_then(|header| {
        let bits = match header[4] {
            1 => 32,
            2 => 64,
            _ => return None,
        };
        let big_endian = match header[5] {
            1 => false,
            2 => true,
            _ => return None,
        };
        let half = |at: usize| {
            let bytes = [header[at], header[at + 1]];
            if big_endian {
                u16::from_be_bytes(bytes)
            } else {
                u16::from_le_bytes(bytes)
            }
        };
        let machine = Machine {
            bits,
            big_endian,
            number: half(18),
        };
        Some((machine, half(16)))
    });
    let Some((machine, kind)) = header else {
        return Err(Mistake::new(
            "is an ELF file that is cut off or damaged",
            "build it anew",
        ));
    };
    if machine != own {
        return Err(Mistake::new(
            format!("is built for another machine ({})", machine.name()),
            format!("build it for this one ({})", own.name()),
        ));
    }
    match kind {
        3 if is_whole(bytes, machine) => Ok(()),
        3 => Err(Mistake::new(
            "is cut off",
            "copy the whole of it, or build it anew",
        )),
        1 => Err(Mistake::new(
            "is an object file that is not linked",
            "link it with cc -shared",
        )),
        2 => Err(Mistake::new("is an executable", "link it with cc -shared")),
        _ => Err(Mistake::new("is an ELF file, but no shared object", build)),
    }
}

/// True if the segments to be loaded are completely in the file: the loader maps them without checking, and the process
/// would crash on access. 32-bit files are not checked.
fn is_whole(bytes: &[u8], machine: Machine) -> bool {
    if machine.bits != 64 {
        return true;
    }
    let number = |at: u64, size: usize| -> Option<u64> {
        let at = usize::try_from(at).ok()?;
        let field = bytes.get(at..at.checked_add(size)?)?;
        let mut number = [0; 8];
        number[..size].copy_from_slice(field);
        if machine.big_endian {
            number[..size].reverse();
        }
        Some(u64::from_le_bytes(number))
    };
    let reaches = || -> Option<u64> {
        let (first, size, count) = (number(32, 8)?, number(54, 2)?, number(56, 2)?);
        let mut end = 0;
        for index in 0..count {
            let header = first.checked_add(index * size)?;
            let (offset, length) = (
                number(header.checked_add(8)?, 8)?,
                number(header.checked_add(32)?, 8)?,
            );
            end = end.max(offset.checked_add(length)?);
        }
        Some(end)
    };
    reaches().is_some_and(|end| end <= bytes.len() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OWN: Machine = Machine {
        bits: 64,
        big_endian: false,
        number: 62,
    };

    /// The first bytes of an ELF file.
    fn elf(class: u8, data: u8, kind: u16, machine: u16) -> Vec<u8> {
        let halves = [kind, machine].map(|half| {
            if data == 2 {
                half.to_be_bytes()
            } else {
                half.to_le_bytes()
            }
        });
        let mut bytes = [ELF, &[class, data, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0]].concat();
        bytes.extend(halves.concat());
        bytes
    }

    fn refusal(bytes: &[u8]) -> String {
        let mistake = check(bytes, Some(OWN)).expect_err("refused");
        mistake.to_string()
    }

    /// A shared object for [`OWN`] with one segment that ends with the file.
    fn shared_object() -> Vec<u8> {
        let mut bytes = elf(2, 1, 3, 62);
        bytes.resize(200, 0);
        bytes[32] = 64;
        bytes[54] = 56;
        bytes[56] = 1;
        bytes[64 + 8] = 150;
        bytes[64 + 32] = 50;
        bytes
    }

    #[test]
    fn a_shared_object_for_this_machine_passes() {
        assert_eq!(check(&shared_object(), Some(OWN)), Ok(()));
    }

    #[test]
    fn other_machines_are_told_by_name() {
        for (bytes, machine) in [
            (elf(1, 1, 3, 3), "32 bits, x86"),
            (elf(1, 1, 3, 62), "32 bits, x86-64"),
            (elf(1, 1, 3, 40), "32 bits, ARM"),
            (elf(2, 1, 3, 183), "64 bits, 64-bit ARM"),
            (elf(1, 2, 3, 20), "32 bits, PowerPC, big-endian"),
            (elf(2, 1, 3, 9999), "64 bits, processor no. 9999 of ELF"),
        ] {
            assert_eq!(
                refusal(&bytes),
                format!(
                    "is built for another machine ({machine}); build it for this one (64 bits, x86-64)"
                )
            );
        }
    }

    #[test]
    fn files_that_are_no_shared_objects_are_told_apart() {
        let build = "build a shared object from it (docs/own-plc-program.md)";
        let link = "link it with cc -shared";
        for (bytes, says) in [
            (Vec::new(), format!("is an empty file; {build}")),
            (
                b"PROGRAM main".to_vec(),
                format!("is no shared object; {build}"),
            ),
            (
                elf(2, 1, 1, 62),
                format!("is an object file that is not linked; {link}"),
            ),
            (elf(2, 1, 2, 62), format!("is an executable; {link}")),
            (
                elf(2, 1, 4, 62),
                format!("is an ELF file, but no shared object; {build}"),
            ),
            (
                b"MZ\x90\0".to_vec(),
                "is a library for Windows; build it for this system (64 bits, x86-64)".to_owned(),
            ),
        ] {
            assert_eq!(refusal(&bytes), says);
        }
    }

    #[test]
    fn every_truncation_is_refused() {
        let whole = shared_object();
        for length in 0..whole.len() {
            check(&whole[..length], Some(OWN)).expect_err("refused");
        }
    }

    #[test]
    fn the_machine_that_runs_the_tests_is_known() {
        let own = Machine::own();
        if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
            assert_eq!(own, Some(OWN));
        }
    }
}
