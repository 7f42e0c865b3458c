package tickbus.machines.board;

/** A tank with a level from 0 to 100 percent. Liquid beyond that overflows; an empty tank gives nothing. */
final class Tank {
    private static final double FULL = 100;

    private double level;

    double level() {
        return level;
    }

    void fill(double percent) {
        level = Math.min(FULL, level + percent);
    }

    /**
     * Draws liquid.
     *
     * @return the amount drawn, at most the contents
     */
    double draw(double percent) {
        double drawn = Math.min(level, percent);
        level -= drawn;
        return drawn;
    }
}
