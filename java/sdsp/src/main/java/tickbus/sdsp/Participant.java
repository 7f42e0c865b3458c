package tickbus.sdsp;

/**
 * A client of a run in virtual time.
 *
 * <p>Values are in slots of 64 bits, one per variable, in the order of the {@link Declaration}; {@link DataType} defines
 * their format. The arrays belong to the client's connection, which reuses them for each step.
 */
public interface Participant {
    /** The result of {@link #nextUpdate} for a client that runs as it has declared. */
    long AS_DECLARED = Long.MIN_VALUE;

    /**
     * The variables that the participant writes and reads. Asked once, before the run.
     *
     * @return the declaration
     */
    Declaration declare();

    /**
     * The values before the first step.
     *
     * @param writes a slot per variable that the participant writes, 0 at first
     */
    void initial(long[] writes);

    /**
     * Runs one step.
     *
     * @param sequence the number of the server's step, from 1; a client with a multiple gets only some of them
     * @param nanos the virtual time of this step in nanoseconds; the first step has 0
     * @param reads a slot per variable that the participant reads, from the snapshot that all clients of the step get:
     * values that other clients write in this step come with the next one
     * @param writes a slot per variable that the participant writes; it still holds the value written last
     * @throws Exception if the participant cannot continue; the message gives the reason, and the run ends for everyone
     */
    void run(long sequence, long nanos, long[] reads, long[] writes) throws Exception;

    /**
     * The virtual time at which the participant wants to run next, asked after {@link #initial} and after each {@link #run},
     * for simulations that know the time of their next event. The participant runs in the first step at or after this time,
     * in the following step at the earliest; the values that it has written stay until then.
     *
     * @return the time in nanoseconds; {@link #AS_DECLARED} for the next step by the declaration
     */
    default long nextUpdate() {
        return AS_DECLARED;
    }

    /**
     * The state after the last {@link #run}, as bytes of its own format: asked when the run is saved. A participant that has
     * none to give runs its steps again when the run is restored.
     *
     * @return the state, at most 500,000 bytes
     * @throws Exception if it has none; the message gives the reason
     */
    default byte[] save() throws Exception {
        throw new UnsupportedOperationException("it has no way to save its state");
    }

    /**
     * Takes over a {@linkplain #save saved} state, after {@link #initial} and before the next {@link #run}.
     *
     * @param state the bytes
     * @throws Exception if it cannot; the message gives the reason, and the run ends for everyone
     */
    default void restore(byte[] state) throws Exception {
        throw new UnsupportedOperationException("it has no way to restore its state");
    }

    /**
     * The server has been waiting for other clients for a second or more, or is paused. Called once a second while the
     * participant has nothing to do.
     *
     * @param forWhom a text for people, such as {@code "plc" to finish step 42}
     */
    default void waiting(String forWhom) {
    }
}
