package tickbus.petri.run;

import tickbus.petri.net.PetriNet;

/** Keeps the last firings. The size is fixed, so that logging allocates nothing. */
public final class FiringLog implements FiringListener {
    private final PetriNet net;
    private final long[] scans;
    private final long[] times;
    private final int[] transitions;
    private final int[] choices;
    private long total;

    /** A log of the last {@code capacity} firings, 1 or more. */
    public FiringLog(PetriNet net, int capacity) {
        if (capacity < 1) {
            throw new IllegalArgumentException("a log of " + capacity + " firings; expected 1 or more");
        }
        this.net = net;
        scans = new long[capacity];
        times = new long[capacity];
        transitions = new int[capacity];
        choices = new int[capacity];
    }

    @Override
    public void fired(long scan, long nanos, int transition, int choicesOfIt) {
        int at = (int) (total++ % scans.length);
        scans[at] = scan;
        times[at] = nanos;
        transitions[at] = transition;
        choices[at] = choicesOfIt;
    }

    /** The number of firings so far, kept or not. */
    public long total() {
        return total;
    }

    /** One line for each kept firing: scan, nanoseconds, transition, and the number of choices if above 1. */
    @Override
    public String toString() {
        StringBuilder text = new StringBuilder();
        for (long i = Math.max(0, total - scans.length); i < total; i++) {
            int at = (int) (i % scans.length);
            text.append(scans[at]).append(' ').append(times[at]).append(' ')
                .append(net.transition(transitions[at]).name())
                .append(choices[at] > 1 ? " 1 of " + choices[at] : "").append('\n');
        }
        return text.toString();
    }
}
