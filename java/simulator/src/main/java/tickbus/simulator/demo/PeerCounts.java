package tickbus.simulator.demo;

import java.util.Map;

/** What the other end of the link counted: the PLC's side of the comparison. */
@FunctionalInterface
public interface PeerCounts {
    /**
     * Rising edges per Boolean signal: those that the PLC program saw of a signal to it, and those that it
     * made of a signal from it.
     *
     * @return counts by the signal's name; empty if the other end counts nothing
     */
    Map<String, Long> rises();
}
