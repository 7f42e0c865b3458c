package tickbus.machines.rig;

/**
 * A package sensor: a light beam across a lift's path, which a passing bottle blocks.
 *
 * <p>The sensor also measures how long it has been blocked while the lift is commanded to run; a passing bottle blocks it
 * for a small part of the time that means a jam.
 */
final class Beam {
    /** Blocked for longer than this while the lift runs is a jam. */
    static final long JAM_NANOS = 1_000_000_000L;

    private final double height;
    private boolean blocked;
    private long blockedNanos;

    Beam(double height) {
        this.height = height;
    }

    /** Base of a bottle that the beam meets at mid-height. */
    double middle() {
        return height - Geometry.BOTTLE_HEIGHT / 2;
    }

    boolean blocked() {
        return blocked;
    }

    boolean blockedTooLong() {
        return blockedNanos > JAM_NANOS;
    }

    /**
     * Checks whether the bottle is in the beam.
     *
     * @param bottle the bottle, or null
     * @param running the lift is commanded to run
     * @param nanos time since the last check
     */
    void look(Bottle bottle, boolean running, long nanos) {
        blocked = bottle != null
                && bottle.height() <= height
                && bottle.height() + Geometry.BOTTLE_HEIGHT >= height;
        blockedNanos = blocked && running ? blockedNanos + nanos : 0;
    }
}
