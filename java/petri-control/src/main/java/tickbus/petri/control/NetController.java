package tickbus.petri.control;

import java.io.IOException;
import java.nio.file.Path;
import java.time.Duration;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.concurrent.CountDownLatch;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.locks.LockSupport;
import java.util.function.BooleanSupplier;
import tickbus.Signal;
import tickbus.Status;
import tickbus.Tickbus;
import tickbus.petri.net.Marking;
import tickbus.petri.run.Action;
import tickbus.petri.run.Coordinator;
import tickbus.petri.run.CoordinatorBuilder;
import tickbus.petri.run.NetWatch;
import tickbus.petri.run.Stop;

/**
 * Runs nets as the PLC of a driver: reads {@code %I}, fires, writes {@code %Q}, over any bus that has the role {@code
 * controller}.
 *
 * <p>A {@link #scan} is one exchange of the driver. It latches the inputs, lets one net after the other fire until it is
 * quiet, and sends the outputs. In the steady state it allocates nothing. A net whose condition or action throws stops for
 * good: its outputs get the fail-safe values of the driver.cfg, and {@link #stops} names the transition or place. The other
 * nets continue, and see the last marking of the stopped net.
 *
 * <p>While the line is stale no net is scanned: values that nobody sent must not fire anything. A controller belongs to the
 * driver's ticking thread. The caller closes the driver, unless {@link #run} ends by an exception or with the JVM.
 */
public final class NetController {
    private static final long NANOS_TO_END = 1_000_000_000;
    private static final String WAITING = "the nets wait until their markings are found";
    private static final String STALE = "the line is stale: no net is scanned";

    private final Tickbus bus;
    private final Latch latch;
    private final Map<String, Coordinator> coordinators = new LinkedHashMap<>();
    private final Coordinator[] order;
    private final NetWatch watch;
    private long lastNanos;
    /** The input that stops the nets' clock, -1 for no input; and for how long the clock has stood still. */
    private int stopsClock = -1;
    private long stoodNanos;
    private final Safety safety;
    private final SavedMarkings saved;
    /** Asked in the first scan with fresh inputs; null if that is over. */
    private BooleanSupplier begins;
    private boolean waiting;
    /** True if the JVM is ending. */
    private volatile boolean ending;
    private long scans;
    private long staleScans;

    private NetController(Tickbus bus, List<BoundNet> nets) {
        this.bus = bus;
        Map<String, BoundNet> byName = Check.nets(bus, nets);
        latch = new Latch(bus);
        List<Conditions> conditions = new ArrayList<>();
        for (BoundNet one : nets) {
            CoordinatorBuilder builder = Coordinator.of(one.net).seed(one.seed).listener(one.listener)
                .inputs(latch.names.toArray(String[]::new))
                .reader(values -> System.arraycopy(latch.now, 0, values, 0, values.length));
            one.conditions.forEach((transition, terms) -> {
                Conditions condition = new Conditions(one.net.name(), terms, latch, byName::get, coordinators);
                conditions.add(condition);
                terms.stream().filter(term -> term.kind() == Term.Kind.MARKED_FOR && term.name().equals(one.net.name()))
                    .forEach(term -> builder.whenMarked(transition, term.place(), Duration.ofNanos((long) term.value())));
                if (!one.keepsEdges && terms.stream().anyMatch(term -> term.kind().isEdge())) {
                    builder.whenEdge(transition, condition);
                } else {
                    builder.when(transition, condition);
                }
            });
            if (one.exactDelays) {
                builder.exactDelays();
            }
            List<String> outputs = List.copyOf(one.outputs());
            Signal[] signals = outputs.stream().map(bus::signal).toArray(Signal[]::new);
            for (Signal signal : signals) {
                // Before the first tick, a signal that this end writes has its fail-safe value.
                builder.output(signal.name(), signal.get());
            }
            Held held = new Held(one, outputs);
            builder.writer(values -> {
                held.update(values);
                for (int i = 0; i < signals.length; i++) {
                    signals[i].set(values[i]);
                }
            });
            actions(one, outputs, builder);
            Coordinator coordinator = builder.build();
            held.coordinator = coordinator;
            coordinators.put(one.net.name(), coordinator);
        }
        conditions.forEach(Conditions::connect);
        order = coordinators.values().toArray(Coordinator[]::new);
        watch = NetWatch.of(List.of(order));
        saved = new SavedMarkings(order);
        safety = new Safety(latch, nets.stream().flatMap(one -> one.outputs().stream()).map(bus::signal).toList());
    }

    /**
     * Binds nets to a driver that has not ticked yet.
     *
     * @param bus open, with {@code role = "controller"}
     * @param nets in the order in which they are scanned
     * @throws BindingException with every mistake: unknown signals with the nearest names, signals of the wrong
     *     direction, conditions that are bound twice, outputs that two nets write
     */
    public static NetController of(Tickbus bus, BoundNet... nets) {
        return new NetController(bus, List.of(nets));
    }

    /**
     * Stops the nets' clock while an input is on, such as that of an emergency stop, so nothing is late afterwards. Delays,
     * the times of firings and a page use the time of that clock.
     *
     * @param input not 0 while the clock is to stand still
     * @return this
     * @throws IllegalArgumentException if there is no such input
     */
    public NetController stopClockWhile(String input) {
        stopsClock = input(input);
        return this;
    }

    /**
     * Sends the fail-safe values of the driver.cfg while an input is on, such as that of an emergency stop, and afterwards
     * until {@code rearm} turns on: releasing the emergency stop starts nothing. Meanwhile no net is scanned, their clock
     * stands still, and all edges are ignored, also that of {@code rearm}. Then the nets continue with their markings.
     *
     * @param input not 0 while the outputs are to be fail-safe
     * @param rearm the input that must turn on after that
     * @return this
     * @throws IllegalArgumentException if there is no such input
     * @throws IllegalStateException if an input was named before
     */
    public NetController failSafeWhile(String input, String rearm) {
        safety.bind(input(input), true, input, input(rearm), rearm);
        return this;
    }

    /** As {@link #failSafeWhile}, while the input is off: for a closed circuit, where a broken wire also stops the machine. */
    public NetController failSafeUnless(String input, String rearm) {
        safety.bind(input(input), false, input, input(rearm), rearm);
        return this;
    }

    private int input(String name) {
        if (bus.signal(name).isWritten()) {
            throw new IllegalArgumentException("signal '" + name + "' is an output; expected an input");
        }
        return latch.names.indexOf(name);
    }

    /**
     * Saves the markings of all nets in a file, in the first scan and then in each scan that changes them, before its
     * outputs are sent. Each save replaces the whole file. The file survives the end of the process; a power failure at that
     * moment can lose it. A scan that saves allocates. A scan that cannot save throws an {@link java.io.UncheckedIOException}.
     *
     * @return this
     */
    public NetController keepMarkings(Path in) {
        saved.keep(in);
        return this;
    }

    /**
     * Numbers the saved markings, in the file and on an output that the machine keeps. A control that resumes compares {@link
     * #markingNumber} with the number that the machine has: a marking that was saved earlier than the last one has another number.
     * The file then also has whether an emergency stop waits for Rearm, and a control that resumes waits for it, too. Call this
     * before {@link #resume}.
     *
     * @param output of at least 32 bits, written by no net; the machine must keep its last value that is not 0
     * @param first the number before the first save, from 1, such as the seconds of a clock; {@link #resume} replaces it
     * @return this
     * @throws IllegalArgumentException if there is no such output, or if {@code first} is below 1
     */
    public NetController numberMarkings(String output, int first) {
        Signal signal = bus.signal(output);
        if (!signal.isWritten()) {
            throw new IllegalArgumentException("signal '" + output + "' is an input; expected an output");
        }
        if (first < 1) {
            throw new IllegalArgumentException("the first number is " + first + "; expected 1 or more");
        }
        saved.number(signal, first);
        return this;
    }

    /** The number of the markings saved or resumed last; without {@link #numberMarkings} 0. */
    public int markingNumber() {
        return saved.number();
    }

    /**
     * Asks, in the first scan with fresh inputs, whether the nets may begin with their markings. If not, no net is scanned and
     * the outputs keep their fail-safe values until {@link #begin}.
     *
     * @param fits can use the values of the driver's signals
     * @return this
     */
    public NetController beginIf(BooleanSupplier fits) {
        begins = fits;
        return this;
    }

    /** True while the nets wait for {@link #begin}, because {@link #beginIf} did not let them begin. */
    public boolean isWaiting() {
        return waiting;
    }

    /** Lets nets that wait begin with these markings, and the other nets with those that they have. */
    public void begin(List<Marking> markings) {
        for (Marking one : markings) {
            coordinator(one.net().name()).resume(one);
        }
        waiting = false;
    }

    /**
     * Begins with the markings that {@link #keepMarkings} saved, in place of the initial ones; only before the first scan.
     * The entry actions of marked places run and delays begin in the first scan. The caller must know that the machine is
     * still in the saved state.
     *
     * @return this
     * @throws IOException if the file cannot be read
     * @throws tickbus.petri.net.NetException if it is not of these nets
     */
    public NetController resume(Path from) throws IOException {
        saved.read(from);
        if (saved.isStopped()) {
            safety.hold();
        }
        return this;
    }

    /** Outputs that are on exactly while a place is marked. */
    private static final class Held {
        private final int[] outputs;
        private final int[] place;
        private final int[] output;
        private final double[] value;
        private Coordinator coordinator;

        Held(BoundNet one, List<String> names) {
            List<Step> steps = one.steps.stream()
                .filter(step -> step.moment() == Step.Moment.DURING && step.output() != null).toList();
            place = steps.stream().mapToInt(step -> one.net.place(step.node()).index()).toArray();
            output = steps.stream().mapToInt(step -> names.indexOf(step.output())).toArray();
            value = steps.stream().mapToDouble(Step::value).toArray();
            outputs = Arrays.stream(output).distinct().toArray();
        }

        /** Computes the outputs, unless the net has stopped. */
        void update(double[] values) {
            if (coordinator.stop().isPresent()) {
                return;
            }
            for (int one : outputs) {
                values[one] = 0;
            }
            for (int i = 0; i < place.length; i++) {
                if (coordinator.tokens(place[i]) > 0) {
                    values[output[i]] = value[i];
                }
            }
        }
    }

    private static void actions(BoundNet one, List<String> outputs, CoordinatorBuilder builder) {
        Map<String, List<Action>> entry = new LinkedHashMap<>();
        Map<String, List<Action>> exit = new LinkedHashMap<>();
        Map<String, List<Action>> during = new LinkedHashMap<>();
        Map<String, List<Action>> firing = new LinkedHashMap<>();
        for (Step step : one.steps) {
            int output = step.output() == null ? -1 : outputs.indexOf(step.output());
            double value = step.value();
            Action action = step.code() != null ? step.code() : (in, out) -> out.set(output, value);
            switch (step.moment()) {
                case ENTRY -> add(entry, step.node(), action);
                case EXIT -> add(exit, step.node(), action);
                case FIRING -> add(firing, step.node(), action);
                case DURING -> {
                    if (step.code() != null) {
                        add(during, step.node(), action);
                    }
                }
            }
        }
        entry.forEach((place, list) -> builder.onEntry(place, all(list)));
        exit.forEach((place, list) -> builder.onExit(place, all(list)));
        during.forEach((place, list) -> builder.during(place, all(list)));
        firing.forEach((transition, list) -> builder.onFiring(transition, all(list)));
    }

    private static void add(Map<String, List<Action>> to, String node, Action action) {
        to.computeIfAbsent(node, key -> new ArrayList<>()).add(action);
    }

    private static Action all(List<Action> list) {
        Action[] actions = list.toArray(Action[]::new);
        return actions.length == 1 ? actions[0] : (in, out) -> {
            for (Action action : actions) {
                action.run(in, out);
            }
        };
    }

    /**
     * One scan, which is one exchange of the driver.
     *
     * @param nanos the time; also the driver's simulation time. If it goes back, all nets stop
     * @return how many transitions fired; 0 if the line is stale
     * @throws tickbus.FieldbusException as {@link Tickbus#exchange()}
     */
    public int scan(long nanos) {
        // A driver in simulation time would fail for good if the clock goes back, and could not send the fail-safe values.
        long latest = scans == 0 ? nanos : Math.max(nanos, lastNanos);
        int status = bus.receive(latest);
        int fired = 0;
        scans++;
        boolean stale = status == Status.STALE.code();
        if (stale) {
            staleScans++;
        } else {
            latch.take();
        }
        boolean held = stale ? safety.isHolding() : safety.holds();
        if (scans > 1 && (held || !stale && stopsClock >= 0 && latch.now[stopsClock] != 0)) {
            stoodNanos += latest - lastNanos;
        }
        if (!stale && !held) {
            if (begins != null) {
                waiting = !begins.getAsBoolean();
                begins = null;
            }
            if (!waiting) {
                for (Coordinator coordinator : order) {
                    fired += coordinator.scan(nanos - stoodNanos);
                }
                saved.stopped(false);
                saved.save(fired);
            }
        } else if (!stale && begins == null && !waiting) {
            saved.stopped(true);
            saved.save(0);
        }
        bus.send();
        watch.offer(stale ? STALE : held ? safety.note() : waiting ? WAITING : "");
        lastNanos = latest;
        return fired;
    }

    /**
     * Scans in real time, until {@code more} returns false or the thread is interrupted. The time continues from the last
     * scan, or begins at 0; the time between that scan and this call does not count. If something throws, or the JVM ends,
     * the driver is closed, so that its outputs do not stay as they are.
     *
     * @param periodNanos from one scan to the next, above 0; a scan that is late shifts those after it
     * @param more asked once before each scan, when it is due
     */
    public void run(long periodNanos, BooleanSupplier more) {
        if (periodNanos <= 0) {
            throw new IllegalArgumentException("a period of " + periodNanos + " ns; expected more than 0");
        }
        CountDownLatch ended = new CountDownLatch(1);
        Thread running = Thread.currentThread();
        Thread hook = new Thread(() -> end(running, ended), "end of the nets");
        try {
            Runtime.getRuntime().addShutdownHook(hook);
        } catch (IllegalStateException endsAlready) {
            ending = true;
        }
        try {
            repeat(periodNanos, more);
        } catch (RuntimeException | Error thrown) {
            bus.close();
            throw thrown;
        } finally {
            ended.countDown();
            try {
                Runtime.getRuntime().removeShutdownHook(hook);
            } catch (IllegalStateException itRuns) {
                // The hook closes the driver.
            }
        }
    }

    private void repeat(long periodNanos, BooleanSupplier more) {
        long start = System.nanoTime() - lastNanos;
        long due = lastNanos;
        while (waitUntil(start + due) && more.getAsBoolean()) {
            long now = System.nanoTime() - start;
            scan(now);
            due = Math.max(due + periodNanos, now);
        }
    }

    /** Ends a run when the JVM ends, and closes the driver, even while an action hangs. */
    void end(Thread running, CountDownLatch ended) {
        ending = true;
        LockSupport.unpark(running);
        try {
            ended.await(NANOS_TO_END, TimeUnit.NANOSECONDS);
        } catch (InterruptedException e) {
            Thread.currentThread().interrupt();
        }
        bus.close();
    }

    /** True when the time has come; false if the thread was interrupted, or the JVM is ending. */
    private boolean waitUntil(long nanoTime) {
        while (!ending && !Thread.currentThread().isInterrupted()) {
            long wait = nanoTime - System.nanoTime();
            if (wait <= 0) {
                return true;
            }
            LockSupport.parkNanos(wait);
        }
        return false;
    }

    /** The coordinator of a net, for its marking; an {@link IllegalArgumentException} if there is no such net. */
    public Coordinator coordinator(String net) {
        Coordinator found = coordinators.get(net);
        if (found == null) {
            throw new IllegalArgumentException("there is no net '" + net + "'; there are " + coordinators.keySet());
        }
        return found;
    }

    /**
     * All nets as of one scan, for a page ({@link tickbus.petri.page.NetPage}) or a view of your own, with the values of its
     * signals beside each condition. A controller has one watch, so it serves one page, which can have many viewers. For any
     * thread.
     */
    public NetWatch watch() {
        return watch;
    }

    /** Why nets stopped, in the order of the nets; empty while all run. */
    public List<Stop> stops() {
        return coordinators.values().stream().flatMap(one -> one.stop().stream()).toList();
    }

    /** True if a net has stopped; allocates nothing. */
    public boolean stopped() {
        for (Coordinator coordinator : order) {
            if (coordinator.stop().isPresent()) {
                return true;
            }
        }
        return false;
    }

    /** The number of scans so far, including stale ones. */
    public long scans() {
        return scans;
    }

    /** Scans in which the line was stale, and no net was scanned. */
    public long staleScans() {
        return staleScans;
    }
}
