package tickbus.sdsp;

import java.util.List;

/**
 * What a client tells the server before the run.
 *
 * @param name its name, which no other client has: 1 to 255 bytes in UTF-8. The order of the names is the order of the
 *     clients
 * @param multiple how many steps of the server one step of this client takes, from 1
 * @param writes the variables that it writes, at most 65535; no one else writes them
 * @param reads the names of the variables that it reads, at most 65535; they may be its own
 */
public record Declaration(String name, int multiple, List<Variable> writes, List<String> reads) {
    private static final int MOST_VARIABLES = 65_535;

    /**
     * Keeps copies of the lists.
     *
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
