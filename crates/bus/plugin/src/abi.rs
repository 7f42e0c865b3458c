//! Mirrors `include/tickbus_fieldbus.h`: the same structs, constants and functions.

use std::ffi::c_char;
use std::marker::{PhantomData, PhantomPinned};

/// The version of the interface.
pub(super) const VERSION: u32 = 1;

/// The result of a successful `tickbus_open`.
pub(super) const OK: i32 = 0;

/// The flags that `tickbus_exchange` returns, combined.
pub(super) mod flag {
    pub(crate) const TAKEN: i32 = 1;
    pub(crate) const FRESH: i32 = 2;
    pub(crate) const ALIVE: i32 = 4;
}

/// The errors that `tickbus_open` and `tickbus_exchange` return.
pub(super) mod error {
    pub(crate) const LINK: i32 = -1;
    pub(crate) const PROTOCOL: i32 = -2;
    pub(crate) const REFUSED: i32 = -3;
    pub(crate) const CONFIG: i32 = -4;
    pub(crate) const UNSUPPORTED: i32 = -5;
    pub(crate) const LEFT: i32 = -6;
}

pub(super) const ROLE_DEVICE: u32 = 0;
pub(super) const ROLE_CONTROLLER: u32 = 1;

#[repr(C)]
#[derive(Debug)]
pub(super) struct Option {
    pub(super) size: u32,
    pub(super) key: *const c_char,
    pub(super) value: *const c_char,
}

#[repr(C)]
#[derive(Debug)]
pub(super) struct Config {
    pub(super) size: u32,
    pub(super) role: u32,
    pub(super) name: *const c_char,
    pub(super) directory: *const c_char,
    pub(super) options: *const *const Option,
    pub(super) option_count: u32,
    pub(super) timeout_ms: u32,
    pub(super) cycle_ns: u64,
    pub(super) max_age_ns: u64,
}

#[repr(C)]
#[derive(Debug)]
pub(super) struct Station {
    pub(super) size: u32,
    pub(super) in_offset: u32,
    pub(super) in_size: u32,
    pub(super) out_offset: u32,
    pub(super) out_size: u32,
    pub(super) name: *const c_char,
}

#[repr(C)]
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) size: u32,
    pub(super) in_size: u32,
    pub(super) out_size: u32,
    pub(super) station_count: u32,
    pub(super) stations: *const *const Station,
}

/// `tickbus_bus`, which is opaque outside the library.
#[repr(C)]
#[derive(Debug)]
pub(super) struct Bus {
    _bytes: [u8; 0],
    _marker: PhantomData<(*mut u8, PhantomPinned)>,
}

/// The size of a struct, for its first member.
pub(super) fn size_of<T>() -> u32 {
    u32::try_from(std::mem::size_of::<T>()).expect("structs are small")
}

#[cfg(all(test, unix, not(no_cc)))]
mod tests {
    use super::*;
    use std::fmt::Write as _;
    use std::mem::offset_of;
    use std::path::Path;
    use std::process::Command;

    /// Each constant's name in C and its value here.
    fn numbers() -> Vec<(String, i64)> {
        macro_rules! members {
            ($list:ident, $c:literal, $rust:ty, $($member:ident)*) => {
                $list.push((concat!("sizeof(", $c, ")").to_owned(), size_of::<$rust>().into()));
                $($list.push((
                    format!("offsetof({}, {})", $c, stringify!($member)),
                    i64::try_from(offset_of!($rust, $member)).unwrap(),
                ));)*
            };
        }
        let mut list: Vec<(String, i64)> = [
            ("TICKBUS_ABI_VERSION", VERSION.into()),
            ("TICKBUS_OK", OK.into()),
            ("TICKBUS_TAKEN", flag::TAKEN.into()),
            ("TICKBUS_FRESH", flag::FRESH.into()),
            ("TICKBUS_ALIVE", flag::ALIVE.into()),
            ("TICKBUS_E_LINK", error::LINK.into()),
            ("TICKBUS_E_PROTOCOL", error::PROTOCOL.into()),
            ("TICKBUS_E_REFUSED", error::REFUSED.into()),
            ("TICKBUS_E_CONFIG", error::CONFIG.into()),
            ("TICKBUS_E_UNSUPPORTED", error::UNSUPPORTED.into()),
            ("TICKBUS_E_LEFT", error::LEFT.into()),
            ("TICKBUS_ROLE_DEVICE", ROLE_DEVICE.into()),
            ("TICKBUS_ROLE_CONTROLLER", ROLE_CONTROLLER.into()),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into();
        members!(list, "tickbus_option", Option, size key value);
        members!(list, "tickbus_config", Config,
            size role name directory options option_count timeout_ms cycle_ns max_age_ns);
        members!(list, "tickbus_station", Station,
            size in_offset in_size out_offset out_size name);
        members!(list, "tickbus_layout", Layout, size in_size out_size station_count stations);
        list
    }

    #[test]
    fn the_header_has_the_same_structs_and_numbers() {
        let numbers = numbers();
        let mut source =
            String::from("#include <stdio.h>\n#include \"tickbus_fieldbus.h\"\nint main(void) {\n");
        for (name, _) in &numbers {
            writeln!(source, "printf(\"%ld\\n\", (long)({name}));").expect("a string takes all");
        }
        source.push_str("return 0; }\n");
        let folder = tempfile::tempdir().expect("a folder");
        let (file, program) = (folder.path().join("abi.c"), folder.path().join("abi"));
        std::fs::write(&file, source).expect("the source is written");
        let include = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../include");
        let built = Command::new("cc")
            .args(["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-I"])
            .args([&include, Path::new("-o"), &program, &file])
            .status();
        assert!(built.expect("cc runs").success());
        let printed = Command::new(&program).output().expect("it runs").stdout;
        let printed = String::from_utf8(printed).expect("numbers");
        let in_c: Vec<i64> = printed.lines().map(|line| line.parse().unwrap()).collect();
        assert_eq!(in_c.len(), numbers.len());
        for ((name, here), in_c) in numbers.iter().zip(in_c) {
            assert_eq!(in_c, *here, "{name}");
        }
    }
}
