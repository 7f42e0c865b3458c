//! Pragmas: attributes of an editor, or code that `iec2c` copies into its C output.

use super::words;

/// First words of the pragmas of CODESYS, `TwinCAT` and Beremiz, none of which is code.
const ATTRIBUTES: &str = "ATTRIBUTE ANALYSIS DEFINE UNDEFINE DISABLE ENABLE ERROR EXTERNAL FLAG IF ELSIF ELSE END_IF INFO LIBRARY \
    REGION ENDREGION TEXT WARNING";

/// Names in the code of pragmas that read the PLC's clock.
const CLOCKS: [&str; 3] = ["__CURRENT_TIME", "__tick", "common_ticktime__"];

/// The functions by which OSCAT reads its clock, and how many of their units make a second.
const OSCAT: [(&str, u64); 2] = [("T_PLC_MS", 1_000), ("T_PLC_US", 1_000_000)];

/// True if a pragma is code.
pub(crate) fn is_code(pragma: &str) -> bool {
    let inner = inner(pragma);
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let first = inner.split(|c| !is_part(c)).next().unwrap_or_default();
    if words::is_in(ATTRIBUTES, first) {
        return false;
    }
    // { S7_Optimized_Access := 'TRUE' }
    let rest = inner.replace(":=", "");
    reads_clock(pragma) || rest.contains([';', '=', '(', '+', '-', '*', '&', '|'])
}

/// True if the code of a pragma reads the PLC's clock.
pub(crate) fn reads_clock(pragma: &str) -> bool {
    CLOCKS.iter().any(|clock| pragma.contains(clock))
}

/// The replacement of a pragma by which a function of OSCAT reads the PLC's clock: it reads `tickbus_now` by the
/// function that `iec2c` makes for each global variable. `None` for any other pragma.
pub(crate) fn on_virtual_time(function: &str, pragma: &str) -> Option<String> {
    let mut clocks = OSCAT.iter();
    let (_, per_second) = clocks.find(|(name, _)| name.eq_ignore_ascii_case(function))?;
    if !reads_clock(pragma) {
        return None;
    }
    // The last statement assigns the time to a variable of the function.
    let mut statements = inner(pragma).rsplit(';').map(str::trim);
    let (variable, _) = statements
        .find(|statement| !statement.is_empty())?
        .split_once('=')?;
    let variable = variable.trim();
    let is_name = !variable.is_empty()
        && variable
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    let nanos = 1_000_000_000 / per_second;
    is_name.then(|| {
        format!(
            "{{extern TIME *__GET_GLOBAL_TICKBUS_NOW(void); TIME tickbus_time = *__GET_GLOBAL_TICKBUS_NOW(); \
             {variable} = (UDINT)(tickbus_time.tv_sec * {per_second}ULL + tickbus_time.tv_nsec / {nanos})}}"
        )
    })
}

/// The text between the braces.
fn inner(pragma: &str) -> &str {
    pragma.trim_start_matches('{').trim_end_matches('}').trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_of_editors_are_no_code() {
        for pragma in [
            "{attribute 'qualified_only'}",
            "{attribute 'init' := '(1; 2)'}",
            "{ S7_Optimized_Access := 'TRUE' }",
            "{IF defined (simulation)}",
            "{region \"a; b\"}",
            "{warning disable C0195}",
            "{external}",
            "{p}",
            "{}",
        ] {
            assert!(!is_code(pragma), "{pragma}");
        }
        for pragma in ["{n++;}", "{x = y}", "{poll()}", "{extern long __tick}"] {
            assert!(is_code(pragma), "{pragma}");
        }
    }

    #[test]
    fn only_the_clock_of_oscat_is_replaced() {
        let clock = "{extern unsigned long __tick;\nTX = plc_time}";
        let made = on_virtual_time("t_plc_us", clock).expect("a clock");
        assert!(
            made.ends_with(
                "TX = (UDINT)(tickbus_time.tv_sec * 1000000ULL + tickbus_time.tv_nsec / 1000)}"
            ),
            "{made}"
        );
        for (function, pragma) in [
            ("T_PLC", clock),
            ("T_PLC_MS", "{TX = 5}"),
            ("T_PLC_MS", "{read(__tick);}"),
            ("T_PLC_MS", "{*x = __tick}"),
        ] {
            assert_eq!(on_virtual_time(function, pragma), None, "{pragma}");
        }
    }
}
