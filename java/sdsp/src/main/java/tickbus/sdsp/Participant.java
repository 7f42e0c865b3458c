package tickbus.sdsp;

/**
 * A client of a run in virtual time.
 *
 * <p>Values are in slots of 64 bits, one per variable, in the order of the {@link Declaration}; {@link DataType} tells how.
 * The arrays belong to the client's connection, which uses the same ones for each step.
 */
public interface Participant {
    /**
     * What it writes and reads. Asked once, before the run.
     *
     * @return the declaration
     */
    Declaration declare();

    /**
     * The values before the first step.
     *
     * @param writes a slot per variable that it writes, 0 at first
     */
    void initial(long[] writes);

    /**
     * Runs one step.
     *
     * @param sequence the number of the server's step, from 1; a client with a multiple sees some of them only
     * @param nanos the virtual time of this step in nanoseconds; that of the first is 0
     * @param reads a slot per variable that it reads, from the snapshot that all clients of the step see: what others write
     *     in this step comes with the next one
     * @param writes a slot per variable that it writes, which still holds what was written last
     * @throws Exception if it cannot go on; the message tells why, and the run ends for everyone
     */
    void run(long sequence, long nanos, long[] reads, long[] writes) throws Exception;
}
