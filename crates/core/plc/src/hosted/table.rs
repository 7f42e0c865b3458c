//! The table of `plc/glue/tickbus_plc.h`, and safe functions around the foreign code behind it.
//!
//! This is the only place where a PLC program's memory is accessed and its functions are called. Whatever can
//! be checked is checked when it is loaded: version, sizes, and that no pointer is null. That the program
//! does not damage the rest of the process cannot be checked; the user who names its file vouches for that.

#![allow(unsafe_code, reason = "a user's program is loaded and called")]

use std::ffi::{CStr, c_char, c_void};
use std::ptr::NonNull;

use tickbus_base::Mistake;
use tickbus_base::os::Library;
use tickbus_base::time::Nanos;

/// The supported version of the header.
pub(super) const VERSION: u32 = 1;

/// The most located variables that are plausible; a process image has at most a million bits.
const MOST_VARIABLES: u32 = 2_000_000;

/// The most numbers of one address that are plausible.
const MOST_NUMBERS: u32 = 64;

/// Mirrors `struct tickbus_located`.
#[repr(C)]
struct Located {
    data_type: *const c_char,
    area: *const c_char,
    size: *const c_char,
    index: *const u32,
    value: *mut c_void,
    indices: u32,
    bytes: u32,
}

/// Mirrors `struct tickbus_plc`.
#[repr(C)]
#[derive(Clone, Copy)]
struct Table {
    version: u32,
    bytes: u32,
    located_bytes: u32,
    located_count: u32,
    located: *const Located,
    init: Option<unsafe extern "C" fn()>,
    tick_time: Option<unsafe extern "C" fn() -> u64>,
    greatest_tick: Option<unsafe extern "C" fn() -> u64>,
    scan: Option<unsafe extern "C" fn(i64, i64, u64)>,
}

/// A located variable as declared by the program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Declared {
    /// The IEC type.
    pub(super) data_type: String,
    /// `I`, `Q` or `M`.
    pub(super) area: String,
    /// The size letter.
    pub(super) size: String,
    /// The numbers of the address.
    pub(super) numbers: Vec<u32>,
    /// The size of the value.
    pub(super) bytes: usize,
}

/// The value of a located variable.
#[derive(Clone, Copy, Debug)]
struct Value {
    address: NonNull<u8>,
    bytes: usize,
}

/// A compiled program in this process. Its variables are identified by their index in the declarations.
#[derive(Debug)]
pub(super) struct Compiled {
    values: Vec<Value>,
    scan: unsafe extern "C" fn(i64, i64, u64),
    tick_time: u64,
    greatest_tick: u64,
    #[expect(dead_code, reason = "kept loaded for its functions and its memory")]
    library: Library,
}

const REBUILD: &str = "build it anew with the plc/glue of this tickbus";

impl Compiled {
    /// Finds the program in a library that was loaded only once, and initialises it.
    ///
    /// # Errors
    ///
    /// The library has no table, or one of another version, or an invalid one.
    pub(super) fn begin(library: Library) -> Result<(Self, Vec<Declared>), Mistake> {
        // SAFETY: the glue exports a variable of this type under this name, in every version of the table.
        let Ok(address) = (unsafe { library.symbol::<*const Table>("tickbus_plc") }) else {
            let what = "has no symbol \"tickbus_plc\"";
            return Err(if library.has("config_run__") {
                Mistake::new(
                    what,
                    "compile plc/glue/tickbus_plc.c into it, beside the files that iec2c wrote",
                )
            } else {
                Mistake::new(what, "build it as docs/own-plc-program.md tells")
            });
        };
        let broken = |what: &str| Mistake::new(format!("has a broken table: {what}"), REBUILD);
        if address.is_null() || !address.is_aligned() {
            return Err(broken("it lies nowhere"));
        }
        // SAFETY: the symbol exists, so that memory of the loaded library is there, aligned as checked. By
        // the header its first two numbers are version and size in every version of the table, and constant.
        let (version, bytes) = unsafe { ((*address).version, (*address).bytes) };
        if version != VERSION {
            return Err(Mistake::new(
                format!(
                    "was built with version {version} of the glue, and this tickbus has version {VERSION}"
                ),
                REBUILD,
            ));
        }
        if usize::try_from(bytes) != Ok(size_of::<Table>()) {
            return Err(broken("its size is wrong"));
        }
        // SAFETY: as above; and it says of itself that it has the size and the version of `Table`, so that
        // all of it is there. Every bit pattern of it is a `Table`: numbers, pointers, optional functions.
        let table = unsafe { *address };
        if usize::try_from(table.located_bytes) != Ok(size_of::<Located>()) {
            return Err(broken("the size of its entries is wrong"));
        }
        let (Some(init), Some(tick_time), Some(greatest_tick), Some(scan)) =
            (table.init, table.tick_time, table.greatest_tick, table.scan)
        else {
            return Err(broken("a function is missing"));
        };
        let (declared, values) = declarations(&table)?;
        // SAFETY: the functions have these types by the header of this version. Nobody else has this copy
        // of the program, so that they are called from one thread at a time, and `init` first and once.
        let (tick_time, greatest_tick) = unsafe {
            init();
            (tick_time(), greatest_tick())
        };
        let program = Self {
            values,
            scan,
            tick_time,
            greatest_tick,
            library,
        };
        Ok((program, declared))
    }

    /// The scan interval that the program was compiled for; `None` if it does not depend on it.
    pub(super) fn tick_time(&self) -> Option<Nanos> {
        let time = i64::try_from(self.tick_time).ok().map(Nanos);
        time.filter(|time| *time > Nanos::ZERO)
    }

    /// The scan number after `tick`.
    pub(super) fn next_tick(&self, tick: u64) -> u64 {
        let next = tick.wrapping_add(1);
        next.checked_rem(self.greatest_tick).unwrap_or(next)
    }

    /// Runs the program once, at `now`.
    pub(super) fn scan(&mut self, now: Nanos, tick: u64) {
        const SECOND: i64 = 1_000_000_000;
        let (seconds, nanos) = (now.0.div_euclid(SECOND), now.0.rem_euclid(SECOND));
        // SAFETY: the function has this type by the header, and its library is loaded as long as `self`;
        // `&mut self` keeps everyone else away from the program meanwhile.
        unsafe { (self.scan)(seconds, nanos, tick) }
    }

    /// The value of a variable as an unsigned number; 0 for variables of more than 8 bytes.
    pub(super) fn read(&self, variable: usize) -> u64 {
        let Value { address, bytes } = self.values[variable];
        let mut number = [0; 8];
        if bytes > number.len() {
            return 0;
        }
        // SAFETY: by the header, `address` is that of a variable of `bytes` bytes. It is static memory of a
        // library that is loaded as long as `self`. The program does not run meanwhile, since that takes
        // `&mut self`. Single bytes need no alignment, and `number` has room for them.
        unsafe {
            std::ptr::copy_nonoverlapping(address.as_ptr(), number.as_mut_ptr(), bytes);
        }
        if cfg!(target_endian = "big") {
            number.rotate_right(8 - bytes);
        }
        u64::from_ne_bytes(number)
    }

    /// Sets a variable to the lower bits of `number`; a variable of more than 8 bytes does not change.
    pub(super) fn write(&mut self, variable: usize, number: u64) {
        let Value { address, bytes } = self.values[variable];
        let mut number = number.to_ne_bytes();
        if bytes > number.len() {
            return;
        }
        if cfg!(target_endian = "big") {
            number.rotate_left(8 - bytes);
        }
        // SAFETY: as in `read`; and by the header the memory can be written. `&mut self` keeps every other
        // reader away.
        unsafe {
            std::ptr::copy_nonoverlapping(number.as_ptr(), address.as_ptr(), bytes);
        }
    }
}

// SAFETY: the pointers lead into static memory of a library that was loaded for this `Compiled` alone, so
// that it belongs to whichever thread has the `Compiled`. C code that kept thread-local variables would not
// survive a move between two scans; the IEC compiler makes none, and a host scans on one thread.
unsafe impl Send for Compiled {}

/// Copies the declarations from the table.
fn declarations(table: &Table) -> Result<(Vec<Declared>, Vec<Value>), Mistake> {
    let count = table.located_count;
    let broken =
        |what: &str| -> Mistake { Mistake::new(format!("has a broken table: {what}"), REBUILD) };
    if count == 0 {
        return Ok((Vec::new(), Vec::new()));
    }
    if count > MOST_VARIABLES || table.located.is_null() || !table.located.is_aligned() {
        return Err(broken("it has no list of variables"));
    }
    // SAFETY: by the header, `located` points to `located_count` constant entries of the size that was
    // compared. Their number is bounded, and the pointer neither null nor unaligned.
    let located = unsafe { std::slice::from_raw_parts(table.located, count as usize) };
    let (mut declared, mut values) = (Vec::new(), Vec::new());
    for entry in located {
        let texts = [entry.data_type, entry.area, entry.size];
        let address = NonNull::new(entry.value.cast::<u8>());
        let Some(address) = address.filter(|_| texts.iter().all(|text| !text.is_null())) else {
            return Err(broken("a variable lies nowhere"));
        };
        if entry.indices > MOST_NUMBERS || entry.index.is_null() || !entry.index.is_aligned() {
            return Err(broken("a variable has no address"));
        }
        let [data_type, area, size] = texts.map(|text| {
            // SAFETY: by the header these are constant texts of C, which end with a 0 byte; none is null.
            let text = unsafe { CStr::from_ptr(text) };
            text.to_string_lossy().into_owned()
        });
        // SAFETY: by the header, `index` points to `indices` constant numbers; the pointer is neither null
        // nor unaligned, and their number bounded.
        let numbers =
            unsafe { std::slice::from_raw_parts(entry.index, entry.indices as usize) }.to_vec();
        declared.push(Declared {
            data_type,
            area,
            size,
            numbers,
            bytes: entry.bytes as usize,
        });
        values.push(Value {
            address,
            bytes: entry.bytes as usize,
        });
    }
    Ok((declared, values))
}
