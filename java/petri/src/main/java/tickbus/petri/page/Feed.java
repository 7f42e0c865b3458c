package tickbus.petri.page;

import java.io.IOException;
import java.net.URI;
import java.util.ArrayList;
import java.util.List;
import tickbus.FieldbusException;
import tickbus.LiveNets;
import tickbus.Status;
import tickbus.petri.run.NetWatch;
import tickbus.petri.run.RunningNet;

/** Hands over the nets and their states while somebody looks, until they are taken from the page. */
final class Feed {
    private static final long PATIENCE_NANOS = 1_000_000_000;
    private static final long LONGEST_END_MILLIS = 2000;
    private static final long PERIOD_MILLIS = 33;
    /** Formatting that takes long is followed by a pause of this many times its length. */
    private static final long REST = 20;
    private static final long LONGEST_REST_MILLIS = 1000;
    /** For how long the feed waits for the first state, if the nets scan slowly or not at all. */
    private static final int PATIENT_PERIODS = 6;
    /** The interval at which the page's time advances although nothing happens. */
    private static final long BEAT_NANOS = 500_000_000;

    private final LiveNets nets;
    private final List<NetWatch> watches;
    private final String[][] moments;
    private final String[][] rests;
    /** When each watch handed over last; 0 for never. */
    private final long[] seen;
    private final Thread thread = new Thread(this::run, "net page");
    private boolean drawn;
    private volatile boolean over;

    private Feed(LiveNets nets, List<NetWatch> watches) {
        this.nets = nets;
        this.watches = watches;
        moments = new String[watches.size()][];
        rests = new String[watches.size()][];
        for (int i = 0; i < watches.size(); i++) {
            moments[i] = new String[watches.get(i).nets().size()];
            rests[i] = new String[watches.get(i).nets().size()];
        }
        seen = new long[watches.size()];
    }

    /** Begins to show nets, as {@link NetPage#open} describes. */
    static Feed open(String address, String title, List<NetWatch> watches) throws IOException {
        try {
            Feed feed = new Feed(LiveNets.open(address, title), watches);
            feed.thread.setDaemon(true);
            feed.thread.start();
            return feed;
        } catch (FieldbusException e) {
            if (e.status() == Status.BUS_FAILED) {
                throw new IOException(e.getMessage(), e);
            }
            boolean isWrong = e.status() == Status.BAD_ARGUMENT;
            throw isWrong ? new IllegalArgumentException(e.getMessage(), e) : new IllegalStateException(e.getMessage(), e);
        }
    }

    URI address() {
        return nets.address();
    }

    void close() {
        over = true;
        nets.close();
        // Another page can ask the same watches from now on.
        try {
            thread.join(LONGEST_END_MILLIS);
        } catch (InterruptedException e) {
            Thread.currentThread().interrupt();
        }
    }

    private void run() {
        try {
            feed();
        } catch (FieldbusException refused) {
            if (!over) {
                System.getLogger(NetPage.class.getName()).log(System.Logger.Level.WARNING, "the nets are not shown any more", refused);
            }
        } catch (InterruptedException e) {
            Thread.currentThread().interrupt();
        }
    }

    private void feed() throws InterruptedException {
        long publishedAt = 0;
        boolean isFirst = true;
        while (!over) {
            if (!nets.isWanted(PATIENCE_NANOS)) {
                isFirst = true;
                continue;
            }
            if (!drawn) {
                // Laying out a large net takes a while, so the first viewer triggers it.
                nets.draw(Json.nets(watches.stream().flatMap(watch -> watch.nets().stream()).toList()));
                drawn = true;
            }
            if (isFirst) {
                // A state handed over since the last viewer left can be old.
                watches.forEach(NetWatch::ask);
                for (int i = 0; i < PATIENT_PERIODS && !watches.stream().allMatch(NetWatch::isThere); i++) {
                    Thread.sleep(PERIOD_MILLIS);
                }
            }
            long begun = System.nanoTime();
            boolean changed = look(begun);
            String state = text(begun);
            long took = (System.nanoTime() - begun) / 1_000_000;
            if (isFirst || changed || begun - publishedAt >= BEAT_NANOS) {
                nets.put(state);
                publishedAt = begun;
                isFirst = false;
            }
            Thread.sleep(Math.max(PERIOD_MILLIS, Math.min(LONGEST_REST_MILLIS, took * REST)));
        }
    }

    /** Takes the state handed over, and asks for the next; true if more than the time has changed. */
    private boolean look(long now) {
        boolean changed = false;
        for (int i = 0; i < watches.size(); i++) {
            NetWatch watch = watches.get(i);
            if (watch.isThere()) {
                List<RunningNet> all = watch.nets();
                for (int n = 0; n < all.size(); n++) {
                    String rest = Json.state(all.get(n), watch.state(n), watch.note());
                    changed |= !rest.equals(rests[i][n]);
                    rests[i][n] = rest;
                    moments[i][n] = Json.moment(watch.state(n));
                }
                seen[i] = now;
            }
            watch.ask();
        }
        return changed;
    }

    private String text(long now) {
        List<String> all = new ArrayList<>();
        for (int i = 0; i < watches.size(); i++) {
            String age = Long.toString((now - seen[i]) / 1_000_000);
            for (int n = 0; n < rests[i].length; n++) {
                all.add(rests[i][n] == null ? "null" : "{\"age\":" + age + "," + moments[i][n] + "," + rests[i][n] + "}");
            }
        }
        return "{\"nets\":[" + String.join(",", all) + "]}";
    }
}
