package tickbus.simulator.text;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;

import java.util.List;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import org.junit.jupiter.params.provider.ValueSource;

class TextTest {
    @ParameterizedTest
    @CsvSource({"2ms, 2000000, 2ms", "0.5s, 500000000, 500ms", "1min, 60000000000, 60s", "10 us, 10000, 10us",
        "7ns, 7, 7ns", "0s, 0, 0ns", "1500ms, 1500000000, 1.5s"})
    void durationsReadAndWrite(String text, long nanos, String canonical) {
        assertEquals(nanos, Durations.parse(text));
        assertEquals(canonical, Durations.text(nanos));
    }

    @ParameterizedTest
    @ValueSource(strings = {"", "5", "ms", "-1s", "1h", "0.5ns", "99999999999999s", "1e3s"})
    void otherTextsAreNoDurations(String text) {
        assertThrows(IllegalArgumentException.class, () -> Durations.parse(text));
    }

    @Test
    void pointsOfTimeLineUp() {
        assertEquals("   12.345", Durations.seconds(12_345_000_000L));
    }

    @Test
    void theNearestNameIsOfferedOnlyIfItIsNear() {
        List<String> names = List.of("machine:im1.index", "machine:im1.jog");
        assertEquals("; did you mean \"machine:im1.index\"?", NearestName.hint("machine:IM1.indx", names));
        assertEquals("", NearestName.hint("pump", names));
        assertEquals("", NearestName.hint("pump", List.of()));
    }

    @Test
    void columnsLineUp() {
        Columns table = new Columns("name", ">count");
        table.row("a", 5);
        table.row("longer", 1234567);
        assertEquals("""
                |name      count
                |------  -------
                |a             5
                |longer  1234567
                """, table.text("|"));
        assertThrows(IllegalArgumentException.class, () -> table.row("only one"));
    }
}
