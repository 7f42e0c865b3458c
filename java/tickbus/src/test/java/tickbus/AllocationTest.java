package tickbus;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import com.sun.management.ThreadMXBean;
import java.lang.management.ManagementFactory;
import java.nio.file.Path;
import java.util.List;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;

@Tag("native")
class AllocationTest {
    private static final int TICKS = 50_000;

    @TempDir
    Path directory;

    @Test
    void ticksMakeNoGarbage() {
        assumeTrue(ManagementFactory.getThreadMXBean() instanceof ThreadMXBean, "this JVM counts no allocations");
        ThreadMXBean threads = (ThreadMXBean) ManagementFactory.getThreadMXBean();
        try (Tickbus bus = DriverCfg.mirror(1).signal("in", "%IX0.0").signal("height", "%IW2", "type = \"INT\"")
            .signal("long", "%IL8", "type = \"ULINT\"").signal("out", "%QX0.0", "latch = \"rising\"")
            .signal("height out", "%QW2", "type = \"INT\"").signal("long out", "%QL8", "type = \"ULINT\"")
            .open(directory)) {
            Signal in = bus.signal("in");
            Signal height = bus.signal("height");
            Signal wide = bus.signal("long");
            Signal out = bus.signal("out");
            Signal heightOut = bus.signal("height out");
            Signal wideOut = bus.signal("long out");
            double[] written = new double[3];
            double[] read = new double[3];
            EventHandler handler = (signal, value, time) -> { };
            double[] leak = new double[1];
            FaultHandler faults = (name, value) -> leak[0] += value;
            bus.declareFaults(List.of("leak"));
            bus.inject("kind = \"model\"\nname = \"leak\"\nwhen = \"height > 500\"\nticks = 5\ntimes = 1000000");
            double sum = 0;
            long allocated = Long.MAX_VALUE;
            long now = 0;
            // The JVM itself allocates a little now and then, as classes are initialised and code is compiled; a tick
            // that allocates would do so in every round.
            for (int round = 0; round < 4; round++) {
                long before = threads.getCurrentThreadAllocatedBytes();
                for (int i = 0; i < TICKS; i++) {
                    in.setBoolean(i % 2 == 0);
                    height.set(i % 1000);
                    wide.setLong(i);
                    now += 1_000_000;
                    bus.exchange(now);
                    sum += heightOut.get() + wideOut.getLong() + out.edges() + (out.getBoolean() ? 1 : 0);
                    bus.setAll(written);
                    bus.exchange();
                    bus.getAll(read);
                    now += 1_000_000;
                    sum += bus.receive(now);
                    bus.send();
                    sum += bus.receive();
                    bus.send();
                    sum += bus.ageNanos() + bus.sequence() + bus.grantedNanos() + bus.pollEvents(handler)
                        + bus.pollFaults(faults);
                }
                allocated = Math.min(allocated, threads.getCurrentThreadAllocatedBytes() - before);
            }
            assertTrue(leak[0] > 0, "the fault of the model has begun");
            assertEquals(0, allocated, "bytes in " + TICKS + " rounds; sum " + sum);
        }
    }
}
