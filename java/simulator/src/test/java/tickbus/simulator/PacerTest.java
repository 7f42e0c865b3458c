package tickbus.simulator;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import org.junit.jupiter.api.Test;

class PacerTest {
    private static final long STEP = 1000;

    private final ManualTime time = new ManualTime();
    private final Pacer pacer = new Pacer(time, STEP);

    private long tickAt() {
        pacer.awaitTick();
        return time.nanoTime();
    }

    @Test
    void deadlinesAreCountedFromTheStartSoNothingDrifts() {
        time.advance(77);
        assertEquals(77, tickAt());
        for (int tick = 1; tick <= 1000; tick++) {
            time.advance(tick % 900);
            assertEquals(77 + tick * STEP, tickAt());
        }
        assertEquals(0, pacer.lateTicks());
    }

    @Test
    void aWaitThatEndsEarlyIsWaitedOn() {
        time.early = 10;
        tickAt();
        assertEquals(STEP, tickAt());
        assertTrue(time.waits > 1);
    }

    @Test
    void aSmallDelayIsMadeUpByTheNextTick() {
        tickAt();
        time.advance(1500);
        assertEquals(1500, tickAt());
        assertEquals(2000, tickAt());
        assertEquals(0, pacer.lateTicks());
    }

    @Test
    void afterAStallTicksGoOnWithoutABurst() {
        tickAt();
        time.advance(10 * STEP + 300);
        assertEquals(10_300, tickAt(), "late, but only once");
        assertEquals(11_000, tickAt(), "the next is on the old grid");
        assertEquals(12_000, tickAt());
        assertEquals(1, pacer.lateTicks());
        assertEquals(9, pacer.droppedTicks());
    }

    @Test
    void anInterruptedThreadDoesNotWait() {
        tickAt();
        Thread.currentThread().interrupt();
        assertEquals(0, tickAt());
        assertTrue(Thread.interrupted());
    }
}
