//! Names that IEC 61131-3 gives a meaning, and names that read a clock.

/// The timers that have a replacement on virtual time.
pub(crate) const TIMERS: [&str; 4] = ["TON", "TOF", "TP", "RTC"];

/// Prefix of the replacements.
pub(crate) const PREFIX: &str = "TICKBUS_";

/// True if a name is reserved for inserted code. Other names begin with the same prefix: `tickbus export` makes them.
pub(crate) fn is_put_in(name: &str) -> bool {
    let name = name.to_ascii_uppercase();
    let Some(rest) = name.strip_prefix(PREFIX) else {
        return false;
    };
    let own = "ACTION_CONTROL SCHEDULER SCHEDULE CYCLE FIRST NOW SIMULATED EXECUTE";
    let begins = |start| {
        rest.strip_prefix(start)
            .is_some_and(|rest: &str| rest.starts_with(|c: char| c.is_ascii_digit()))
    };
    // Those of diagrams as text have the numbers of their elements.
    is_in(own, rest)
        || rest.starts_with("EXECUTE_")
        || begins("WIRE_")
        || begins("EDGE_")
        || begins("JUMP_")
        || TIMERS.contains(&rest)
}

/// True if a name is one of the inserted variables: no type or program can have that name, too.
pub(crate) fn is_variable_put_in(name: &str) -> bool {
    is_in(
        "HANDSHAKE GO MS DONE GO_END DONE_END SIMULATED STEPPING NOW",
        name,
    )
}

const TYPES: &str = "BOOL BYTE WORD DWORD LWORD SINT INT DINT LINT USINT UINT UDINT ULINT REAL LREAL TIME LTIME DATE LDATE TOD \
    TIME_OF_DAY LTOD DT DATE_AND_TIME LDT STRING WSTRING CHAR WCHAR ANY";

/// Blocks of the standard, of iec2c's library and of CODESYS' that use no clock. Those for closed-loop control get
/// their cycle as an input.
const BLOCKS: &str = "R_TRIG F_TRIG SR RS SEMA CTU CTD CTUD CTU_DINT CTU_LINT CTU_UDINT CTU_ULINT CTD_DINT CTD_LINT CTD_UDINT \
    CTD_ULINT CTUD_DINT CTUD_LINT CTUD_UDINT CTUD_ULINT DERIVATIVE INTEGRAL HYSTERESIS RAMP";

const FUNCTIONS: &str = "ABS SQRT LN LOG EXP SIN COS TAN ASIN ACOS ATAN ATAN2 EXPT ADD SUB MUL DIV MOD MOVE SHL SHR ROL ROR AND OR \
    XOR NOT SEL MAX MIN LIMIT MUX GT GE EQ LE LT NE LEN LEFT RIGHT MID CONCAT INSERT DELETE REPLACE FIND TRUNC ROUND CEIL FLOOR \
    ADD_TIME SUB_TIME MULTIME MUL_TIME DIVTIME DIV_TIME ADD_TOD_TIME ADD_DT_TIME SUB_DATE_DATE SUB_TOD_TIME SUB_TOD_TOD \
    SUB_DT_TIME SUB_DT_DT CONCAT_DATE_TOD DATE_AND_TIME_TO_TIME_OF_DAY DATE_AND_TIME_TO_DATE ADR SIZEOF REF";

/// Words that precede no call, but an expression in brackets.
const KEYWORDS: &str = "IF ELSIF ELSE WHILE UNTIL REPEAT CASE OF AND OR XOR NOT MOD TO BY DO THEN RETURN EXIT CONTINUE FOR AND_THEN \
    OR_ELSE";

/// Functions and types of vendors that read their own clock.
const CLOCKS: &str = "TIME LTIME TIME_TCK RD_SYS_T WR_SYS_T RD_LOC_T SYSTIMEGETMS SYSTIMEGETUS SYSTIMEGETNS SYSTIMERTCGET GETSYSTEMTIME \
    GETTASKTIME F_GETSYSTEMTIME RUNTIME T_READ TONR TOFR LTON LTOF LTP TON_TIME TOF_TIME TP_TIME TONR_TIME TON_LTIME TOF_LTIME \
    TP_LTIME TONR_LTIME IEC_TIMER IEC_LTIMER S_ODT S_ODTS S_OFFDT S_PULSE S_PEXT BLINK GEN PID PD PID_FIXCYCLE FREQ_MEASURE";

/// True if a list has a name, in any case.
pub(crate) fn is_in(list: &str, name: &str) -> bool {
    list.split_ascii_whitespace()
        .any(|one| one.eq_ignore_ascii_case(name))
}

pub(crate) fn is_elementary(name: &str) -> bool {
    is_in(TYPES, name)
}

/// True if a type of this name is in the standard and uses no clock.
pub(crate) fn is_standard_type(name: &str) -> bool {
    is_elementary(name) || is_in(BLOCKS, name)
}

/// True if a function of this name is in the standard, or converts between elementary types.
pub(crate) fn is_standard_function(name: &str) -> bool {
    let name = name.to_ascii_uppercase();
    let is_value = |name: &str| is_elementary(name) || matches!(name, "BCD" | "STR");
    let converts = name
        .match_indices("_TO_")
        .any(|(at, _)| is_value(&name[..at]) && is_value(&name[at + 4..]));
    let to = |prefix| name.strip_prefix(prefix).is_some_and(is_elementary);
    is_in(FUNCTIONS, &name) || converts || to("TO_") || to("TRUNC_")
}

pub(crate) fn is_keyword(name: &str) -> bool {
    is_in(KEYWORDS, name)
}

/// True if this name reads a clock in the library of any vendor.
pub(crate) fn is_clock(name: &str) -> bool {
    is_in(CLOCKS, name)
}

/// Operators that begin an instruction in IL.
pub(crate) const INSTRUCTIONS: &[&str] = &[
    "LD", "LDN", "ST", "STN", "CAL", "CALC", "CALCN", "JMP", "JMPC", "JMPCN", "RET",
];
