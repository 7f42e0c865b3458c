package tickbus.petri.format;

import java.util.List;
import tickbus.petri.net.PetriNet;

/**
 * A net from a file whose format does not hold all of the net.
 *
 * @param net the net
 * @param warnings the assumptions, each with file and line; empty if there were no assumptions
 */
public record Imported(PetriNet net, List<String> warnings) {
}
