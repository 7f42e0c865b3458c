import java.nio.file.Path;
import java.util.PriorityQueue;
import java.util.concurrent.ExecutorService;
import java.util.concurrent.Executors;
import tickbus.Signal;
import tickbus.Tickbus;

/**
 * A simulation engine that jumps from event to event, each on any free thread: the two differences from a simulation with a
 * fixed tick.
 *
 * <p>Time: the engine passes its own, and the PLC program, hosted on simulation time, runs up to it. With a PLC in real time
 * such an engine must wait for the clock between events; free-running at full speed it would meet only a few scans of the
 * PLC.
 *
 * <p>Threads: one thread ticks a driver. An event releases it when it is over, so that the next one can run on another
 * thread.
 *
 * <p>Run it with {@code java -cp java/tickbus/target/tickbus-0.1.0.jar examples/event-engine/EventEngine.java} in a
 * checkout; the zip's README names its jar.
 */
class EventEngine {
    private record Event(long nanos, Runnable action) { }

    private static final long MILLISECOND = 1_000_000;
    private static final long END = 5_000 * MILLISECOND;

    private final PriorityQueue<Event> events = new PriorityQueue<>((a, b) -> Long.compare(a.nanos, b.nanos));
    private final Tickbus plc;
    private final Signal valve;
    private final Signal low;
    private long now;
    private double level = 100;
    private long switched;

    private EventEngine(Tickbus plc) {
        this.plc = plc;
        valve = plc.signal("Valve");
        low = plc.signal("Level low");
    }

    /** An event: reads the PLC's outputs, runs the model, sets the PLC's inputs. */
    private void fill() {
        try {
            plc.receive(now);
            switched += valve.edges();
            level += valve.getBoolean() ? 7 : -3;
            low.setBoolean(level < 100);
            plc.send();
        } finally {
            // The next event may run on another thread.
            plc.releaseThread();
        }
        // Events need no fixed interval.
        long next = now + (level < 100 ? 10 : 25) * MILLISECOND;
        events.add(new Event(next, this::fill));
    }

    private void run() throws Exception {
        // Three threads in turn, like an engine with its own pool.
        ExecutorService[] threads = {
            Executors.newSingleThreadExecutor(), Executors.newSingleThreadExecutor(), Executors.newSingleThreadExecutor()
        };
        try {
            events.add(new Event(0, this::fill));
            for (int turn = 0; now < END; turn++) {
                Event event = events.remove();
                now = event.nanos;
                threads[turn % threads.length].submit(event.action).get();
            }
        } finally {
            for (ExecutorService thread : threads) {
                thread.shutdown();
            }
        }
        System.out.printf("engine: ok simulated_ms=%d valve_switched=%d level=%.0f%n", now / MILLISECOND, switched, level);
        if (switched < 10) {
            throw new IllegalStateException("the PLC has hardly done anything");
        }
    }

    public static void main(String[] args) throws Exception {
        Path config = Path.of(args.length > 0 ? args[0] : "examples/event-engine/engine.cfg");
        try (Tickbus plc = Tickbus.open(config)) {
            new EventEngine(plc).run();
        }
    }
}
