package tickbus.petri.analysis;

import java.time.Duration;
import java.util.BitSet;
import tickbus.petri.net.Effects;
import tickbus.petri.net.PetriNet;

/**
 * How far an exploration of the reachable markings goes, and what it keeps. An exploration that reaches one of its limits ends
 * with what it has found until then: {@link Reachability#gaveUpBecause}.
 */
public final class Exploration {
    /** The clock is read once for so many markings, and once for so many firings. */
    private static final int CLOCK = 256;

    private final PetriNet net;
    private int markings = MarkingStore.MOST;
    private long memory = Long.MAX_VALUE;
    private long nanos = Long.MAX_VALUE;
    private boolean firings = true;
    private boolean reduced;

    private MarkingStore store;
    private Walk walk;
    private Ints firstEdge;
    private Ints targets;
    private Ints labels;
    private Ints deadlocks;
    private BitSet fired;
    private long edges;
    private long start;

    private Exploration(PetriNet net) {
        this.net = net;
    }

    /** An exploration of all markings, and their firings; limited by the heap alone, of which it takes three quarters. */
    public static Exploration of(PetriNet net) {
        return new Exploration(net);
    }

    /** Explores at most this many markings, 1 or more. */
    public Exploration markings(int most) {
        if (most < 1) {
            throw new IllegalArgumentException("a limit of " + most + " markings; expected 1 or more");
        }
        markings = Math.min(most, MarkingStore.MOST);
        return this;
    }

    /** Keeps markings and firings in at most this many bytes; the first 64 KB, or the first marking, are always there. */
    public Exploration memory(long bytes) {
        if (bytes < 1) {
            throw new IllegalArgumentException("a limit of " + bytes + " bytes; expected 1 or more");
        }
        memory = bytes;
        return this;
    }

    /** Ends after this time; more than 0. */
    public Exploration time(Duration most) {
        if (most.isNegative() || most.isZero()) {
            throw new IllegalArgumentException("a limit of " + most + "; expected more than 0");
        }
        nanos = most.compareTo(Duration.ofNanos(Long.MAX_VALUE)) >= 0 ? Long.MAX_VALUE : most.toNanos();
        return this;
    }

    /**
     * Keeps no firings, which take most of the memory. Liveness, home states and reversibility are {@link Verdict#UNKNOWN}
     * then.
     */
    public Exploration withoutFirings() {
        firings = false;
        return this;
    }

    /**
     * Looks for deadlocks alone: in each marking fires only the transitions of a stubborn set. Finds exactly the deadlocks of
     * the whole exploration, mostly through far fewer markings. Answers to other questions are {@link Verdict#UNKNOWN}, unless
     * one of the markings shows them. A sequence that leads to a deadlock can be longer than necessary.
     */
    public Exploration onlyForDeadlocks() {
        reduced = true;
        return this;
    }

    /** Explores. */
    public Reachability run() {
        store = new MarkingStore(net);
        walk = new Walk(net, store);
        firstEdge = new Ints();
        targets = new Ints();
        labels = new Ints();
        deadlocks = new Ints();
        fired = new BitSet();
        edges = 0;
        start = System.nanoTime();
        String gaveUp;
        try {
            gaveUp = explore();
        } catch (OutOfMemoryError full) {
            gaveUp = "the heap is full";
        }
        return new Reachability(net, store, firstEdge, targets, labels, deadlocks, walk.bounds, fired, edges, firings, reduced,
            gaveUp);
    }

    private boolean hasRoom(long more) {
        long bytes = store.bytes() + firstEdge.bytes() + targets.bytes() + labels.bytes() + deadlocks.bytes() + more;
        return bytes <= memory && Memory.has(bytes);
    }

    private boolean isLate() {
        return nanos != Long.MAX_VALUE && System.nanoTime() - start >= nanos;
    }

    private String late() {
        return "the limit of " + Duration.ofNanos(nanos);
    }

    private String full() {
        return Memory.has(memory) ? "the limit of " + memory + " bytes" : "three quarters of the heap are used";
    }

    /** Returns why it ended early; null if it did not. */
    private String explore() {
        int[] initial = net.initialMarking().toArray();
        long[] packed = new long[store.words];
        store.pack(initial, packed);
        long hash = store.hash(packed);
        store.find(packed, hash);
        store.append(packed, hash);
        Stubborn stubborn = reduced ? new Stubborn(net, walk, this::isLate) : null;
        for (int number = 0; number < store.size(); number++) {
            if (number % CLOCK == 0 && isLate()) {
                return late();
            }
            walk.moveTo(number);
            long[] choice = reduced ? stubborn.set() : walk.enabled;
            // A search for a stubborn set that ran out of time has no set.
            if (reduced && isLate()) {
                return late();
            }
            if (firings) {
                firstEdge.add(targets.size());
            }
            boolean dead = true;
            for (int w = 0; w < choice.length; w++) {
                for (long bits = choice[w]; bits != 0; bits &= bits - 1) {
                    dead = false;
                    String gaveUp = fire(64 * w + Long.numberOfTrailingZeros(bits));
                    if (gaveUp != null) {
                        return gaveUp;
                    }
                }
            }
            if (dead) {
                deadlocks.add(number);
            }
        }
        if (firings) {
            firstEdge.add(targets.size());
        }
        return null;
    }

    private String fire(int t) {
        if (edges % CLOCK == CLOCK - 1 && isLate()) {
            return late();
        }
        for (int p = walk.fire(t); p >= 0; p = walk.fire(t)) {
            long count = walk.after(t, p);
            if (count > Integer.MAX_VALUE) {
                return "place " + net.place(p).name() + " has more tokens than can be counted";
            }
            if (!hasRoom(store.bytesToWiden() + walk.bytesToRepack())) {
                return full();
            }
            store.widen(p, (int) count);
            walk.repack();
        }
        fired.set(t);
        int target = store.find(walk.next, walk.nextHash);
        long more = (target < 0 ? store.bytesToGrow() : 0) + targets.bytesToGrow() + labels.bytesToGrow()
            + firstEdge.bytesToGrow() + deadlocks.bytesToGrow();
        if (more > 0 && !hasRoom(more)) {
            return full();
        }
        if (target < 0) {
            if (store.size() == markings) {
                return "the limit of " + markings + " markings";
            }
            target = store.append(walk.next, walk.nextHash);
        }
        edges++;
        if (firings) {
            if (targets.size() == Ints.MOST) {
                return "more firings than fit into an array";
            }
            targets.add(target);
            labels.add(t);
        }
        return null;
    }
}
