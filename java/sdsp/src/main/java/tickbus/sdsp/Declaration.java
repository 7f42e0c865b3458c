package tickbus.sdsp;

import java.time.Duration;
import java.util.List;

/**
 * The data that a client sends to the server before the run.
 *
 * @param name the client's name, which no other client has: 1 to 255 bytes in UTF-8. The order of the names is the order of
 * the clients
 * @param multiple the number of server steps per step of this client, from 1
 * @param intervalNanos the virtual time of one step of this client in nanoseconds, at least one step of the server; 0 if the
 * multiple counts
 * @param writes the variables that the client writes, at most 65535; no other client writes them
 * @param reads the names of the variables that the client reads, at most 65535; its own are allowed
 */
public record Declaration(String name, int multiple, long intervalNanos, List<Variable> writes, List<String> reads) {
    private static final int MOST_VARIABLES = 65_535;

    /**
     * Keeps copies of the lists.
     *
     * @param name the client's name
     * @param multiple the number of server steps per step of this client
     * @param intervalNanos the virtual time of one step, or 0
     * @param writes the variables that the client writes
     * @param reads the names of the variables that the client reads
     * @throws IllegalArgumentException if the multiple is below 1, the interval below 0, or there are too many variables
     */
    public Declaration {
        writes = List.copyOf(writes);
        reads = List.copyOf(reads);
        if (multiple < 1) {
            throw new IllegalArgumentException(
                "client \"" + name + "\" runs every " + multiple + " steps; expected 1 or more");
        }
        if (intervalNanos < 0) {
            throw new IllegalArgumentException(
                "client \"" + name + "\" runs every " + intervalNanos + " ns; expected 0 or more");
        }
        if (Math.max(writes.size(), reads.size()) > MOST_VARIABLES) {
            throw new IllegalArgumentException("client \"" + name + "\" writes " + writes.size() + " variables and reads "
                + reads.size() + "; at most " + MOST_VARIABLES + " each are possible: split it into several clients");
        }
    }

    /**
     * A declaration with a multiple of the server's steps.
     *
     * @param name the client's name
     * @param multiple the number of server steps per step of this client
     * @param writes the variables that the client writes
     * @param reads the names of the variables that the client reads
     * @throws IllegalArgumentException if the multiple is below 1, or there are too many variables
     */
    public Declaration(String name, int multiple, List<Variable> writes, List<String> reads) {
        this(name, multiple, 0, writes, reads);
    }

    /**
     * A declaration with a step in virtual time, whatever the server's step is.
     *
     * @param name the client's name
     * @param step the virtual time of one step, at least one step of the server; the client runs in the first step at or after
     * each multiple of it
     * @param writes the variables that the client writes
     * @param reads the names of the variables that the client reads
     * @return the declaration
     * @throws IllegalArgumentException if the step is not above 0, or there are too many variables
     */
    public static Declaration every(String name, Duration step, List<Variable> writes, List<String> reads) {
        if (step.isZero()) {
            throw new IllegalArgumentException("client \"" + name + "\" runs every 0 ns; expected 1 or more");
        }
        return new Declaration(name, 1, step.toNanos(), writes, reads);
    }
}
