package tickbus.petri;

import java.util.List;
import java.util.concurrent.atomic.AtomicInteger;

/**
 * Hands the state of running nets from the thread that runs them to one that shows them. Neither waits for the other: the
 * one that shows asks, the one that runs hands over a copy at the end of its scan, and then the copies belong to the one that
 * shows until it asks again. While nobody asks, a scan reads one flag. Handing over allocates nothing.
 *
 * <p>A {@link Coordinator} and a {@link Stepper} hand over by themselves. Whoever runs several in turn, and wants them shown
 * as of one moment, calls {@link #offer} after the last one.
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
     * Watches a coordinator, which hands over at the end of each scan; an {@link IllegalStateException} if it is watched
     * already. For any thread, at any time.
     */
    public static NetWatch of(Coordinator net) {
        NetWatch watch = new NetWatch(List.of(net), net);
        net.attach(watch);
        return watch;
    }

    /** Watches nets that one thread runs, which calls {@link #offer}. */
    public static NetWatch of(List<? extends RunningNet> nets) {
        return new NetWatch(nets, null);
    }

    /** The nets. */
    public List<RunningNet> nets() {
        return nets;
    }

    /** For the thread that runs the nets: hands over their state if somebody has asked for it. */
    public void offer() {
        offer("");
    }

    /** Like {@link #offer()}, with what is to be said of all nets, such as that the line is stale; empty if nothing is. */
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

    /** For the thread that shows: asks for a state. The last one must not be read any more. */
    public void ask() {
        turn.set(ASKED);
    }

    /** For the thread that shows: whether the state that was asked for is there. */
    public boolean isThere() {
        return turn.getAcquire() == FILLED;
    }

    /** The state of the net with this index; only while {@link #isThere}. */
    public NetState state(int index) {
        return states.get(index);
    }

    /** What was said of all nets; only while {@link #isThere}. */
    public String note() {
        return note;
    }

    /** Lets a coordinator go, so that another one may watch it. */
    @Override
    public void close() {
        if (own != null) {
            own.detach(this);
        }
    }
}
