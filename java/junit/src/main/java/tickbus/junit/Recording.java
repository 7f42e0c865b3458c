package tickbus.junit;

/** When the recording of a test is kept: a VCD file with every signal at every tick. */
public enum Recording {
    /** When the test fails, which is the default. */
    ON_FAILURE,
    /** Whatever comes of the test. */
    ALWAYS,
    /** There is none, which makes ticks a little faster. */
    NEVER
}
