package tickbus.simulator.control;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.Arrays;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;

class TransferFunctionsTest {
    private static final long STEP = 2_000_000;

    private static double[] numbers(String text) {
        return Arrays.stream(text.strip().split("\\s+")).mapToDouble(Double::parseDouble).toArray();
    }

    @ParameterizedTest
    @CsvSource(delimiter = ';', value = {
        "''; 0 3 -1.5; 0 3 -1.5",
        "copy; 0 3; 0 3",
        "not; 0 1 2 -1; 1 0 0 0",
        "scale(2, -1); 0 1 -3; -1 1 -7",
        "clamp(-1, 2.5); -2 0 9; -1 0 2.5",
        "deadband(1); 0.5 1 1.5 2 2.6 0; 0 0 1.5 1.5 2.6 0",
        "bit(0); 0 1 2 3 -1; 0 1 0 1 1",
        "bit(15); 32767 32768 -1; 0 1 1",
        "bit(52); 4503599627370496 1; 1 0",
        "rising; 1 1 0 1 2 0; 1 0 0 1 0 0",
        "falling; 1 0 0 5 0; 0 1 0 0 1",
        "delay(4ms); 1 2 3 4; 0 0 1 2",
        "delay(1us); 1 2 3; 0 1 2",
        "gt(1.5); 1 1.5 2; 0 0 1",
        "lt(1.5); 1 1.5 2; 1 0 0",
    })
    void functionsOfOneSource(String call, String source, String result) {
        TransferFunction function = TransferFunctions.read(call, 1, STEP);
        double[] results = Arrays.stream(numbers(source)).map(x -> function.apply(new double[] {9, x}, new int[] {1}))
                .toArray();
        assertArrayEquals(numbers(result), results);
    }

    @ParameterizedTest
    @CsvSource(delimiter = ';', value = {
        "and; 1 2 3; 1", "and; 1 0 3; 0", "and; 1; 1",
        "or; 0 0 0; 0", "or; 0 -2 0; 1",
        "add; 1 2 3.5; 6.5",
    })
    void functionsOfSeveralSources(String call, String sources, double result) {
        double[] values = numbers(sources);
        int[] from = new int[values.length];
        Arrays.setAll(from, i -> i);
        assertEquals(result, TransferFunctions.read(call, from.length, STEP).apply(values, from));
    }

    @Test
    void aConstantNeedsNoSource() {
        assertEquals(-2.5, TransferFunctions.read("const( -2.5 )", 0, STEP).apply(new double[0], new int[0]));
    }

    @Test
    void helpNamesThemAll() {
        for (String name : new String[] {"copy", "not", "and", "or", "add", "scale(gain, offset)", "clamp(lo, hi)",
            "deadband(width)", "bit(n)", "rising", "falling", "delay(duration)", "gt(x)", "lt(x)", "const(x)"}) {
            assertTrue(TransferFunctions.help().contains(name), name);
        }
    }
}
