package tickbus.demo.board;

/** A tank with a level from 0 to 100 percent. What does not fit overflows; what is not there does not flow. */
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
     * @return how much there was of it
     */
    double draw(double percent) {
        double drawn = Math.min(level, percent);
        level -= drawn;
        return drawn;
    }
}
