package tickbus.simulator;

/** A clock that only moves when it is waited for or advanced. */
final class ManualTime implements TimeSource {
    private long now;
    int waits;
    /** Each wait ends this much before the time asked for, but after at least a nanosecond. */
    long early;

    @Override
    public long nanoTime() {
        return now;
    }

    @Override
    public void waitUntil(long nanoTime) {
        waits++;
        now = Math.max(now + 1, nanoTime - early);
    }

    void advance(long nanos) {
        now += nanos;
    }
}
