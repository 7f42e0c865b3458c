package tickbus.simulator;

/** The timing of the simulator's ticks. */
public enum TickMode {
    /** As fast as possible: a tick starts when the previous one is done. */
    BEST_EFFORT,
    /** In step with the wall clock: a tick starts when its time has come. */
    REAL_TIME
}
