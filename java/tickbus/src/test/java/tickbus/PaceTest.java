package tickbus;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;

import java.time.Duration;
import org.junit.jupiter.api.Test;

class PaceTest {
    private long now = 1000;

    private final Pace pace = new Pace(Duration.ofNanos(10), () -> now, nanos -> now += nanos);

    private void assertTurn(long time, long lag, long missed) throws InterruptedException {
        assertEquals(time, pace.await());
        assertEquals(lag, pace.lagNanos());
        assertEquals(missed, pace.missed());
    }

    @Test
    void aLateTurnDoesNotDelayTheNextAndMissedOnesAreLeftOut() throws Exception {
        assertTurn(0, 0, 0);
        assertTurn(10, 0, 0);
        now += 13;
        assertTurn(20, 3, 0);
        assertTurn(30, 0, 0);
        now += 37;
        assertTurn(60, 7, 2);
        assertTurn(70, 0, 0);
        assertEquals(1070, now);
    }

    @Test
    void anInterruptEndsTheWait() throws Exception {
        pace.await();
        Thread.currentThread().interrupt();
        assertThrows(InterruptedException.class, pace::await);
    }

    @Test
    void aPeriodIsAboveZero() {
        assertThrows(IllegalArgumentException.class, () -> Pace.every(Duration.ZERO));
    }
}
