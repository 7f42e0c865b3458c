package tickbus.identification;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertNull;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.nio.charset.StandardCharsets;
import java.time.LocalDateTime;
import java.util.Set;
import org.junit.jupiter.api.Test;
import tickbus.identification.PalletRecord.Content;
import tickbus.identification.PalletRecord.Piece;

class PalletRecordTest {
    private static final LocalDateTime TIME = LocalDateTime.of(2004, 3, 9, 16, 5, 59);

    private static byte[] octets(String digits, int... rest) {
        byte[] octets = new byte[PalletRecord.LENGTH];
        byte[] ascii = digits.getBytes(StandardCharsets.US_ASCII);
        System.arraycopy(ascii, 0, octets, 0, ascii.length);
        for (int i = 0; i < rest.length; i++) {
            octets[14 + i] = (byte) rest[i];
        }
        return octets;
    }

    @Test
    void aRecordHasTwentyOneOctetsFourteenOfThemDigits() {
        PalletRecord pallet = new PalletRecord(TIME, Piece.RED_WITH_CAP, Set.of(Content.SLEEVE, Content.SPRING, Content.PIECE));
        byte[] octets = octets("59051609032004", 0x40, 1, 0, 1, 0, 0, 1);
        assertArrayEquals(octets, pallet.toOctets());
        assertEquals(pallet, PalletRecord.ofOctets(octets));
    }

    @Test
    void eachPieceAndEachContentGoesThereAndBack() {
        int[] numbers = {0x00, 0x10, 0x20, 0x30, 0x40, 0x50, 0x60};
        for (Piece piece : Piece.values()) {
            PalletRecord pallet = PalletRecord.BLANK.at(TIME).of(piece);
            assertEquals(numbers[piece.ordinal()], pallet.toOctets()[14]);
            assertEquals(pallet, PalletRecord.ofOctets(pallet.toOctets()));
        }
        for (Content content : Content.values()) {
            PalletRecord pallet = PalletRecord.BLANK.with(content);
            assertEquals(1, pallet.toOctets()[15 + content.ordinal()]);
            assertEquals(pallet, PalletRecord.ofOctets(pallet.toOctets()));
            assertEquals(PalletRecord.BLANK, pallet.without(content));
        }
    }

    @Test
    void aCarrierThatWasNeverWrittenIsBlank() {
        PalletRecord pallet = PalletRecord.ofOctets(new byte[21]);
        assertEquals(PalletRecord.BLANK, pallet);
        assertNull(pallet.time());
        assertArrayEquals(new byte[21], pallet.toOctets());
        assertEquals(TIME, PalletRecord.BLANK.at(TIME.withNano(5)).time());
    }

    @Test
    void whatIsNoRecordIsRefusedWithItsPlace() {
        String[][] wrong = {{"has 21 octets, and not 20", null}, {"octet 3 of a pallet's record is 41", "590A1609032004"},
            {"are no time", "60051609032004"}, {"are no time", "59051631022004"}};
        assertTrue(refusal(new byte[20]).contains(wrong[0][0]));
        for (int i = 1; i < wrong.length; i++) {
            assertTrue(refusal(octets(wrong[i][1])).contains(wrong[i][0]), wrong[i][0]);
        }
        assertTrue(refusal(octets("59051609032004", 0x70)).contains("octet 14 of a pallet's record is 70; a piece is expected"));
        assertTrue(refusal(octets("59051609032004", 0x10, 0, 2)).contains("octet 16 of a pallet's record is 02"));
        assertThrows(IllegalArgumentException.class, () -> PalletRecord.BLANK.at(TIME.withYear(10_000)));
    }

    private static String refusal(byte[] octets) {
        return assertThrows(IllegalArgumentException.class, () -> PalletRecord.ofOctets(octets)).getMessage();
    }
}
