package tickbus;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;

import java.nio.file.Path;
import java.util.List;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;

@Tag("native")
class StartTest {
    @TempDir
    Path directory;

    /** Program of a child JVM: opens a driver, exchanges, and closes. */
    static final class FirstExchange {
        private FirstExchange() {
        }

        public static void main(String[] arguments) {
            try (Tickbus bus = Tickbus.open(Path.of(arguments[0]))) {
                bus.exchange(0);
            }
        }
    }

    @Test
    void theWayToTheFirstExchangeLoadsNoLambdasAndStreams() throws Exception {
        Path cfg = DriverCfg.mirror(1).signal("in", "%IX0.0").signal("long", "%IL8", "type = \"ULINT\"")
            .signal("out", "%QX0.0", "latch = \"rising\"").write(directory);
        ChildJvm.Outcome outcome = new ChildJvm().with("--enable-native-access=ALL-UNNAMED", "-Xlog:class+load")
            .with("-Dtickbus.native.dir=" + System.getProperty("tickbus.native.dir"))
            .with("-cp", ChildJvm.classPath(), FirstExchange.class.getName(), cfg.toString()).run();
        assertEquals(0, outcome.exit(), outcome::output);
        List<String> loaded = outcome.output().lines().dropWhile(line -> !line.contains(" tickbus.Tickbus ")).toList();
        assertFalse(loaded.isEmpty(), outcome::output);
        List<String> slow = loaded.stream()
            .filter(line -> line.contains("Lambda") || line.contains(" java.util.stream.")).toList();
        assertEquals(List.of(), slow);
    }
}
