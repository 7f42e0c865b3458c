//! Names that every PLC editor takes.

use std::collections::HashSet;

/// The longest name that is made: short enough for a list of tags, and far below every editor's limit.
const LONGEST: usize = 60;

/// Words that no variable may be called, in upper case: the words of IEC 61131-3 and its types, and those that
/// TIA Portal, CODESYS and `iec2c` keep beyond it.
#[rustfmt::skip]
const RESERVED: &[&str] = &[
    "ABS", "ABSTRACT", "ACOS", "ACTION", "ADD", "ADR", "AND", "ANY", "ANY_BIT", "ANY_DATE", "ANY_INT", "ANY_NUM",
    "ANY_REAL", "ARRAY", "ASIN", "AT", "ATAN", "BEGIN", "BOOL", "BY", "BYTE", "CAL", "CALC", "CALCN", "CASE",
    "CHAR", "CLASS", "CONCAT", "CONFIGURATION", "CONSTANT", "CONTINUE", "COS", "COUNTER", "CTD", "CTU", "CTUD",
    "DATA_BLOCK", "DATE", "DATE_AND_TIME", "DB", "DELETE", "DINT", "DIV", "DO", "DS", "DT", "DTL", "DWORD", "ELSE",
    "ELSIF", "EN", "END", "END_ACTION", "END_CASE", "END_CONFIGURATION", "END_FOR", "END_FUNCTION",
    "END_FUNCTION_BLOCK", "END_IF", "END_PROGRAM", "END_REPEAT", "END_RESOURCE", "END_STEP", "END_STRUCT",
    "END_TRANSITION", "END_TYPE", "END_VAR", "END_WHILE", "ENO", "EQ", "ERROR", "EXIT", "EXP", "EXPT", "EXTENDS",
    "FALSE", "FB", "FC", "FINAL", "FIND", "FOR", "FROM", "FUNCTION", "FUNCTION_BLOCK", "F_EDGE", "F_TRIG", "GE",
    "GOTO", "GT", "I", "IF", "IMPLEMENTS", "INI", "INITIAL_STEP", "INSERT", "INT", "INTERFACE", "INTERVAL", "JMP",
    "JMPC", "JMPCN", "L", "LD", "LDN", "LDT", "LE", "LEFT", "LEN", "LIMIT", "LINT", "LN", "LOG", "LREAL", "LT",
    "LTIME", "LTOD", "LWORD", "M", "MAX", "METHOD", "MID", "MIN", "MOD", "MOVE", "MUL", "MUX", "N", "NE", "NETWORK",
    "NIL", "NON_RETAIN", "NOT", "NULL", "OB", "OF", "ON", "OR", "ORGANIZATION_BLOCK", "OVERLAP", "OVERRIDE", "P",
    "POINTER", "PRIORITY", "PRIVATE", "PROGRAM", "PROPERTY", "PROTECTED", "PUBLIC", "Q", "R", "R1", "READ_ONLY",
    "READ_WRITE", "REAL", "REF", "REFERENCE", "REF_TO", "REGION", "REPEAT", "REPLACE", "RESOURCE", "RET", "RETAIN",
    "RETC", "RETCN", "RETURN", "RIGHT", "ROL", "ROR", "RS", "RTC", "R_EDGE", "R_TRIG", "S", "S1", "SD", "SEL",
    "SEMA", "SHL", "SHR", "SIN", "SINGLE", "SINT", "SIZEOF", "SL", "SQRT", "SR", "ST", "STEP", "STN", "STRING",
    "STRUCT", "SUB", "SUPER", "TAN", "TASK", "THEN", "THIS", "TIME", "TIMER", "TIME_OF_DAY", "TO", "TOD", "TOF",
    "TON", "TP", "TRANSITION", "TRUE", "TRUNC", "TYPE", "UDINT", "UDT", "UINT", "ULINT", "UNION", "UNTIL", "USING",
    "USINT", "VAR", "VARIANT", "VAR_ACCESS", "VAR_CONFIG", "VAR_EXTERNAL", "VAR_GLOBAL", "VAR_INPUT", "VAR_IN_OUT",
    "VAR_OUTPUT", "VAR_TEMP", "VERSION", "VOID", "WCHAR", "WHILE", "WITH", "WORD", "WSTRING", "XOR",
];

/// The names that are given already; letter case does not count.
#[derive(Debug, Default)]
pub(super) struct Names {
    given: HashSet<String>,
}

impl Names {
    /// A legal name like `text` that was not given before: the same for the same texts in the same order.
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

/// A name like `text` that is legal everywhere: ASCII letters, digits and single underscores, a letter first, and
/// no word that a language keeps.
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
            // Two underscores in a row are refused by IEC 61131-3, one at either end by some editors.
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
    if RESERVED
        .binary_search(&name.to_ascii_uppercase().as_str())
        .is_ok()
    {
        name.push_str("_1");
    }
    name
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
    }
}
