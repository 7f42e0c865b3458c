package tickbus.junit;

/** When a test's recording is kept: a VCD file with every signal at every tick. */
public enum Recording {
    /** When the test fails, which is the default. */
    ON_FAILURE,
    /** In any case. */
    ALWAYS,
    /** Never; without a recording, ticks are a little faster. */
    NEVER
}
