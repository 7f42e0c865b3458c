package tickbus;

import static org.junit.jupiter.api.Assertions.assertDoesNotThrow;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import com.sun.management.ThreadMXBean;
import java.lang.management.ManagementFactory;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.concurrent.CountDownLatch;
import java.util.concurrent.atomic.AtomicLong;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.function.Executable;
import org.junit.jupiter.api.io.TempDir;

@Tag("native")
class DriverVectorTest {
    private static final int MANY = 300;
    private static final long MILLIS = 1_000_000;

    @TempDir
    Path directory;

    private Path mirror() {
        return DriverCfg.mirror(1).signal("in", "%IB0").signal("out", "%QB0", "fail_safe = 9").write(directory);
    }

    private DriverVector open(int count) {
        return DriverVector.open(mirror(), count, place -> "");
    }

    @Test
    void eachDriverHasItsOwnValuesAndItsOwnTime() {
        try (DriverVector plcs = open(MANY)) {
            long[] times = new long[MANY];
            for (int tick = 0; tick < 4; tick++) {
                for (int place = 0; place < MANY; place++) {
                    times[place] = tick * (MILLIS + place);
                    plcs.drivers().get(place).signal("in").set(place % 250);
                }
                assertEquals(0, plcs.exchange(times));
            }
            for (int place = 0; place < MANY; place++) {
                Tickbus plc = plcs.drivers().get(place);
                assertEquals(place % 250, plc.signal("out").get());
                assertEquals(Status.FRESH.code(), plcs.status(place));
                assertTrue(plc.grantedNanos() > 3 * (MILLIS + place));
            }
            assertEquals(0, plcs.receive(10 * MILLIS));
            assertEquals(0, plcs.send());
            assertEquals("5", plcs.drivers().get(MANY - 1).statistics().get("ticks"));
        }
    }

    @Test
    void aDriverThatFailsStopsNoOtherOne() throws InterruptedException {
        try (DriverVector plcs = open(200)) {
            assertEquals(0, plcs.exchange(MILLIS));
            long[] times = new long[200];
            Arrays.fill(times, 2 * MILLIS);
            times[130] = 0;
            plcs.drivers().get(50).close();
            plcs.drivers().get(60).releaseThread();
            CountDownLatch ticked = new CountDownLatch(1);
            CountDownLatch done = new CountDownLatch(1);
            Thread other = new Thread(() -> {
                plcs.drivers().get(60).exchange(MILLIS);
                ticked.countDown();
                assertDoesNotThrow(() -> done.await());
            });
            other.start();
            ticked.await();
            assertEquals(3, plcs.exchange(times));
            done.countDown();
            other.join();
            for (int place = 0; place < 200; place++) {
                Status expected = switch (place) {
                    case 50 -> Status.CLOSED;
                    case 60 -> Status.BUSY;
                    case 130 -> Status.BUS_FAILED;
                    default -> Status.FRESH;
                };
                assertEquals(expected.code(), plcs.status(place), "place " + place);
            }
        }
    }

    @Test
    void aThreadThatWaitsForAnotherOneTicksAtItsOwnTime() throws InterruptedException {
        try (DriverVector plcs = open(2)) {
            AtomicLong granted = new AtomicLong();
            Thread other = new Thread(() -> {
                plcs.exchange(50 * MILLIS);
                granted.set(plcs.drivers().get(1).grantedNanos());
                plcs.releaseThread();
            });
            synchronized (plcs) {
                other.start();
                while (other.getState() != Thread.State.BLOCKED) {
                    Thread.onSpinWait();
                }
                assertEquals(0, plcs.exchange(MILLIS));
                plcs.releaseThread();
            }
            other.join();
            assertTrue(granted.get() >= 50 * MILLIS, "granted " + granted);
        }
    }

    @Test
    void wrongListsAreRefused() {
        Path file = mirror();
        assertMessage("the count is 0; expected 1 to 4096", () -> DriverVector.open(file, 0, place -> ""));
        assertMessage("the count is 4097; a process can open 4096", () -> DriverVector.open(file, 4097, place -> ""));
        try (Tickbus one = Tickbus.open(file); DriverVector plcs = DriverVector.open(file, 2, place -> "")) {
            List<Tickbus> twice = List.of(one, plcs.drivers().get(0), one);
            assertMessage("driver 'Driver 1' is in the list twice", () -> DriverVector.of(twice));
            assertMessage("there are 3 times; expected one for each of the 2 drivers", () -> plcs.exchange(new long[3]));
            assertMessage("there are 0 times", () -> plcs.receive(new long[0]));
        }
        try (DriverVector none = DriverVector.of(List.of())) {
            assertEquals(0, none.exchange());
        }
    }

    @Test
    void aVectorThatCannotBeOpenedLeavesNoDriverOpen() {
        List<String> tables = new ArrayList<>(List.of("", "", "[fieldbus]\nkind = \"nothing\"\n"));
        FieldbusException e = assertThrows(FieldbusException.class,
            () -> DriverVector.open(mirror(), 3, tables::get));
        assertEquals(Status.BAD_CONFIG, e.status());
    }

    @Test
    void aResetBeginsTheNextEpisode() {
        Tickbus closed;
        try (Tickbus plc = Tickbus.open(mirror())) {
            List<Double> first = episode(plc);
            for (int round = 0; round < 3; round++) {
                plc.reset();
                assertEquals(9, plc.signal("out").get());
                assertEquals("0", plc.statistics().get("ticks"));
                assertEquals(first, episode(plc));
            }
            closed = plc;
        }
        assertEquals(Status.CLOSED, assertThrows(FieldbusException.class, closed::reset).status());
    }

    private static List<Double> episode(Tickbus plc) {
        List<Double> seen = new ArrayList<>();
        for (int tick = 0; tick < 5; tick++) {
            plc.signal("in").set(tick + 20);
            plc.exchange(tick * MILLIS);
            seen.add(plc.signal("out").get());
        }
        return seen;
    }

    @Test
    void ticksOfManyMakeNoGarbage() {
        assumeTrue(ManagementFactory.getThreadMXBean() instanceof ThreadMXBean, "this JVM counts no allocations");
        ThreadMXBean threads = (ThreadMXBean) ManagementFactory.getThreadMXBean();
        try (DriverVector plcs = open(150)) {
            long least = Long.MAX_VALUE;
            for (int round = 0; round < 4; round++) {
                long before = threads.getCurrentThreadAllocatedBytes();
                for (int tick = 0; tick < 2000; tick++) {
                    plcs.exchange((2000L * round + tick) * MILLIS);
                }
                least = Math.min(least, threads.getCurrentThreadAllocatedBytes() - before);
            }
            assertTrue(least < 2000, "2000 ticks of 150 drivers allocated " + least + " bytes");
        }
    }

    private static void assertMessage(String words, Executable call) {
        String message = assertThrows(IllegalArgumentException.class, call).getMessage();
        assertTrue(message.contains(words), message);
    }
}
