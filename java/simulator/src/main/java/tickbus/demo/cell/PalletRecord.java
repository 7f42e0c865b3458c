package tickbus.demo.cell;

import java.nio.charset.StandardCharsets;
import java.util.Locale;

/**
 * What a code carrier says of its pallet, in 21 bytes from address 0: 14 digits in ASCII (second, minute, hour, day, month
 * with two each, year with four), the code of the kind, and a byte 00 or 01 for each {@link Part}.
 *
 * @param seconds when it was written, in seconds of simulation time
 * @param kind the code of its {@link PieceKind}
 * @param contents the bits of its {@link Part}s
 */
public record PalletRecord(long seconds, int kind, int contents) {
    /** How many bytes it has. */
    public static final int BYTES = 21;

    /** Where the kind is. */
    static final int KIND = 14;

    /** The bytes. Simulation time begins with the first day of 2004. */
    public byte[] toBytes() {
        byte[] bytes = new byte[BYTES];
        String stamp = String.format(Locale.ROOT, "%02d%02d%02d%02d%02d%04d", seconds % 60, seconds / 60 % 60,
                seconds / 3600 % 24, 1 + seconds / 86_400 % 31, 1, 2004);
        System.arraycopy(stamp.getBytes(StandardCharsets.US_ASCII), 0, bytes, 0, KIND);
        bytes[KIND] = (byte) kind;
        for (Part part : Part.values()) {
            bytes[KIND + 1 + part.ordinal()] = (byte) ((contents & part.bit()) != 0 ? 1 : 0);
        }
        return bytes;
    }
}
