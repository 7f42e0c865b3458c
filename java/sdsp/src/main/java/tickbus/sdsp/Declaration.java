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
    /** Keeps copies of the lists. */
    public Declaration {
        writes = List.copyOf(writes);
        reads = List.copyOf(reads);
    }
}
