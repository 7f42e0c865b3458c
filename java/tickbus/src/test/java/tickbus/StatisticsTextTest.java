package tickbus;

import static org.junit.jupiter.api.Assertions.assertEquals;

import java.nio.file.Path;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;

class StatisticsTextTest {
    @TempDir
    Path directory;

    @Test
    void everyKeyIsReadAsItWasWritten() {
        Map<String, String> statistics = new LinkedHashMap<>();
        statistics.put("reason", "left = 1\\2");
        statistics.put("station.x=y.stale", "true");
        statistics.put("plc.rises.a\\=b", "7");
        String text = StatisticsText.write(statistics);
        assertEquals("reason=left = 1\\2\nstation.x\\=y.stale=true\nplc.rises.a\\\\\\=b=7", text);
        assertEquals(statistics, StatisticsText.read(text));
        assertEquals(List.copyOf(statistics.keySet()), List.copyOf(StatisticsText.read(text).keySet()));
    }

    @Test
    void aNameInAKeyMayHaveAnyCharacter() {
        try (Tickbus bus = DriverCfg.mirror(1).signal("a = b: c\\\\", "%IX0.0").signal("d", "%QX0.0").open(directory)) {
            bus.signal("a = b: c\\").set(1);
            bus.exchange(5_000_000);
            assertEquals("1", bus.statistics().get("plc.rises.a = b: c\\"));
        }
    }
}
