package tickbus.junit;

import org.opentest4j.AssertionFailedError;

/** A wait that needs its limit: {@code plc.await(on("Running lamp")).within(40)}. */
public final class Await {
    private final Plc plc;
    private final Condition.Bound condition;

    Await(Plc plc, Condition.Bound condition) {
        this.plc = plc;
        this.condition = condition;
    }

    /**
     * Lets ticks pass until the condition holds; no tick if it holds already.
     *
     * @param ticks fails if the condition does not hold after this many ticks; at least 1
     * @return the number of ticks it took
     */
    public long within(long ticks) {
        plc.limited(this);
        if (ticks < 1) {
            throw new IllegalArgumentException("a limit of " + ticks + " ticks; give it at least 1, or use expect(…)");
        }
        long begin = plc.ticks();
        while (!condition.holds()) {
            if (plc.isStrict() && plc.ticks() - begin == ticks) {
                throw plc.failure(condition, "within " + plc.span(ticks) + " of tick " + begin);
            }
            plc.tick();
        }
        return plc.ticks() - begin;
    }

    /**
     * Lets ticks pass until the condition holds; no tick if it holds already.
     *
     * @param duration fails if the condition does not hold after this much simulation time, such as {@code "80ms"};
     * at least one tick
     * @return the number of ticks it took
     */
    public long within(String duration) {
        plc.limited(this);
        long ticks = Durations.parse(duration) / plc.stepNanos();
        if (ticks < 1) {
            throw new IllegalArgumentException("a limit of " + duration + " is shorter than one tick of "
                + Durations.text(plc.stepNanos()) + "; give it more time, or use expect(…)");
        }
        return within(ticks);
    }

    /** The failure of a test that never called {@code within}. */
    AssertionFailedError unlimited() {
        return new AssertionFailedError("await(" + condition.subject() + " " + condition.expected()
            + ") was given no limit, so that it never waited; add .within(…)");
    }
}
