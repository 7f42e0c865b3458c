package tickbus.junit;

import java.util.ArrayList;
import java.util.HashMap;
import java.util.LinkedHashMap;
import java.util.LinkedHashSet;
import java.util.List;
import java.util.Map;
import java.util.Objects;
import java.util.Set;
import org.opentest4j.AssertionFailedError;
import tickbus.FaultHandler;
import tickbus.InjectedFault;
import tickbus.Signal;
import tickbus.SwallowedChanges;
import tickbus.Tickbus;

/**
 * The PLC under test, from outside: sets its inputs, reads its outputs, and lets time pass.
 *
 * <p>In each tick the machine takes a step with the PLC's commands, the PLC gets the sensors and all forced values, is
 * scanned if a scan is due, and returns its outputs. All this happens on the calling thread; between two calls time stands
 * still.
 *
 * <p>A failure is an {@link AssertionFailedError} that reports the tick, the simulation time, the signal, the
 * expected and the actual value, and the last changes of that signal.
 *
 * <p>{@link PlcTest} creates one for each test. Not thread-safe.
 */
public final class Plc {
    /** How long {@link #press} holds a button: about as long as a finger, and longer than any scan. */
    private static final String PRESS = "200ms";

    /** A value that the test forces, whatever the machine sets. */
    private record Forced(Signal signal, double value) {
    }

    /** A condition that must hold from now on. */
    private record Standing(Condition.Bound condition, long since) {
    }

    private final Tickbus bus;
    private final long stepNanos;
    private final Watch[] watches;
    private final Map<String, Watch> byName = new LinkedHashMap<>();
    private final List<Machine> machines = new ArrayList<>();
    /** Each fault that a machine can have, with that machine. */
    private final Map<String, Machine> faulty = new LinkedHashMap<>();
    private final FaultHandler faults = (name, value) -> faulty.get(name).fault(name, value);
    private final List<Forced> forced = new ArrayList<>();
    private final List<Standing> standing = new ArrayList<>();
    private final Set<Await> open = new LinkedHashSet<>();
    /** The tick at which changes of a signal were swallowed first, by its name. */
    private final Map<String, Long> swallowed = new HashMap<>();
    /** How many changes were swallowed up to the last tick. */
    private long swallowedChanges;
    private long ticks;
    private boolean inStep;
    /** Sees every tick of a run of a sweep; else null. */
    private SweepRun sweep;

    Plc(Tickbus bus, long stepNanos) {
        this.bus = bus;
        this.stepNanos = stepNanos;
        this.watches = bus.signals().stream().map(Watch::new).toArray(Watch[]::new);
        for (Watch watch : watches) {
            byName.put(watch.signal().name(), watch);
        }
    }

    /**
     * Connects a machine, in addition to those already connected.
     *
     * @param machine takes a step with every tick from now on
     * @return this
     */
    public Plc connect(Machine machine) {
        Objects.requireNonNull(machine, "machine");
        machine.connect(this);
        for (String name : machine.faults()) {
            if (faulty.putIfAbsent(name, machine) != null) {
                throw new IllegalArgumentException("two faults of the machines are called \"" + name
                    + "\"; give each a name of its own");
            }
        }
        if (!faulty.isEmpty()) {
            bus.declareFaults(List.copyOf(faulty.keySet()));
        }
        machines.add(machine);
        return this;
    }

    // Signals

    /**
     * A signal's handle, which is faster than the name in a {@link Machine} that uses the signal on every tick.
     *
     * @param name as in driver.cfg
     * @return always the same object
     * @throws IllegalArgumentException if no signal has that name; the message has the nearest ones
     */
    public Signal signal(String name) {
        return watch(name).signal();
    }

    /**
     * All signals.
     *
     * @return unmodifiable, in the order of driver.cfg
     */
    public List<Signal> signals() {
        return bus.signals();
    }

    /**
     * The driver's id.
     *
     * @return as driver.cfg says
     */
    public int id() {
        return bus.id();
    }

    /**
     * The counters of the driver and the PLC program, as {@link Tickbus#statistics}.
     *
     * @return unmodifiable, in an order fit for printing
     */
    public Map<String, String> statistics() {
        return bus.statistics();
    }

    /**
     * Sets an input of the PLC ({@code %I}), to be sent with the next tick. A machine that sets the same signal
     * overwrites it; see {@link #force}.
     *
     * @param signal as in driver.cfg
     * @param value in the signal's unit
     * @return this
     */
    public Plc set(String signal, double value) {
        watch(signal).signal().set(value);
        return this;
    }

    /**
     * Sets an input of the PLC on or off; as {@link #set(String, double)}.
     *
     * @param signal as in driver.cfg
     * @param on true for 1
     * @return this
     */
    public Plc set(String signal, boolean on) {
        return set(signal, on ? 1 : 0);
    }

    /**
     * Forces an input of the PLC to a value, whatever the machine sets, until {@link #release}.
     *
     * @param signal as in driver.cfg
     * @param value in the signal's unit
     * @return this
     */
    public Plc force(String signal, double value) {
        Signal handle = watch(signal).signal();
        forced.removeIf(one -> one.signal() == handle);
        handle.set(value);
        forced.add(new Forced(handle, value));
        return this;
    }

    /**
     * Forces an input of the PLC on or off; as {@link #force(String, double)}.
     *
     * @param signal as in driver.cfg
     * @param on true for 1
     * @return this
     */
    public Plc force(String signal, boolean on) {
        return force(signal, on ? 1 : 0);
    }

    /**
     * Ends {@link #force}. The signal keeps its value until the machine or the test sets another.
     *
     * @param signal as in driver.cfg
     * @return this
     */
    public Plc release(String signal) {
        Signal handle = watch(signal).signal();
        forced.removeIf(one -> one.signal() == handle);
        return this;
    }

    /**
     * Presses a push button: forces the signal on, lets 200 ms pass, and releases it.
     *
     * @param button as in driver.cfg
     * @return this
     */
    public Plc press(String button) {
        force(button, true).run(PRESS);
        return release(button).set(button, false);
    }

    /**
     * A signal's value at the end of the last tick.
     *
     * @param signal as in driver.cfg
     * @return in the signal's unit; 0 or 1 for a BOOL
     */
    public double get(String signal) {
        return watch(signal).signal().get();
    }

    /**
     * Returns whether a signal is on.
     *
     * @param signal as in driver.cfg
     * @return false if it is 0
     */
    public boolean isOn(String signal) {
        return watch(signal).signal().getBoolean();
    }

    /**
     * How often a signal has gone from off to on since the test began, as seen from tick to tick.
     *
     * @param signal as in driver.cfg
     * @return 0 or more
     */
    public long rises(String signal) {
        return watch(signal).rises();
    }

    /**
     * How often a signal has gone from on to off since the test began, as seen from tick to tick.
     *
     * @param signal as in driver.cfg
     * @return 0 or more
     */
    public long falls(String signal) {
        return watch(signal).falls();
    }

    // Faults

    /**
     * Injects a fault, such as a stuck sensor or a broken line. It can begin with the next tick.
     *
     * <pre>{@code
     * InjectedFault wire = plc.inject("""
     *     kind   = "stuck"
     *     signal = "LA1 bottom"
     *     value  = false
     *     """);
     * }</pre>
     *
     * @param fault the keys of a {@code [[fault]]} section of driver.cfg, one per line; times count from the first
     * tick
     * @return the fault, for ending it; otherwise it ends with the test
     * @throws tickbus.FieldbusException with every mistake in the text, and what would be right
     */
    public InjectedFault inject(String fault) {
        return bus.inject(fault);
    }

    /**
     * The faults of driver.cfg, and the injected ones.
     *
     * @return in the order of injection
     */
    public List<InjectedFault> faults() {
        return bus.faults();
    }

    // Time

    /**
     * One tick.
     *
     * @return this
     */
    public Plc tick() {
        return tick(1);
    }

    /**
     * Some ticks.
     *
     * @param count how many; 0 does nothing
     * @return this
     */
    public Plc tick(long count) {
        if (count < 0) {
            throw new IllegalArgumentException(count + " ticks; time does not run backwards");
        }
        for (long i = 0; i < count; i++) {
            step();
        }
        return this;
    }

    /**
     * Lets simulation time pass.
     *
     * @param duration such as {@code "1.5s"}; rounded up to whole ticks
     * @return this
     */
    public Plc run(String duration) {
        return tick(ticksOf(duration));
    }

    /**
     * The number of ticks so far.
     *
     * @return 0 before the first
     */
    public long ticks() {
        return ticks;
    }

    /**
     * The simulation time so far.
     *
     * @return nanoseconds: ticks times tick length
     */
    public long simulationNanos() {
        return ticks * stepNanos;
    }

    /**
     * The simulation time per tick.
     *
     * @return nanoseconds
     */
    public long stepNanos() {
        return stepNanos;
    }

    private void step() {
        if (inStep) {
            throw new IllegalStateException("a machine must not let time pass in its own step; set signals there, and"
                + " let the test tick");
        }
        inStep = true;
        boolean over;
        try {
            long time = ticks * stepNanos + stepNanos;
            for (int i = 0; i < machines.size(); i++) {
                machines.get(i).step(this, time);
            }
            for (int i = 0; i < forced.size(); i++) {
                Forced one = forced.get(i);
                one.signal().set(one.value());
            }
            if (sweep != null) {
                sweep.before();
            }
            bus.exchange(time);
            over = sweep != null && sweep.after();
            bus.pollFaults(faults);
        } finally {
            inStep = false;
        }
        ticks++;
        for (Watch watch : watches) {
            watch.look(ticks);
        }
        long swallowedNow = SwallowedChanges.count(bus);
        if (swallowedNow != swallowedChanges) {
            swallowedChanges = swallowedNow;
            for (String signal : SwallowedChanges.of(bus).keySet()) {
                swallowed.putIfAbsent(signal, ticks);
            }
        }
        for (int i = 0; i < standing.size(); i++) {
            Standing one = standing.get(i);
            if (!one.condition().holds()) {
                throw failure(one.condition(), "at every tick since tick " + one.since());
            }
        }
        if (over) {
            SweepRun.end();
        }
    }

    // Expectations

    /** Returns whether changes of a signal were swallowed, or of any if there are no names. */
    boolean hasSwallowed(List<String> names) {
        return names.isEmpty() ? !swallowed.isEmpty() : names.stream().anyMatch(swallowed::containsKey);
    }

    /** Signals whose changes were swallowed, of these or of all if there are no names, and what to do about each. */
    Map<String, String> swallowed(List<String> names) {
        Map<String, String> found = new LinkedHashMap<>(SwallowedChanges.of(bus));
        found.keySet().removeIf(name -> !names.isEmpty() && !names.contains(name));
        found.replaceAll((name, told) -> told + "; the first at " + where(swallowed.getOrDefault(name, ticks)));
        return found;
    }

    /**
     * Fails unless the condition holds now.
     *
     * @param condition from {@link Condition}'s methods
     * @return for watching it longer: {@link Expectation#during}
     */
    public Expectation expect(Condition condition) {
        Condition.Bound bound = condition.bind(this);
        check(bound, "");
        return new Expectation(this, bound);
    }

    /**
     * Requires the condition at the end of every tick from now on, until the test ends.
     *
     * @param condition from {@link Condition}'s methods
     * @return this
     */
    public Plc always(Condition condition) {
        Condition.Bound bound = condition.bind(this);
        check(bound, "at every tick since tick " + ticks);
        if (isStrict()) {
            standing.add(new Standing(bound, ticks));
        }
        return this;
    }

    /**
     * Forbids the condition at the end of every tick from now on, until the test ends.
     *
     * @param condition from {@link Condition}'s methods
     * @return this
     */
    public Plc never(Condition condition) {
        return always(condition.negated());
    }

    /**
     * Starts to wait for a condition; {@link Await#within(long)} sets the limit.
     *
     * @param condition from {@link Condition}'s methods
     * @return for setting the limit; a test that does not set it fails
     */
    public Await await(Condition condition) {
        Await await = new Await(this, condition.bind(this));
        open.add(await);
        return await;
    }

    void limited(Await await) {
        open.remove(await);
    }

    void check(Condition.Bound condition, String when) {
        if (isStrict() && !condition.holds()) {
            throw failure(condition, when);
        }
    }

    /** True if expectations count and waits have their limits; under the fault of a sweep they do not. */
    boolean isStrict() {
        return sweep == null || sweep.isStrict();
    }

    /** Lets a run of a sweep see every tick from now on; null for none. Then no condition has to hold any more. */
    void sweep(SweepRun run) {
        sweep = run;
        standing.clear();
    }

    AssertionFailedError failure(Condition.Bound condition, String when) {
        String expected = condition.expected();
        String seen = condition.seen();
        StringBuilder text = new StringBuilder(where()).append(": ").append(condition.failure(when));
        condition.watches().forEach(watch -> text.append("\n  ").append(watch.history(stepNanos)));
        return new AssertionFailedError(text.toString(), expected, seen);
    }

    // For the extension

    /** A duration in ticks, rounded up. */
    long ticksOf(String duration) {
        long nanos = Durations.parse(duration);
        return nanos / stepNanos + (nanos % stepNanos == 0 ? 0 : 1);
    }

    /** The current tick and time, for people. */
    String where() {
        return where(ticks);
    }

    private String where(long tick) {
        return "tick " + tick + " (" + Durations.text(tick * stepNanos) + ")";
    }

    /** The duration of a number of ticks, for people. */
    String span(long count) {
        return count + (count == 1 ? " tick (" : " ticks (") + Durations.text(count * stepNanos) + ")";
    }

    Watch watch(String name) {
        Watch watch = byName.get(Objects.requireNonNull(name, "signal"));
        if (watch == null) {
            // Reports similar names.
            bus.signal(name);
            throw new IllegalArgumentException("there is no signal '" + name + "'");
        }
        return watch;
    }

    /** The failure of a test that called await without a limit; null otherwise. */
    AssertionFailedError unfinished() {
        return open.isEmpty() ? null : open.iterator().next().unlimited();
    }
}
