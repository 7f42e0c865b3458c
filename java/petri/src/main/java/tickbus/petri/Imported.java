package tickbus.petri;

import java.util.List;

/**
 * A net from a file of a format that does not hold all of it.
 *
 * @param net the net
 * @param warnings what was assumed, each with file and line; empty if nothing was
 */
public record Imported(PetriNet net, List<String> warnings) {
}
