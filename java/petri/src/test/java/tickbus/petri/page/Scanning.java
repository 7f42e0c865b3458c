package tickbus.petri.page;

import java.util.List;
import java.util.concurrent.locks.LockSupport;
import java.util.concurrent.locks.ReentrantLock;
import tickbus.petri.net.Delay;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Conjunction;
import tickbus.petri.run.Coordinator;
import tickbus.petri.run.Inputs;
import tickbus.petri.run.NetWatch;

/** A small press that a separate thread scans every 2 ms, and whose inputs a test sets. */
final class Scanning implements AutoCloseable {
    static final PetriNet NET = PetriNet.named("press <1>").place("idle", 1).place("moving").place("pressing").place("made", 7)
        .transition("start").input("idle").output("moving")
        .transition("arrive").input("moving").output("pressing").delay(Delay.fixed(2_000_000))
        .transition("release").input("pressing").output("idle", "made")
        .build();

    final Coordinator press;
    final NetWatch watch;
    private final Thread thread;
    private final ReentrantLock still = new ReentrantLock();
    private volatile double part;
    private volatile double guard = 1;
    private volatile boolean over;
    private volatile long scans;

    /** Both signals must be on; {@code failed} names the one that is not. */
    private static final class Start implements Conjunction {
        private int failed = -1;

        @Override
        public List<Part> parts() {
            return List.of(new Part("guard on", "guard", null, null), new Part("part there on", "part there", null, null),
                new Part("press <1>: idle marked", null, "press <1>", "idle"));
        }

        @Override
        public int failed() {
            return failed;
        }

        @Override
        public boolean test(Inputs inputs) {
            failed = !inputs.isOn("guard") ? 0 : inputs.isOn("part there") ? -1 : 1;
            return failed < 0;
        }
    }

    Scanning() {
        press = Coordinator.of(NET).inputs("part there", "guard")
            .reader(values -> {
                values[0] = part;
                values[1] = guard;
            })
            .output("motor", 0)
            .when("start", new Start())
            .when("release", in -> in.isOn("part there"))
            .onEntry("moving", (in, out) -> out.set("motor", 1.5))
            .onExit("moving", (in, out) -> out.set("motor", 0))
            .build();
        watch = NetWatch.of(press);
        long start = System.nanoTime();
        thread = new Thread(() -> {
            while (!over) {
                still.lock();
                try {
                    press.scan(System.nanoTime() - start);
                    scans++;
                } finally {
                    still.unlock();
                }
                LockSupport.parkNanos(2_000_000);
            }
        }, "scans");
        thread.start();
    }

    void part(boolean there) {
        part = there ? 1 : 0;
    }

    void guard(boolean closed) {
        guard = closed ? 1 : 0;
    }

    long scans() {
        return scans;
    }

    /** Stops scanning until {@link #goOn}, called by the same thread. */
    void standStill() {
        still.lock();
    }

    void goOn() {
        still.unlock();
    }

    @Override
    public void close() {
        over = true;
        // A test that fails while the scans stand still must fail, and not wait for them.
        while (still.isHeldByCurrentThread()) {
            still.unlock();
        }
        try {
            thread.join();
        } catch (InterruptedException e) {
            Thread.currentThread().interrupt();
        }
    }
}
