package tickbus.junit;

/** When the recording of a test is kept: a VCD file with every signal at every tick. */
public enum Recording {
    /** When the test fails, which is the default. */
    ON_FAILURE,
    /** Whether the test passes or fails. */
    ALWAYS,
    /** Never; without a recording, ticks are a little faster. */
    NEVER
}
