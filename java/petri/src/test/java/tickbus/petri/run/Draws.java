package tickbus.petri.run;

/** The draws of {@link SplitMix}, for tests of all packages. */
public final class Draws {
    private final SplitMix random;

    public Draws(long seed) {
        random = new SplitMix(seed);
    }

    /** From 0 to {@code bound} - 1. */
    public int below(int bound) {
        return random.below(bound);
    }
}
