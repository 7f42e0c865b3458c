package tickbus.demo.cell;

/** A pneumatic cylinder between two end sensors. */
final class PneumaticCylinder {
    private final long strokeNanos;
    private long at;
    private boolean willJam;
    private boolean jammed;

    /** A cylinder that is back, and takes {@code strokeNanos} from one end to the other. */
    PneumaticCylinder(long strokeNanos) {
        this.strokeNanos = strokeNanos;
    }

    /** With a valve that a spring puts back: forward while it is on, otherwise back. */
    void step(boolean valve, long nanos) {
        step(valve, !valve, nanos);
    }

    /** With a valve for each direction: with neither, or with both, it stays where it is. */
    void step(boolean forward, boolean backward, long nanos) {
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

    boolean isForward() {
        return at == strokeNanos;
    }

    boolean isBack() {
        return at == 0;
    }

    /** Its next stroke stops half-way, until it has been back; one that is past the middle is finished before. */
    void jam() {
        willJam = true;
    }

    boolean isJammed() {
        return jammed;
    }
}
