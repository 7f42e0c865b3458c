package tickbus.cell;

import java.time.LocalDateTime;
import java.util.List;
import java.util.function.Supplier;
import tickbus.Tickbus;
import tickbus.identification.IdentificationHead;

/** The heads of stations 1, 3 and 4, on one line to the reader of code carriers. */
final class Heads {
    private final Tickbus line;
    private final List<StationHead> all;

    private Heads(Tickbus line, Supplier<LocalDateTime> clock) {
        this.line = line;
        all = List.of(head("Head 1", clock), head("Head 3", clock), head("Head 4", clock));
    }

    private StationHead head(String station, Supplier<LocalDateTime> clock) {
        return new StationHead(station, line == null ? null : new IdentificationHead(line, station), clock);
    }

    /**
     * The heads on a line.
     *
     * @param line open, with the signals of plc/cell/identification.cfg; closed by the caller
     * @param clock gives the time for records
     */
    static Heads on(Tickbus line, Supplier<LocalDateTime> clock) {
        return new Heads(line, clock);
    }

    /** No heads, for nets that are analysed and do not run. */
    static Heads none() {
        return new Heads(null, () -> null);
    }

    StationHead one() {
        return all.get(0);
    }

    StationHead three() {
        return all.get(1);
    }

    StationHead four() {
        return all.get(2);
    }

    /** How often a read or write had to be retried. */
    int failures() {
        return all.stream().mapToInt(StationHead::failures).sum();
    }

    /** One exchange with the reader, before each scan of the nets; the time must not go back. */
    void exchange(long nanos) {
        for (int i = 0; i < all.size(); i++) {
            all.get(i).ask(nanos);
        }
        line.exchange(nanos);
        for (int i = 0; i < all.size(); i++) {
            all.get(i).take();
        }
    }
}
