package tickbus.petri.control;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.concurrent.locks.LockSupport;
import java.util.function.BooleanSupplier;
import tickbus.Signal;
import tickbus.Status;
import tickbus.Tickbus;
import tickbus.petri.Action;
import tickbus.petri.Coordinator;
import tickbus.petri.CoordinatorBuilder;
import tickbus.petri.NetWatch;
import tickbus.petri.Stop;

/**
 * Nets as the PLC of a driver: reads {@code %I}, fires, writes {@code %Q}, over any bus that has the role
 * {@code controller}.
 *
 * <p>A {@link #scan} is one exchange of the driver. It latches the inputs, lets one net after the other fire until it
 * is quiet, and sends the outputs. In the steady state it allocates nothing. A net whose condition or action throws stops
 * for good: its outputs have the fail-safe values of the driver.cfg, and {@link #stops} says which transition or place it
 * was. The other nets go on, and see its last marking.
 *
 * <p>While the line is stale no net is scanned: values that nobody sent must not fire anything. Belongs to the driver's
 * ticking thread; the driver stays the caller's, who closes it.
 */
public final class NetController {
    private static final String STALE = "the line is stale: no net is scanned";

    private final Tickbus bus;
    private final Latch latch;
    private final Map<String, Coordinator> coordinators = new LinkedHashMap<>();
    private final Coordinator[] order;
    private final NetWatch watch;
    private long lastNanos;
    /** The input that stops the nets' clock; -1 if none does. For how long it has. */
    private int stopsClock = -1;
    private long stoodNanos;
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
                Conditions condition = new Conditions(terms, latch, byName::get, coordinators);
                conditions.add(condition);
                builder.when(transition, condition);
            });
            List<String> outputs = List.copyOf(one.outputs());
            Signal[] signals = outputs.stream().map(bus::signal).toArray(Signal[]::new);
            for (Signal signal : signals) {
                // Before the first tick a signal that this end writes has its fail-safe value.
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
     * Lets the nets' clock stand still while an input is on, such as that of an emergency stop: what stood still then is not
     * late afterwards. Delays, the times of firings and a page have the time of that clock.
     *
     * @param input not 0 while the clock is to stand still
     * @return this
     * @throws IllegalArgumentException if there is no such input
     */
    public NetController stopClockWhile(String input) {
        if (bus.signal(input).isWritten()) {
            throw new IllegalArgumentException("signal '" + input + "' is an output; the clock stands still while an input is on");
        }
        stopsClock = latch.names.indexOf(input);
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

        /** Computes them, unless the net has stopped. */
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
     * @param nanos the time, which must not go back; also the driver's simulation time
     * @return how many transitions fired; 0 if the line is stale
     * @throws tickbus.FieldbusException as {@link Tickbus#exchange()}
     */
    public int scan(long nanos) {
        int status = bus.receive(nanos);
        int fired = 0;
        scans++;
        if (status == Status.STALE.code()) {
            staleScans++;
        } else {
            latch.take();
            if (stopsClock >= 0 && latch.now[stopsClock] != 0 && scans > 1) {
                stoodNanos += nanos - lastNanos;
            }
            for (Coordinator coordinator : order) {
                fired += coordinator.scan(nanos - stoodNanos);
            }
        }
        bus.send();
        watch.offer(status == Status.STALE.code() ? STALE : "");
        lastNanos = nanos;
        return fired;
    }

    /**
     * Scans in real time, until {@code more} says no or the thread is interrupted. The time goes on from the last scan, or
     * begins at 0; what passed since that scan does not count.
     *
     * @param periodNanos from one scan to the next, above 0; a scan that is late shifts those after it
     * @param more asked once before each scan, when it is due
     */
    public void run(long periodNanos, BooleanSupplier more) {
        if (periodNanos <= 0) {
            throw new IllegalArgumentException("a period of " + periodNanos + " ns; expected more than 0");
        }
        long start = System.nanoTime() - lastNanos;
        long due = lastNanos;
        while (waitUntil(start + due) && more.getAsBoolean()) {
            long now = System.nanoTime() - start;
            scan(now);
            due = Math.max(due + periodNanos, now);
        }
    }

    /** Whether the time has come; otherwise the thread was interrupted. */
    private static boolean waitUntil(long nanoTime) {
        while (!Thread.currentThread().isInterrupted()) {
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
     * All nets as of one scan, for a page ({@link tickbus.petri.page.NetPage}) or a view of your own: beside each condition
     * the values of its signals. There is one, so it is for one page, which many may look at. For any thread.
     */
    public NetWatch watch() {
        return watch;
    }

    /** Why nets stopped, in the order of the nets; empty while all run. */
    public List<Stop> stops() {
        return coordinators.values().stream().flatMap(one -> one.stop().stream()).toList();
    }

    /** Whether a net has stopped; allocates nothing. */
    public boolean stopped() {
        for (Coordinator coordinator : order) {
            if (coordinator.stop().isPresent()) {
                return true;
            }
        }
        return false;
    }

    /** Scans so far, with the stale ones. */
    public long scans() {
        return scans;
    }

    /** Scans in which the line was stale, and no net was scanned. */
    public long staleScans() {
        return staleScans;
    }
}
