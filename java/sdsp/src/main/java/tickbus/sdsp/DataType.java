package tickbus.sdsp;

/** The type of a variable: an elementary data type of IEC 61131-3. The order is that of the codes on the wire. */
public enum DataType {
    /** One bit: 0 or 1. */
    BOOL,
    /** 8 bits, extended by zeros. */
    BYTE,
    /** An 8-bit signed integer, extended by its sign. */
    SINT,
    /** An 8-bit unsigned integer. */
    USINT,
    /** 16 bits, extended by zeros. */
    WORD,
    /** A 16-bit signed integer, extended by its sign. */
    INT,
    /** A 16-bit unsigned integer. */
    UINT,
    /** 32 bits, extended by zeros. */
    DWORD,
    /** A 32-bit signed integer, extended by its sign. */
    DINT,
    /** A 32-bit unsigned integer. */
    UDINT,
    /** A 32-bit number: its bits as {@link Float#floatToRawIntBits} gives them, extended by zeros. */
    REAL,
    /** 64 bits. */
    LWORD,
    /** A 64-bit signed integer. */
    LINT,
    /** A 64-bit unsigned integer. */
    ULINT,
    /** A 64-bit number: its bits as {@link Double#doubleToRawLongBits} gives them. */
    LREAL;

    /** The code on the wire, from 1. */
    byte code() {
        return (byte) (ordinal() + 1);
    }
}
