package tickbus.junit;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;

import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import org.junit.jupiter.params.provider.ValueSource;

/** Durations, numbers and TOML texts. */
class TextTest {
    @ParameterizedTest
    @CsvSource({"10ms, 10000000", "1.5 s, 1500000000", "250us, 250000", "2min, 120000000000", "0s, 0", "7ns, 7", "1h, 3600000000000"})
    void durationsRead(String text, long nanos) {
        assertEquals(nanos, Durations.parse(text));
    }

    @ParameterizedTest
    @ValueSource(strings = {"", "10", "ms", "-1s", "1.s", ".5s", "10 parsecs", "9999999999h"})
    void whatIsNoDurationIsRefused(String text) {
        assertThrows(IllegalArgumentException.class, () -> Durations.parse(text));
    }

    @ParameterizedTest
    @CsvSource({"2000000, 2ms", "1500000000, 1.5s", "0, 0s", "7, 7ns", "8312000000, 8.312s", "1500, 1.5us"})
    void durationsPrint(long nanos, String text) {
        assertEquals(text, Durations.text(nanos));
    }

    @ParameterizedTest
    @CsvSource({"3, 3", "-0.5, -0.5", "32767, 32767", "0, 0", "1e300, 1.0E300", "100, 100"})
    void numbersPrintAsPeopleWriteThem(double number, String text) {
        assertEquals(text, Watch.number(number));
    }

    @Test
    void aTextStaysATextWhateverIsInIt() {
        assertEquals("\"C:\\\\plant\\\\\\\"a\\\"\\u000A\\u007F\"", Toml.text("C:\\plant\\\"a\"\n\u007f"));
    }
}
