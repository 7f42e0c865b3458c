//! Converts REALs and their bits using only the arithmetic of IEC 61131-3.

/// Functions from the bits of a REAL to its value and back, using only the arithmetic of IEC 61131-3: `iec2c`
/// converts a DWORD to the REAL of the same value, not of the same bits.
pub(super) const FUNCTIONS: &str = "\
FUNCTION tickbus_real : REAL
  VAR_INPUT
    bits : DWORD;
  END_VAR
  VAR
    exponent : INT;
    number : REAL;
  END_VAR

  exponent := UINT_TO_INT(WORD_TO_UINT(DWORD_TO_WORD(SHR(bits, 23) AND DWORD#16#000000FF)));
  number := UDINT_TO_REAL(DWORD_TO_UDINT(bits AND DWORD#16#007FFFFF));
  IF exponent = 0 THEN
    number := 0.0; (* smaller than any number in full precision *)
  ELSIF exponent = 255 THEN
    number := 3.402823E38; (* no number *)
  ELSE
    number := number + 8388608.0;
    WHILE exponent > 150 DO
      number := number * 2.0;
      exponent := exponent - 1;
    END_WHILE;
    WHILE exponent < 150 DO
      number := number / 2.0;
      exponent := exponent + 1;
    END_WHILE;
  END_IF;
  IF (bits AND DWORD#16#80000000) <> DWORD#16#00000000 THEN
    number := 0.0 - number;
  END_IF;
  tickbus_real := number;
END_FUNCTION

FUNCTION tickbus_bits : DWORD
  VAR_INPUT
    number : REAL;
  END_VAR
  VAR
    exponent : UINT;
    bits : DWORD;
    size : REAL;
  END_VAR

  size := ABS(number);
  IF size > 3.402823E38 THEN
    size := 3.402823E38;
  END_IF;
  bits := DWORD#16#00000000;
  (* smaller ones, and what is no number, become zero *)
  IF size >= 1.1754944E-38 THEN
    exponent := 150;
    WHILE size >= 16777216.0 DO
      size := size / 2.0;
      exponent := exponent + 1;
    END_WHILE;
    WHILE size < 8388608.0 DO
      size := size * 2.0;
      exponent := exponent - 1;
    END_WHILE;
    bits := UDINT_TO_DWORD(REAL_TO_UDINT(size - 8388608.0));
    bits := bits OR SHL(WORD_TO_DWORD(UINT_TO_WORD(exponent)), 23);
  END_IF;
  IF number < 0.0 THEN
    bits := bits OR DWORD#16#80000000;
  END_IF;
  tickbus_bits := bits;
END_FUNCTION

";
