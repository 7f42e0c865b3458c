//! IEC 61131-3 function blocks, and PLC programs on a clock that is handed in.
