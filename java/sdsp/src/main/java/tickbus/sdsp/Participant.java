package tickbus.sdsp;

/**
 * A client of a run in virtual time.
 *
 * <p>Values are in slots of 64 bits, one per variable, in the order of the {@link Declaration}; {@link DataType} defines
 * their format. The arrays belong to the client's connection, which reuses them for each step.
 */
public interface Participant {
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
}
