package tickbus.petri.page;

import java.nio.charset.StandardCharsets;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import tickbus.petri.run.NetWatch;
import tickbus.petri.run.RunningNet;

/** The newest state, updated while somebody watches. Slow viewers miss intermediate states, and make nobody wait. */
final class Feed implements Runnable {
    private static final long PERIOD_MILLIS = 33;
    /** Formatting that takes long is followed by a pause of this many times its length. */
    private static final long REST = 20;
    private static final long LONGEST_REST_MILLIS = 1000;
    /** For how long the feed waits for the first state, if the nets scan slowly or not at all. */
    private static final int PATIENT_PERIODS = 6;
    /** The interval at which the page's time advances although nothing happens. */
    private static final long BEAT_NANOS = 500_000_000;

    private static final String PREFIX = "data: ";

    private final String run;
    private final List<NetWatch> watches;
    private final Workers workers;
    private final String[][] moments;
    private final String[][] rests;
    /** When each watch handed over last; 0 for never. */
    private final long[] seen;
    private int viewers;
    private byte[] newest = {};
    private long version;
    private boolean hurry;
    private boolean closed;

    Feed(String run, List<NetWatch> watches, Workers workers) {
        this.run = run;
        this.watches = watches;
        this.workers = workers;
        moments = new String[watches.size()][];
        rests = new String[watches.size()][];
        for (int i = 0; i < watches.size(); i++) {
            moments[i] = new String[watches.get(i).nets().size()];
            rests[i] = new String[watches.get(i).nets().size()];
        }
        seen = new long[watches.size()];
    }

    /**
     * Adds a viewer: returns the number of the newest state, after which it waits for another; -1 if there are enough
     * viewers.
     */
    synchronized long enter(int most) {
        if (viewers >= most || closed) {
            return -1;
        }
        viewers++;
        // The viewer gets a current state, not the one seen last.
        hurry = true;
        notifyAll();
        return version;
    }

    /** Removes a viewer. */
    synchronized void leave() {
        viewers--;
    }

    /** Waits for a state with another number; null when the page is closed. */
    synchronized State after(long known) throws InterruptedException {
        while (version == known && !closed) {
            wait();
        }
        return closed ? null : new State(version, newest);
    }

    /**
     * A state.
     *
     * @param version the state's number
     * @param event as a server-sent event
     */
    record State(long version, byte[] event) {
        byte[] json() {
            return Arrays.copyOfRange(event, PREFIX.length(), event.length - 1);
        }
    }

    synchronized void close() {
        closed = true;
        notifyAll();
    }

    @Override
    public void run() {
        long publishedAt = 0;
        try {
            while (awaitViewer()) {
                long begun = System.nanoTime();
                boolean changed = look(begun);
                String state = text(begun);
                long took = (System.nanoTime() - begun) / 1_000_000;
                if (isHurried() || changed || begun - publishedAt >= BEAT_NANOS) {
                    publish(state);
                    publishedAt = begun;
                }
                workers.look();
                Thread.sleep(Math.max(PERIOD_MILLIS, Math.min(LONGEST_REST_MILLIS, took * REST)));
            }
        } catch (InterruptedException e) {
            close();
        }
    }

    private synchronized boolean isHurried() {
        boolean was = hurry;
        hurry = false;
        return was;
    }

    private boolean awaitViewer() throws InterruptedException {
        synchronized (this) {
            if (viewers > 0 || closed) {
                return !closed;
            }
            while (viewers == 0 && !closed) {
                wait(LONGEST_REST_MILLIS);
                workers.look();
            }
        }
        // A state handed over since the last viewer left can be old.
        watches.forEach(NetWatch::ask);
        for (int i = 0; i < PATIENT_PERIODS && !watches.stream().allMatch(NetWatch::isThere); i++) {
            Thread.sleep(PERIOD_MILLIS);
        }
        return true;
    }

    /** Takes the state handed over, and asks for the next; true if more than the time has changed. */
    private boolean look(long now) {
        boolean changed = false;
        for (int i = 0; i < watches.size(); i++) {
            NetWatch watch = watches.get(i);
            if (watch.isThere()) {
                List<RunningNet> nets = watch.nets();
                for (int n = 0; n < nets.size(); n++) {
                    String rest = Json.state(nets.get(n), watch.state(n), watch.note());
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
        List<String> nets = new ArrayList<>();
        for (int i = 0; i < watches.size(); i++) {
            String age = seen[i] == 0 ? "null" : Long.toString((now - seen[i]) / 1_000_000);
            for (int n = 0; n < rests[i].length; n++) {
                nets.add(rests[i][n] == null ? "null" : "{\"age\":" + age + "," + moments[i][n] + "," + rests[i][n] + "}");
            }
        }
        return "{\"run\":\"" + run + "\",\"nets\":[" + String.join(",", nets) + "]}";
    }

    private synchronized void publish(String state) {
        newest = (PREFIX + state + "\n\n").getBytes(StandardCharsets.UTF_8);
        version++;
        notifyAll();
    }
}
