package tickbus.junit;

/**
 * A condition that holds now, and can be required to keep holding: {@code plc.expect(off("Not OK")).during("5s")}.
 */
public final class Expectation {
    private final Plc plc;
    private final Condition.Bound condition;

    Expectation(Plc plc, Condition.Bound condition) {
        this.plc = plc;
        this.condition = condition;
    }

    /**
     * Lets ticks pass, and fails at the end of the first tick in which the condition does not hold.
     *
     * @param ticks how many
     * @return the PLC
     */
    public Plc during(long ticks) {
        long begin = plc.ticks();
        for (long i = 0; i < ticks; i++) {
            plc.tick();
            plc.check(condition, "for " + plc.span(ticks) + " from tick " + begin);
        }
        return plc;
    }

    /**
     * Lets simulation time pass, and fails at the end of the first tick in which the condition does not hold.
     *
     * @param duration such as {@code "5s"}; rounded up to whole ticks
     * @return the PLC
     */
    public Plc during(String duration) {
        return during(plc.ticksOf(duration));
    }
}
