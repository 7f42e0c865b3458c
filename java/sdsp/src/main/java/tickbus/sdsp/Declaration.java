package tickbus.sdsp;

import java.util.List;

/**
 * The data that a client sends to the server before the run.
 *
 * @param name the client's name, which no other client has: 1 to 255 bytes in UTF-8. The order of the names is the order of
 * the clients
 * @param multiple the number of server steps per step of this client, from 1
 * @param writes the variables that the client writes, at most 65535; no other client writes them
 * @param reads the names of the variables that the client reads, at most 65535; its own are allowed
 */
public record Declaration(String name, int multiple, List<Variable> writes, List<String> reads) {
    private static final int MOST_VARIABLES = 65_535;

    /**
     * Keeps copies of the lists.
     *
     * @param name the client's name
     * @param multiple the number of server steps per step of this client
     * @param writes the variables that the client writes
     * @param reads the names of the variables that the client reads
     * @throws IllegalArgumentException if the multiple is below 1, or there are too many variables
     */
    public Declaration {
        writes = List.copyOf(writes);
        reads = List.copyOf(reads);
        if (multiple < 1) {
            throw new IllegalArgumentException(
                "client \"" + name + "\" runs every " + multiple + " steps; expected 1 or more");
        }
        if (Math.max(writes.size(), reads.size()) > MOST_VARIABLES) {
            throw new IllegalArgumentException("client \"" + name + "\" writes " + writes.size() + " variables and reads "
                + reads.size() + "; at most " + MOST_VARIABLES + " each are possible: split it into several clients");
        }
    }
}
