package tickbus.simulator;

/** How the simulator's ticks follow one another. */
public enum TickMode {
    /** As fast as possible: a tick starts when the one before it is done. */
    BEST_EFFORT,
    /** In step with the wall clock: a tick starts when its time has come. */
    REAL_TIME
}
