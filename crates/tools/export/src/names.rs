//! Names that every PLC editor accepts.

use std::collections::HashSet;

/// The longest generated name: short enough for a tag list, and far below every editor's limit.
const LONGEST: usize = 60;

/// Words that cannot name a variable, in upper case: the keywords of IEC 61131-3, its types and its blocks,
/// and further reserved words of TIA Portal, CODESYS and `iec2c`.
#[rustfmt::skip]
const RESERVED: &[&str] = &[
    "ABS", "ABSTRACT", "ACOS", "ACTION", "ADD", "ADR", "ADRINST", "AND", "AND_THEN", "ANY", "ANY_BIT", "ANY_DATE",
    "ANY_DERIVED", "ANY_ELEMENTARY", "ANY_INT", "ANY_MAGNITUDE", "ANY_NUM", "ANY_REAL", "ANY_SIGNED_INT",
    "ANY_STRING", "ANY_UNSIGNED_INT", "ARRAY", "ASIN", "AT", "ATAN", "BEGIN", "BIT", "BITADR", "BOOL", "BY", "BYTE",
    "CAL", "CALC", "CALCN", "CASE", "CHAR", "CLASS", "CONCAT", "CONFIGURATION", "CONSTANT", "CONTINUE", "COS",
    "COUNTER", "CTD", "CTU", "CTUD", "DATA_BLOCK", "DATE", "DATE_AND_TIME", "DATE_AND_TIME_TO_TIME_OF_DAY", "DB", "DELETE", "DERIVATIVE", "DINT",
    "DIV", "DIVTIME", "DO", "DS", "DT", "DTL", "DWORD", "ELSE", "ELSIF", "EN", "END", "END_ACTION", "END_CASE",
    "END_CONFIGURATION", "END_FOR", "END_FUNCTION", "END_FUNCTION_BLOCK", "END_IF", "END_PROGRAM", "END_REPEAT",
    "END_RESOURCE", "END_STEP", "END_STRUCT", "END_TRANSITION", "END_TYPE", "END_VAR", "END_WHILE", "ENO", "EQ",
    "ERROR", "EXIT", "EXP", "EXPT", "EXTENDS", "FALSE", "FB", "FC", "FINAL", "FIND", "FOR", "FROM", "FUNCTION",
    "FUNCTION_BLOCK", "F_EDGE", "F_TRIG", "GE", "GOTO", "GT", "HYSTERESIS", "I", "IF", "IMPLEMENTS", "INDEXOF",
    "INI", "INITIAL_STEP", "INSERT", "INT", "INTEGRAL", "INTERFACE", "INTERNAL", "INTERVAL", "JMP", "JMPC", "JMPCN",
    "L", "LD", "LDATE", "LDN", "LDT", "LE", "LEFT", "LEN", "LIMIT", "LINT", "LN", "LOG", "LOWER_BOUND", "LREAL",
    "LT", "LTIME", "LTOD", "LWORD", "M", "MAX", "METHOD", "MID", "MIN", "MOD", "MOVE", "MUL", "MULTIME", "MUX", "N",
    "NE", "NETWORK", "NIL", "NON_RETAIN", "NOT", "NULL", "OB", "OF", "ON", "OR", "ORGANIZATION_BLOCK", "OR_ELSE",
    "OVERLAP", "OVERRIDE", "P", "PARAMS", "PERSISTENT", "PID", "POINTER", "PRIORITY", "PRIVATE", "PROGRAM",
    "PROPERTY", "PROTECTED", "PUBLIC", "Q", "R", "R1", "RAMP", "READ_ONLY", "READ_WRITE", "REAL", "REF",
    "REFERENCE", "REF_TO", "REGION", "REPEAT", "REPLACE", "RESOURCE", "RET", "RETAIN", "RETC", "RETCN", "RETURN",
    "RIGHT", "ROL", "ROR", "RS", "RTC", "R_EDGE", "R_TRIG", "S", "S1", "SD", "SEL", "SEMA", "SHL", "SHR", "SIN",
    "SINGLE", "SINT", "SIZEOF", "SL", "SQRT", "SR", "ST", "STEP", "STN", "STRING", "STRUCT", "SUB", "SUPER", "TAN",
    "TASK", "TEST_AND_SET", "THEN", "THIS", "TIME", "TIMER", "TIME_OF_DAY", "TO", "TOD", "TOF", "TON", "TP",
    "TRANSITION", "TRUE", "TRUNC", "TYPE", "UDINT", "UDT", "UINT", "ULINT", "UNION", "UNTIL", "UPPER_BOUND",
    "USING", "USINT", "VAR", "VARIANT", "VAR_ACCESS", "VAR_CONFIG", "VAR_EXTERNAL", "VAR_GENERIC", "VAR_GLOBAL",
    "VAR_INPUT", "VAR_INST", "VAR_IN_OUT", "VAR_OUTPUT", "VAR_STAT", "VAR_TEMP", "VERSION", "VOID", "WCHAR",
    "WHILE", "WITH", "WORD", "WSTRING", "XOR", "XSIZEOF",
];

/// The parts of the names of the standard's typed functions, in upper case: `INT_TO_REAL`, `MAX_DINT`,
/// `CTU_UDINT`, `SUB_DATE_DATE`, `WORD_BCD_TO_UINT`.
#[rustfmt::skip]
const TYPED: &[&str] = &[
    "ABS", "ACOS", "ADD", "AND", "ASIN", "ATAN", "BCD", "BOOL", "BYTE", "CONCAT", "COS", "CTD", "CTU", "CTUD", "DATE",
    "DINT", "DIV", "DIVTIME", "DT", "DWORD", "EQ", "EXP", "EXPT", "GE", "GT", "INT", "LE", "LIMIT", "LINT", "LN", "LOG",
    "LREAL", "LT", "LTIME", "LWORD", "MAX", "MIN", "MOD", "MOVE", "MUL", "MULTIME", "MUX", "NE", "NOT", "OF", "OR",
    "REAL", "ROL", "ROR", "ROUND", "SEL", "SHL", "SHR", "SIN", "SINT", "SQRT", "STRING", "SUB", "TAN", "TIME", "TO",
    "TOD", "TRUNC", "UDINT", "UINT", "ULINT", "USINT", "WORD", "WSTRING", "XOR",
];

/// Macros in the C headers that `iec2c`'s output includes, in upper case: a variable of that name would be
/// expanded.
#[rustfmt::skip]
const MACROS: &[&str] = &[
    "BIG_ENDIAN", "BUFSIZ", "BYTE_ORDER", "CHAR_BIT", "CHAR_MAX", "CHAR_MIN", "DBL_MAX", "DBL_MIN", "EN_ENO", "EOF",
    "EPOCH_YEAR", "EXIT_FAILURE", "EXIT_SUCCESS", "FLT_MAX", "FLT_MIN", "FLT_RADIX", "HUGE_VAL", "INFINITY",
    "INT_MAX", "INT_MIN", "LINE_MAX", "LITTLE_ENDIAN", "LONG_MAX", "LONG_MIN", "MAX_CANON", "MAX_INPUT", "M_1_PI",
    "M_2_PI", "M_2_SQRTPI", "M_E", "M_LN10", "M_LN2", "M_LOG10E", "M_LOG2E", "M_PI", "M_PI_2", "M_PI_4",
    "M_SQRT1_2", "M_SQRT2", "NAME_MAX", "NAN", "PATH_MAX", "PIPE_BUF", "RAND_MAX", "SECONDS_PER_DAY",
    "SECONDS_PER_HOUR", "SECONDS_PER_MINUTE", "SEEK_CUR", "SEEK_END", "SEEK_SET", "SHRT_MAX", "SHRT_MIN",
    "SIZE_MAX", "STR_MAX_LEN", "TIMER_ABSTIME", "TIME_UTC", "TMP_MAX", "UCHAR_MAX", "UINT_MAX", "ULONG_MAX",
    "USHRT_MAX", "WINT_MAX", "WINT_MIN",
];

/// The names given so far, ignoring case.
#[derive(Debug, Default)]
pub(super) struct Names {
    given: HashSet<String>,
}

impl Names {
    /// A legal name similar to `text` that was not given before. The same texts in the same order give the same names.
    pub(super) fn give(&mut self, text: &str) -> String {
        let name = legal(text);
        let mut wanted = name.clone();
        for number in 2_usize.. {
            if self.given.insert(wanted.to_ascii_uppercase()) {
                break;
            }
            wanted = format!("{name}_{number}");
        }
        wanted
    }
}

/// A name similar to `text` that is legal everywhere: ASCII letters, digits and single underscores, starting
/// with a letter, and not a reserved word.
pub(super) fn legal(text: &str) -> String {
    let mut name = String::new();
    for character in text.chars() {
        let piece = match character {
            'a'..='z' | 'A'..='Z' | '0'..='9' => {
                name.push(character);
                continue;
            }
            'ä' => "ae",
            'ö' => "oe",
            'ü' => "ue",
            'Ä' => "Ae",
            'Ö' => "Oe",
            'Ü' => "Ue",
            'ß' => "ss",
            'à' | 'á' | 'â' | 'ã' | 'å' => "a",
            'ç' => "c",
            'è' | 'é' | 'ê' | 'ë' => "e",
            'ì' | 'í' | 'î' | 'ï' => "i",
            'ñ' => "n",
            'ò' | 'ó' | 'ô' | 'õ' | 'ø' => "o",
            'ù' | 'ú' | 'û' => "u",
            '+' => "_plus_",
            '°' => "_deg_",
            '%' => "_percent_",
            _ => "_",
        };
        for character in piece.chars() {
            // IEC 61131-3 forbids two underscores in a row, some editors one at either end.
            if character != '_' || !(name.is_empty() || name.ends_with('_')) {
                name.push(character);
            }
        }
    }
    name.truncate(LONGEST);
    let end = name.trim_end_matches('_').len();
    name.truncate(end);
    if name.is_empty() {
        return "signal".to_owned();
    }
    if name.starts_with(|c: char| c.is_ascii_digit()) {
        name.insert_str(0, "n_");
    }
    // iec2c searches for the ends of units before it tokenises names, and finds one even in
    // "Weekend_program".
    for end in ["END_CONFIGURATION", "END_FUNCTION", "END_PROGRAM"] {
        while let Some(at) = name.to_ascii_uppercase().find(end) {
            name.remove(at + "END".len());
        }
    }
    if is_kept(&name.to_ascii_uppercase()) {
        name.push_str("_1");
    }
    name
}

/// Returns true if any of the languages reserves a name, in upper case.
fn is_kept(name: &str) -> bool {
    let is_typed = |word: &str| TYPED.binary_search(&word).is_ok();
    let is_in = |words: &[&str]| words.binary_search(&name).is_ok();
    is_in(RESERVED) || is_in(MACROS) || name.split('_').all(is_typed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_legal_and_stay_readable() {
        for (text, name) in [
            ("IM1 index", "IM1_index"),
            ("step feeder.Execute", "step_feeder_Execute"),
            ("!OK", "OK"),
            ("2 Förderband, \"links\"", "n_2_Foerderband_links"),
            ("__a__b__", "a_b"),
            ("Step", "Step_1"),
            ("int", "int_1"),
            ("日本", "signal"),
            ("Ramp", "Ramp_1"),
            ("INT_TO_REAL", "INT_TO_REAL_1"),
            ("date and time to date", "date_and_time_to_date_1"),
            ("Time to open", "Time_to_open"),
            ("End program now", "Endprogram_now"),
            ("Weekend program", "Weekendprogram"),
            ("Max input", "Max_input_1"),
            ("T+90°", "T_plus_90_deg"),
        ] {
            assert_eq!(legal(text), name, "{text}");
        }
        assert_eq!(legal(&"x".repeat(300)).len(), LONGEST);
    }

    #[test]
    fn no_name_is_given_twice_in_any_case() {
        let mut names = Names::default();
        let given: Vec<String> = ["a b", "A_B", "a-b", "a_b_2"]
            .iter()
            .map(|text| names.give(text))
            .collect();
        assert_eq!(given, ["a_b", "A_B_2", "a_b_3", "a_b_2_2"]);
    }

    #[test]
    fn the_reserved_words_are_in_order() {
        assert!(RESERVED.is_sorted());
        assert!(TYPED.is_sorted());
        assert!(MACROS.is_sorted());
    }
}
