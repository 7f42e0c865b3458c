package tickbus.petri.run;

import java.util.List;
import java.util.concurrent.atomic.AtomicInteger;

/**
 * Passes the state of running nets from the thread that runs them to a thread that shows them. Neither waits for the other:
 * the viewer thread asks, and at the end of its scan the running thread hands over a copy, which belongs to the viewer
 * thread until it asks again. While nobody asks, a scan reads one flag. Handing over allocates nothing.
 *
 * <p>A {@link Coordinator} and a {@link Stepper} hand over automatically. A program that runs several nets in turn, and
 * wants them shown as of one moment, calls {@link #offer} after the last one.
 */
public final class NetWatch implements AutoCloseable {
    private static final int FREE = 0;
    private static final int ASKED = 1;
    private static final int FILLED = 2;

    private final List<RunningNet> nets;
    private final List<NetState> states;
    private final AtomicInteger turn = new AtomicInteger();
    private final Coordinator own;
    private String note = "";

    private NetWatch(List<? extends RunningNet> nets, Coordinator own) {
        this.nets = List.copyOf(nets);
        this.own = own;
        states = this.nets.stream().map(NetState::new).toList();
    }

    /**
     * Watches a coordinator, which hands over at the end of each scan; throws an {@link IllegalStateException} if it is
     * watched already. For any thread, at any time.
     */
    public static NetWatch of(Coordinator net) {
        NetWatch watch = new NetWatch(List.of(net), net);
        net.attach(watch);
        return watch;
    }

    /** Watches nets that one thread runs; that thread calls {@link #offer}. */
    public static NetWatch of(List<? extends RunningNet> nets) {
        return new NetWatch(nets, null);
    }

    /** The nets. */
    public List<RunningNet> nets() {
        return nets;
    }

    /** For the thread that runs the nets: hands over their state if it was requested. */
    public void offer() {
        offer("");
    }

    /** Like {@link #offer()}, with a note about all nets, such as that the line is stale; empty for no note. */
    public void offer(String aboutAll) {
        if (turn.getAcquire() != ASKED) {
            return;
        }
        note = aboutAll;
        for (int i = 0; i < states.size(); i++) {
            nets.get(i).copyTo(states.get(i));
        }
        turn.setRelease(FILLED);
    }

    /** For the viewer thread: asks for a state. The last one must not be read any more. */
    public void ask() {
        turn.set(ASKED);
    }

    /** For the viewer thread: true if the requested state is there. */
    public boolean isThere() {
        return turn.getAcquire() == FILLED;
    }

    /** The state of the net with this index; only while {@link #isThere}. */
    public NetState state(int index) {
        return states.get(index);
    }

    /** The note about all nets; only while {@link #isThere}. */
    public String note() {
        return note;
    }

    /** Releases a coordinator, so that another watch can watch it. */
    @Override
    public void close() {
        if (own != null) {
            own.detach(this);
        }
    }
}
