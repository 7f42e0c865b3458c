package tickbus;

import static org.junit.jupiter.api.Assertions.assertEquals;

import java.util.List;
import org.junit.jupiter.api.Test;

class NearestNamesTest {
    private static final List<String> NAMES = List.of("LA1 run", "LA2 run", "LA1 position", "Lamp", "Not OK");

    @Test
    void nearestNamesComeFirst() {
        assertEquals("; did you mean 'LA1 run', 'LA2 run'?", NearestNames.hint("la1 rum", NAMES));
        assertEquals("; did you mean 'Not OK'?", NearestNames.hint("NotOk", NAMES));
    }

    @Test
    void nothingNearGivesNoHint() {
        assertEquals("", NearestNames.hint("conveyor speed", NAMES));
    }

    @Test
    void distanceCountsEdits() {
        assertEquals(0, NearestNames.distance("Lamp", "lamp"));
        assertEquals(3, NearestNames.distance("kitten", "sitting"));
        assertEquals(4, NearestNames.distance("", "lamp"));
    }
}
