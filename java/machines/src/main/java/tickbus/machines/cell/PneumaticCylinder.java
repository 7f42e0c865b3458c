package tickbus.machines.cell;

/** A pneumatic cylinder between two end sensors. */
final class PneumaticCylinder {
    private final long strokeNanos;
    private long at;
    private boolean willJam;
    private boolean jammed;
    private double wear;

    /** A retracted cylinder that takes {@code strokeNanos} from one end to the other. */
    PneumaticCylinder(long strokeNanos) {
        this.strokeNanos = strokeNanos;
    }

    /** With one valve and a spring: forward while the valve is on, otherwise back. */
    void step(boolean valve, long nanos) {
        step(valve, !valve, nanos);
    }

    /** With a valve for each direction: with neither or both on, the cylinder stays. */
    void step(boolean forward, boolean backward, long time) {
        long nanos = wear == 0 ? time : Math.round(time * (1 - wear));
        if (forward && !backward) {
            boolean halts = willJam && at <= strokeNanos / 2;
            long most = halts ? strokeNanos / 2 : strokeNanos;
            at = Math.min(at + nanos, most);
            jammed = halts && at == most;
        } else if (backward && !forward) {
            at = Math.max(at - nanos, 0);
            if (jammed && at == 0) {
                jammed = false;
                willJam = false;
            }
        }
    }

    /** The part of the stroke that the cylinder is forward, in percent. */
    double percent() {
        return 100.0 * at / strokeNanos;
    }

    boolean isForward() {
        return at == strokeNanos;
    }

    boolean isBack() {
        return at == 0;
    }

    /**
     * Stops the next stroke half-way, until the cylinder has been back; a cylinder past the middle finishes its stroke
     * first.
     */
    void jam() {
        willJam = true;
    }

    /** Frees the cylinder, and lets its next strokes pass. */
    void jamsNoMore() {
        willJam = false;
        jammed = false;
    }

    /** A worn cylinder has this part less of its speed; 0 is a new one. */
    void wear(double part) {
        wear = part;
    }

    boolean isJammed() {
        return jammed;
    }
}
