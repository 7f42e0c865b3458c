package tickbus.identification;

import java.nio.charset.StandardCharsets;
import java.time.DateTimeException;
import java.time.LocalDateTime;
import java.util.Collections;
import java.util.EnumSet;
import java.util.HexFormat;
import java.util.Locale;
import java.util.Objects;
import java.util.Set;

/**
 * The data on the carrier of a pallet: 21 octets.
 *
 * <p>Fourteen digits in ASCII (second, minute, hour, day and month with two each, and the year with four), the octet of the
 * {@link Piece}, and one octet for each {@link Content}, 1 if it is there.
 *
 * @param time when it was written last, in whole seconds; null on a carrier that was never written
 * @param piece which piece is to be made
 * @param contents what is on the pallet
 */
public record PalletRecord(LocalDateTime time, Piece piece, Set<Content> contents) {
    /** The record's length in octets. */
    public static final int LENGTH = 21;

    /** The record of a carrier that was never written. */
    public static final PalletRecord BLANK = new PalletRecord(null, Piece.UNDEFINED, Set.of());

    private static final int DIGITS = 14;

    /** The piece that is to be made. */
    public enum Piece {
        /** Not decided yet. */
        UNDEFINED(0x00),
        /** A black one. */
        BLACK(0x10),
        /** A black one with a cap. */
        BLACK_WITH_CAP(0x20),
        /** A red one. */
        RED(0x30),
        /** A red one with a cap. */
        RED_WITH_CAP(0x40),
        /** A metallic one. */
        METALLIC(0x50),
        /** A metallic one with a cap. */
        METALLIC_WITH_CAP(0x60);

        private final int octet;

        Piece(int octet) {
            this.octet = octet;
        }
    }

    /** Contents of a pallet, in the order of the octets. */
    public enum Content {
        /** The sleeve of the cylinder. */
        SLEEVE,
        /** The piston of the cylinder. */
        PISTON,
        /** The spring of the cylinder. */
        SPRING,
        /** The head of the cylinder. */
        HEAD,
        /** The cap: the piece is of a kind with a cap. */
        CAP,
        /** Any piece at all. */
        PIECE
    }

    /**
     * A record.
     *
     * @param time when it was written, or null
     * @param piece what the pallet carries
     * @param contents what the pallet holds
     * @throws IllegalArgumentException if the year does not have four digits
     */
    public PalletRecord {
        if (time != null) {
            if (time.getYear() < 0 || time.getYear() > 9999) {
                throw new IllegalArgumentException("the year " + time.getYear() + " does not have four digits");
            }
            time = time.withNano(0);
        }
        Objects.requireNonNull(piece, "piece");
        EnumSet<Content> copy = EnumSet.noneOf(Content.class);
        copy.addAll(contents);
        contents = Collections.unmodifiableSet(copy);
    }

    /**
     * The same record with this time.
     *
     * @param at when it is written
     * @return the new record
     */
    public PalletRecord at(LocalDateTime at) {
        return new PalletRecord(at, piece, contents);
    }

    /**
     * The same record for this piece.
     *
     * @param other which piece is to be made
     * @return the new record
     */
    public PalletRecord of(Piece other) {
        return new PalletRecord(time, other, contents);
    }

    /**
     * The same record with this content added.
     *
     * @param content the addition
     * @return the new record
     */
    public PalletRecord with(Content content) {
        EnumSet<Content> more = EnumSet.of(content);
        more.addAll(contents);
        return new PalletRecord(time, piece, more);
    }

    /**
     * The same record with this content removed.
     *
     * @param content the removal
     * @return the new record
     */
    public PalletRecord without(Content content) {
        EnumSet<Content> fewer = EnumSet.complementOf(EnumSet.of(content));
        fewer.retainAll(contents);
        return new PalletRecord(time, piece, fewer);
    }

    /**
     * The octets for the carrier.
     *
     * @return {@value #LENGTH} octets
     */
    public byte[] toOctets() {
        byte[] octets = new byte[LENGTH];
        if (time != null) {
            String digits = String.format(Locale.ROOT, "%02d%02d%02d%02d%02d%04d", time.getSecond(), time.getMinute(),
                time.getHour(), time.getDayOfMonth(), time.getMonthValue(), time.getYear());
            System.arraycopy(digits.getBytes(StandardCharsets.US_ASCII), 0, octets, 0, DIGITS);
        }
        octets[DIGITS] = (byte) piece.octet;
        for (Content content : contents) {
            octets[DIGITS + 1 + content.ordinal()] = 1;
        }
        return octets;
    }

    /**
     * Reads the octets of a carrier.
     *
     * @param octets {@value #LENGTH} octets
     * @return the record
     * @throws IllegalArgumentException if they are no record, with what is wrong and where
     */
    public static PalletRecord ofOctets(byte[] octets) {
        if (octets.length != LENGTH) {
            throw new IllegalArgumentException("a pallet's record has " + LENGTH + " octets, and not " + octets.length);
        }
        EnumSet<Content> contents = EnumSet.noneOf(Content.class);
        for (Content content : Content.values()) {
            int at = DIGITS + 1 + content.ordinal();
            switch (octets[at]) {
                case 0 -> { }
                case 1 -> contents.add(content);
                default -> throw wrong(octets, at, "00 or 01 is expected for the " + content);
            }
        }
        return new PalletRecord(time(octets), piece(octets), contents);
    }

    private static Piece piece(byte[] octets) {
        for (Piece piece : Piece.values()) {
            if (piece.octet == octets[DIGITS]) {
                return piece;
            }
        }
        throw wrong(octets, DIGITS, "a piece is expected: 00, 10, 20, 30, 40, 50 or 60");
    }

    private static LocalDateTime time(byte[] octets) {
        boolean blank = true;
        for (int at = 0; at < DIGITS; at++) {
            blank &= octets[at] == 0;
        }
        if (blank) {
            return null;
        }
        for (int at = 0; at < DIGITS; at++) {
            if (octets[at] < '0' || octets[at] > '9') {
                throw wrong(octets, at, "a digit of the time is expected");
            }
        }
        try {
            return LocalDateTime.of(number(octets, 10, 14), number(octets, 8, 10), number(octets, 6, 8),
                number(octets, 4, 6), number(octets, 2, 4), number(octets, 0, 2));
        } catch (DateTimeException e) {
            throw new IllegalArgumentException(
                "the first 14 octets of a pallet's record are no time; " + e.getMessage(), e);
        }
    }

    private static int number(byte[] octets, int from, int to) {
        int number = 0;
        for (int at = from; at < to; at++) {
            number = 10 * number + octets[at] - '0';
        }
        return number;
    }

    private static IllegalArgumentException wrong(byte[] octets, int at, String expected) {
        String octet = HexFormat.of().withUpperCase().toHexDigits(octets[at]);
        return new IllegalArgumentException(
            "octet " + at + " of a pallet's record is " + octet + "; " + expected
            + "; check that the carrier was written by this program");
    }
}
