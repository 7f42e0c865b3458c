package tickbus;

import static org.junit.jupiter.api.Assertions.assertEquals;

import java.math.BigInteger;
import java.util.Random;
import org.junit.jupiter.api.Test;

class IntegerKindTest {
    @Test
    void halvesGoAwayFromZero() {
        double[] values = {0.5, -0.5, 1.5, -1.5, 0.49999999999999994, -0.49999999999999994, 4503599627370495.5};
        long[] expected = {1, -1, 2, -2, 0, 0, 4503599627370496L};
        for (int i = 0; i < values.length; i++) {
            assertEquals(expected[i], IntegerKind.SIGNED.fromDouble(values[i]), "of " + values[i]);
        }
    }

    @Test
    void whatDoesNotFitBecomesTheNearestEnd() {
        assertEquals(Long.MAX_VALUE, IntegerKind.SIGNED.fromDouble(1e300));
        assertEquals(Long.MIN_VALUE, IntegerKind.SIGNED.fromDouble(Double.NEGATIVE_INFINITY));
        assertEquals(0, IntegerKind.UNSIGNED.fromDouble(-3));
        assertEquals(-1, IntegerKind.UNSIGNED.fromDouble(0x1p64));
        assertEquals(-1, IntegerKind.UNSIGNED.fromDouble(Double.POSITIVE_INFINITY));
        assertEquals(0, IntegerKind.SIGNED.fromDouble(Double.NaN));
        assertEquals(0, IntegerKind.UNSIGNED.fromDouble(Double.NaN));
    }

    @Test
    void unsignedNumbersConvertAsBigIntegerDoes() {
        Random random = new Random(4711);
        long[] edges = {0, 1, -1, Long.MAX_VALUE, Long.MIN_VALUE, 0xFFFF_FFFF_FFFF_FBFFL, 0xFFFF_FFFF_FFFF_FC00L};
        for (int i = 0; i < 10_000; i++) {
            long bits = i < edges.length ? edges[i] : random.nextLong() >>> random.nextInt(64);
            double expected = new BigInteger(Long.toUnsignedString(bits)).doubleValue();
            assertEquals(expected, IntegerKind.UNSIGNED.toDouble(bits), Long.toUnsignedString(bits));
            BigInteger back = new java.math.BigDecimal(expected).toBigInteger();
            BigInteger most = BigInteger.TWO.pow(64).subtract(BigInteger.ONE);
            assertEquals(back.min(most).longValue(), IntegerKind.UNSIGNED.fromDouble(expected), "of " + expected);
        }
    }
}
