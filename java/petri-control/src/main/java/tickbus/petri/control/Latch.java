package tickbus.petri.control;

import java.util.List;
import tickbus.Signal;
import tickbus.Tickbus;

/** The signals that this end reads, with their values in this scan and the previous one. */
final class Latch {
    final List<String> names;
    final double[] now;
    final double[] before;
    private final Tickbus bus;
    private boolean filled;

    Latch(Tickbus bus) {
        this.bus = bus;
        names = bus.signals().stream().filter(signal -> !signal.isWritten()).map(Signal::name).toList();
        now = new double[names.size()];
        before = new double[names.size()];
    }

    /** Takes the values of the last receive. The first scan has no edges. */
    void take() {
        System.arraycopy(now, 0, before, 0, now.length);
        bus.getAll(now);
        if (!filled) {
            filled = true;
            System.arraycopy(now, 0, before, 0, now.length);
        }
    }
}
