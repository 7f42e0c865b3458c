package tickbus;

import java.lang.invoke.MethodHandles;
import java.lang.invoke.VarHandle;
import java.nio.LongBuffer;
import java.nio.file.Path;
import java.util.Collections;
import java.util.HashMap;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.Objects;
import java.util.Optional;
import java.util.function.LongToIntFunction;
import java.util.function.Supplier;
import java.util.stream.Collectors;
import java.util.stream.Stream;

/**
 * One open driver: a simulation's end of a PLC's fieldbus.
 *
 * <pre>{@code
 * try (Tickbus bus = Tickbus.open(Path.of("driver.cfg"))) {
 *     Signal run = bus.signal("LA1 run");
 *     Signal position = bus.signal("LA1 position");
 *     while (simulating) {
 *         bus.receive();
 *         machine.run(run.getBoolean());
 *         machine.move();
 *         position.set(machine.position());
 *         bus.send();
 *     }
 * }
 * }</pre>
 *
 * <p><b>A tick</b> is either {@link #receive()}, the model, {@link #send()}, or one {@link #exchange()}. The first answers
 * within the tick: what the PLC sent is in the model at once, and the model's answer on the line at the end of the same tick.
 * {@code exchange()} sends first and receives then, so that an answer goes out with the next tick. It suits simulators that hand
 * over all values at one place. Edges, age and status are the same with both. {@link #receive()}, {@link #send()} and
 * {@link #exchange()} take no lock, make no system call, and allocate nothing, in either language; they never wait for the bus
 * unless driver.cfg says {@code mode = "stepped"}.
 *
 * <p><b>Time.</b> {@link #exchange(long)} and {@link #receive(long)} are given the simulation's time. Stepped buses run the PLC by
 * it, recordings and faults are timed by it. Without it a tick has the computer's time since the first tick, which is right where the
 * simulation keeps pace with that. A simulation that runs as fast as it can, or stands still, outruns a PLC that has a clock of its
 * own: between two of the PLC's scans thousands of ticks pass, and the machine has long gone where the PLC would have stopped it.
 * Let such a simulation keep pace with the clock, or run the PLC by simulation time, with {@code mode = "stepped"}.
 *
 * <p><b>Threads.</b> The first thread that ticks becomes the driver's ticking thread: ticks, events and the
 * getters and setters of the signals belong to it. Another thread's tick throws {@link Status#BUSY} and does
 * nothing, until the ticking thread has ended or has called {@link #releaseThread}. A simulation engine whose events run on changing
 * threads calls that at the end of each of its events that ticks. {@link #statistics}, {@link #inject},
 * {@link #faults} and {@link #close} can be called by any thread; while a tick's call is running they throw {@link Status#BUSY}, and a
 * tick that meets one of them waits for its end. Different drivers are independent of each other.
 *
 * <p>After {@link #close} every method but {@link #close}, {@link #id}, {@link #name} and {@link #toString}
 * throws {@link FieldbusException} with {@link Status#CLOSED}.
 */
public final class Tickbus implements AutoCloseable {
    private static final VarHandle TICKER;
    /** Events that one native call can bring. */
    private static final int EVENTS = 64;
    /** Events that one call hands over at most: as many as the driver's ring holds. */
    private static final int MOST_EVENTS = 4096;
    /** How often a call that meets a running exchange is tried. */
    private static final int PATIENCE = 100;
    /** Longs per event: signal, slot, time. */
    private static final int EVENT_WORDS = 3;

    /** The fields of a fault's line. */
    private static final int FAULT_ID = 0;
    private static final int FAULT_STATE = 1;
    private static final int FAULT_BEGUN = 2;
    private static final int FAULT_KIND = 3;
    private static final int FAULT_NAME = 4;
    private static final int FAULT_WHAT = 5;
    private static final int FAULT_FIELDS = 6;

    static {
        try {
            TICKER = MethodHandles.lookup().findVarHandle(Tickbus.class, "ticker", Thread.class);
        } catch (ReflectiveOperationException e) {
            throw new ExceptionInInitializerError(e);
        }
    }

    private final long handle;
    private final int id;
    private final String name;
    /** The shared buffer; only the ticking thread touches its slots. */
    private final LongBuffer words;
    private final List<Signal> signals;
    private final Map<String, Signal> byName = new HashMap<>();
    private final Conversions conversions = new Conversions();
    private final SignalGroup written;
    private final SignalGroup read;
    /** Events that were fetched; those from {@code nextEvent} to {@code endOfEvents} are yet to be handed over. */
    private long[] events;
    private int nextEvent;
    private int endOfEvents;
    /**
     * The thread that the slots belong to; null when there is none. A thread that reads its own name here put it
     * there itself, so that a plain comparison is enough on every tick but a thread's first.
     */
    private Thread ticker;
    private volatile boolean closed;

    private Tickbus(long handle, Layout layout) {
        this.handle = handle;
        this.id = layout.id();
        this.name = layout.name();
        this.words = layout.words();
        LongBuffer slots = layout.slots();
        this.signals = layout.signals().stream().map(entry -> new Signal(this, slots, entry)).toList();
        signals.forEach(signal -> byName.put(signal.name(), signal));
        this.written = new SignalGroup(layout, signals.stream().filter(Signal::isWritten).toList(), conversions);
        this.read = new SignalGroup(layout, signals.stream().filter(signal -> !signal.isWritten()).toList(),
            conversions);
    }

    /**
     * Opens the driver that a configuration file describes, and starts its fieldbus. Returns at once, whether
     * or not the PLC is there: until it is, {@link #exchange()} answers {@link Status#STALE}.
     *
     * @param driverCfg the driver.cfg
     * @return the open driver, to be closed
     * @throws FieldbusException {@link Status#BAD_CONFIG} with every mistake at its line and column,
     *     {@link Status#LIBRARY} with every place where the native library was looked for, and
     *     {@link Status#BUS_FAILED}, {@link Status#UNSUPPORTED} or {@link Status#TOO_MANY_DRIVERS} with the
     *     reason
     */
    public static Tickbus open(Path driverCfg) {
        return open(driverCfg, "");
    }

    /**
     * Opens the driver that a configuration file describes, with some tables other than its own: so a test can
     * have the plant's own signal table, and a PLC program in this process at the other end.
     *
     * <p>A {@code [fieldbus]} with a {@code kind} stands instead of the file's; one without sets the {@code mode} of
     * the file's own loopback. Times, sizes and signs of life of the file stay. {@code [[station]]} tables say by name
     * what another bus has to know of the file's stations. A bus that replays a recording takes the file's own
     * {@code [record]} away.
     *
     * @param driverCfg the driver.cfg, which must be right as it stands
     * @param tables TOML as in a driver.cfg; empty changes nothing
     * @return the open driver, to be closed
     * @throws FieldbusException as {@link #open(Path)}; mistakes in the tables have their lines and columns, too
     */
    public static Tickbus open(Path driverCfg, String tables) {
        Objects.requireNonNull(driverCfg, "driverCfg");
        Objects.requireNonNull(tables, "tables");
        NativeLibrary.load();
        Layout layout = new Layout();
        long handle = initializeNative(nameOf(driverCfg), tables, layout);
        try {
            layout.check();
            return new Tickbus(handle, layout);
        } catch (RuntimeException | Error e) {
            finalizeNative(handle);
            throw e;
        }
    }

    /** The file's name for native code: its URI, where the JVM's file encoding cannot hold the path as text. */
    private static String nameOf(Path file) {
        String name = file.toString();
        return name.indexOf('\uFFFD') < 0 ? name : "file://" + file.toUri().getRawPath();
    }

    /**
     * One tick: sends the signals that this end writes, and takes those that it reads.
     *
     * <p>The simulation time given last stands. Where none was ever given, the tick has the computer's time since the
     * first one; a stepped fieldbus then goes on by one step, to what it granted last.
     *
     * @return 0 fresh, 1 unchanged, 2 stale: the codes of {@link Status}
     * @throws FieldbusException {@link Status#BUS_FAILED}, {@link Status#BUSY}, {@link Status#CLOSED} or
     *     {@link Status#INTERNAL}
     */
    public int exchange() {
        mustBeTicker();
        int code = xChangeData(handle);
        return code >= 0 ? code : after(code, Tickbus::xChangeData);
    }

    /**
     * One tick at a given simulation time, which stepped fieldbuses and recordings need.
     *
     * @param simulationNanos nanoseconds since the simulation began, not falling; a stepped fieldbus refuses a time before the last
     * @return 0 fresh, 1 unchanged, 2 stale: the codes of {@link Status}
     * @throws FieldbusException as {@link #exchange()}
     */
    public int exchange(long simulationNanos) {
        mustBeTicker();
        words.put(Layout.WORD_SIMULATION_TIME, simulationNanos);
        return exchange();
    }

    /**
     * Begins a tick: takes the signals that this end reads. The model computes, and {@link #send()} ends the tick.
     *
     * <p>Time is as in {@link #exchange()}. On a stepped fieldbus the PLC runs up to it, with what was sent in the tick
     * before. To receive again without having sent begins another tick; the one before has no answer then.
     *
     * @return 0 fresh, 1 unchanged, 2 stale: the codes of {@link Status}
     * @throws FieldbusException as {@link #exchange()}
     */
    public int receive() {
        mustBeTicker();
        int code = receiveNative(handle);
        return code >= 0 ? code : after(code, Tickbus::receiveNative);
    }

    /**
     * Begins a tick at a given simulation time, which stepped fieldbuses and recordings need.
     *
     * @param simulationNanos nanoseconds since the simulation began, not falling; a stepped fieldbus refuses a time before the last
     * @return 0 fresh, 1 unchanged, 2 stale: the codes of {@link Status}
     * @throws FieldbusException as {@link #exchange()}
     */
    public int receive(long simulationNanos) {
        mustBeTicker();
        words.put(Layout.WORD_SIMULATION_TIME, simulationNanos);
        return receive();
    }

    /**
     * Ends the tick that {@link #receive()} began: sends the signals that this end writes.
     *
     * <p>To send again in the same tick hands over the newer values; that is no tick of its own.
     *
     * @throws FieldbusException as {@link #exchange()}; also if the {@code receive()} of this tick failed, and
     *     nothing is sent then
     */
    public void send() {
        mustBeTicker();
        int code = sendNative(handle);
        if (code < 0) {
            after(code, Tickbus::sendNative);
        }
    }

    /**
     * Goes on where {@link #statistics}, {@link #inject} or {@link #close} of another thread was in the way. They have the
     * driver for as long as it takes to copy what they need, or to take it over; after {@code close} it is
     * {@link Status#CLOSED}.
     */
    private int after(int refusal, LongToIntFunction call) {
        int code = refusal;
        while (code == Status.BUSY.code()) {
            Thread.onSpinWait();
            code = call.applyAsInt(handle);
        }
        if (code < 0) {
            throw failure(code);
        }
        return code;
    }

    /**
     * Sets all signals that this end writes. Unlike {@link Signal#set} it lets NaN and infinities pass: the
     * native library sends the signal's fail-safe value for NaN, and counts it.
     *
     * @param values one value per signal for which {@link Signal#isWritten}, in the order of {@link #signals}
     * @throws IllegalArgumentException if there are more or fewer values than such signals
     */
    public void setAll(double[] values) {
        mustBeOpen();
        if (values.length != written.size()) {
            throw new IllegalArgumentException("driver '" + name + "' has " + written.size()
                + " signals to write, but was given " + values.length + " values");
        }
        written.set(values);
    }

    /**
     * Gets all signals that this end reads.
     *
     * @param into gets one value per signal that is not {@link Signal#isWritten}, in the order of
     *     {@link #signals}; may be longer
     * @return how many values that is
     * @throws IllegalArgumentException if the array is too short
     */
    public int getAll(double[] into) {
        mustBeOpen();
        if (into.length < read.size()) {
            throw new IllegalArgumentException("driver '" + name + "' has " + read.size()
                + " signals to read, but the array has " + into.length + " places");
        }
        read.get(into);
        return read.size();
    }

    /**
     * All signals.
     *
     * @return unmodifiable, in the order of driver.cfg
     */
    public List<Signal> signals() {
        mustBeOpen();
        return signals;
    }

    /**
     * A signal by its name.
     *
     * @param name as in driver.cfg
     * @return the signal's handle, always the same one
     * @throws IllegalArgumentException if there is no such signal; the message has the nearest names
     */
    public Signal signal(String name) {
        mustBeOpen();
        Signal signal = byName.get(name);
        if (signal == null) {
            throw new IllegalArgumentException("driver '" + this.name + "' has no signal '" + name + "'"
                + NearestNames.hint(name, signals.stream().map(Signal::name).toList()));
        }
        return signal;
    }

    /**
     * Age of the data at the last exchange; of the worst station where there are several.
     *
     * @return nanoseconds; {@link Long#MAX_VALUE} if nothing has arrived yet
     */
    public long ageNanos() {
        return header(Layout.WORD_AGE);
    }

    /**
     * How many bus cycles had arrived at the last exchange.
     *
     * @return counts from 0
     */
    public long sequence() {
        return header(Layout.WORD_SEQUENCE);
    }

    /**
     * Up to which simulation time the last exchange lets the simulation go on.
     *
     * @return nanoseconds; the time handed in, on buses that do not keep time
     */
    public long grantedNanos() {
        return header(Layout.WORD_GRANTED);
    }

    /**
     * The driver's id.
     *
     * @return as driver.cfg says
     */
    public int id() {
        return id;
    }

    /**
     * The driver's name, for people.
     *
     * @return as driver.cfg says
     */
    public String name() {
        return name;
    }

    /**
     * What the driver has counted so far: {@code ticks}, {@code fresh}, {@code stale}, {@code state} and more.
     * Not for every tick.
     *
     * @return unmodifiable, in an order fit for printing
     * @throws FieldbusException {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public Map<String, String> statistics() {
        String text = whenIdle(() -> statisticsNative(handle));
        Map<String, String> statistics = new LinkedHashMap<>();
        text.lines().forEach(line -> {
            // A count has the name of its signal in its key, and that may have a '=' of its own.
            int equals = line.startsWith("plc.rises.") ? line.lastIndexOf('=') : line.indexOf('=');
            statistics.put(line.substring(0, equals), line.substring(equals + 1));
        });
        add(statistics, "saturated", conversions.saturated());
        add(statistics, "not_a_number", conversions.notANumber());
        return Collections.unmodifiableMap(statistics);
    }

    private static void add(Map<String, String> statistics, String key, long count) {
        statistics.computeIfPresent(key, (same, text) -> Long.toString(Long.parseLong(text) + count));
    }

    /** For the signals of this driver. */
    Conversions conversions() {
        return conversions;
    }

    /**
     * Injects a fault: a wrong value of a signal, or a trouble of the line. It can begin at the next exchange.
     *
     * <p>Times and ticks count from this driver's first exchange: {@code at = "2s"} is two seconds after that.
     *
     * @param fault the keys of a {@code [[fault]]} section of driver.cfg, one a line, with or without its header
     * @return the fault, to be ended
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} with every mistake at its line and column;
     *     {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public InjectedFault inject(String fault) {
        Objects.requireNonNull(fault, "fault");
        int id = whenIdle(() -> injectNative(handle, fault));
        // The fault is injected: to throw BUSY now would say that it is not.
        return untilIdle(this::faults).stream().filter(one -> one.id() == id).findFirst().orElseThrow();
    }

    /**
     * The faults that were injected, by driver.cfg or by {@link #inject}.
     *
     * @return in the order of injection; where there were more than 64, those that are long over may be missing
     * @throws FieldbusException {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public List<InjectedFault> faults() {
        return faultLines().map(line -> new InjectedFault(this, Integer.parseInt(line[FAULT_ID]), line[FAULT_KIND],
            line[FAULT_NAME], line[FAULT_WHAT])).toList();
    }

    InjectedFault.State faultState(int id) {
        return faultLine(id).map(line -> InjectedFault.State.valueOf(line[FAULT_STATE].toUpperCase(Locale.ROOT)))
            .orElse(InjectedFault.State.OVER);
    }

    long faultBegun(int id) {
        return faultLine(id).map(line -> Long.parseLong(line[FAULT_BEGUN])).orElse(0L);
    }

    void endFault(int id) {
        whenIdle(() -> endFaultNative(handle, id));
    }

    private Optional<String[]> faultLine(int id) {
        return faultLines().filter(line -> Integer.parseInt(line[FAULT_ID]) == id).findFirst();
    }

    private Stream<String[]> faultLines() {
        return whenIdle(() -> faultsNative(handle)).lines().map(line -> line.split("\t", FAULT_FIELDS));
    }

    /**
     * Hands over the waiting events, oldest first: the writes of the PLC one by one, on buses that have them.
     *
     * <p>One call hands over 4096 at most, as many as the driver keeps, so that a PLC which writes faster than the handler
     * works does not hold the tick up for ever. Should the handler throw, the event that it threw at counts as handed over,
     * and the next call goes on behind it.
     *
     * @param handler called on this thread, for each event
     * @return how many events there were
     * @throws FieldbusException {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public int pollEvents(EventHandler handler) {
        Objects.requireNonNull(handler, "handler");
        mustBeTicker();
        mustBeOpen();
        int total = 0;
        while (total < MOST_EVENTS && (nextEvent < endOfEvents || takeEvents())) {
            int at = nextEvent;
            nextEvent += EVENT_WORDS;
            total++;
            Signal signal = signals.get((int) events[at]);
            handler.event(signal, signal.value(events[at + 1]), events[at + 2]);
        }
        return total;
    }

    /** Fetches events; false if there are none. */
    private boolean takeEvents() {
        if (events == null) {
            events = new long[EVENTS * EVENT_WORDS];
        }
        // As untilIdle, which would allocate.
        while (true) {
            try {
                endOfEvents = eventsNative(handle, events) * EVENT_WORDS;
                nextEvent = 0;
                return endOfEvents > 0;
            } catch (FieldbusException e) {
                waitAfter(e);
            }
        }
    }

    /**
     * Ends the connection. Closing twice is no mistake.
     *
     * @throws FieldbusException {@link Status#BUSY} if another thread is in an exchange; the driver stays open
     */
    @Override
    public synchronized void close() {
        if (closed) {
            return;
        }
        try {
            whenIdle(() -> {
                finalizeNative(handle);
                return null;
            });
        } catch (FieldbusException e) {
            // The native side has given the driver up, unless it was in use.
            if (e.status() != Status.BUSY) {
                closed();
            }
            throw e;
        }
        closed();
    }

    /**
     * Lets another thread become the ticking thread. To be called by the ticking thread; by any other, it does
     * nothing. Whoever lets the next thread go on must also order its memory, as every executor, lock and queue does.
     */
    public void releaseThread() {
        TICKER.compareAndSet(this, Thread.currentThread(), null);
    }

    private void closed() {
        closed = true;
        signals.forEach(Signal::close);
    }

    /** Name and id. */
    @Override
    public String toString() {
        return name + " (" + id + ")";
    }

    void mustBeOpen() {
        if (closed) {
            throw new FieldbusException(Status.CLOSED, "'" + name + "': " + Status.CLOSED.text());
        }
    }

    private long header(int word) {
        mustBeOpen();
        return words.get(word);
    }

    private void mustBeTicker() {
        if (ticker != Thread.currentThread()) {
            becomeTicker();
        }
    }

    private void becomeTicker() {
        mustBeOpen();
        Thread former = (Thread) TICKER.getVolatile(this);
        boolean free = former == null || !former.isAlive();
        if (!free || !TICKER.compareAndSet(this, former, Thread.currentThread())) {
            throw new FieldbusException(Status.BUSY, "'" + name + "' is ticked by " + (free ? "another thread" : former)
                + "; tick it from that thread, end that thread, or call releaseThread() there first");
        }
    }

    /** Makes a native call that a running exchange of the ticking thread keeps out, most often for less than 1 us. */
    private static <T> T whenIdle(Supplier<T> call) {
        for (int attempt = 1;; attempt++) {
            try {
                return call.get();
            } catch (FieldbusException e) {
                if (e.status() != Status.BUSY || attempt == PATIENCE) {
                    throw e;
                }
                Thread.onSpinWait();
            }
        }
    }

    /** Makes a call again and again until no other thread is in its way. */
    static <T> T untilIdle(Supplier<T> call) {
        while (true) {
            try {
                return call.get();
            } catch (FieldbusException e) {
                waitAfter(e);
            }
        }
    }

    /** Lets a call that met another thread's be tried again; throws what is no such meeting. */
    private static void waitAfter(FieldbusException e) {
        if (e.status() != Status.BUSY) {
            throw e;
        }
        Thread.onSpinWait();
    }

    /** What a negative code means, with the driver's own reason where it has one. */
    private FieldbusException failure(int code) {
        Status status = Status.of(code);
        String what = "'" + name + "': " + status.text();
        try {
            String reason = statistics().get("reason");
            return new FieldbusException(status, reason == null || reason.isEmpty() ? what : what + ": " + reason);
        } catch (FieldbusException e) {
            return e.code() == code ? e : new FieldbusException(status, what);
        }
    }

    /**
     * Makes an HTML page from a recording: a chart of the signals, faults, states of the line. It lies beside the
     * recording, loads nothing, and any browser shows it.
     *
     * @param recording the VCD or CSV file that a {@code [record]} table named; its driver must be closed
     * @param title the page's heading
     * @param statistics what {@link #statistics} gave last; may be empty
     * @param heading what the text is
     * @param text shown as it is; empty for none
     * @return the page
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} with the reason if it cannot be made
     */
    public static Path report(Path recording, String title, Map<String, String> statistics, String heading, String text) {
        NativeLibrary.load();
        String lines = statistics.entrySet().stream().map(entry -> entry.getKey() + "=" + entry.getValue())
            .collect(Collectors.joining("\n"));
        return Path.of(reportNative(recording.toString(), title, lines, heading + "\n" + text));
    }

    /** Opens a driver and describes it to {@code layout}; throws {@link FieldbusException}. */
    static native long initializeNative(String driverCfg, String tables, Layout layout);

    /** The tick; gives a status code and never throws, whatever the handle. */
    static native int xChangeData(long handle);

    /** The half of the tick that receives; as {@link #xChangeData}. */
    static native int receiveNative(long handle);

    /** The half of the tick that sends; as {@link #xChangeData}. */
    static native int sendNative(long handle);

    /** Closes a driver; throws {@link FieldbusException}. */
    static native void finalizeNative(long handle);

    /** Lines of {@code key=value}; throws {@link FieldbusException}. */
    static native String statisticsNative(long handle);

    /** Moves events into {@code into}, three longs each, and says how many; throws {@link FieldbusException}. */
    static native int eventsNative(long handle, long[] into);

    /** Injects the fault that a section describes, and gives its number; throws {@link FieldbusException}. */
    static native int injectNative(long handle, String fault);

    /** Ends a fault at the next exchange; false if there is none. Throws {@link FieldbusException}. */
    static native boolean endFaultNative(long handle, int id);

    /** A line per fault, with tabs between its fields; throws {@link FieldbusException}. */
    static native String faultsNative(long handle);

    /** Makes the page of a recording; the text's first line is its heading. Throws {@link FieldbusException}. */
    static native String reportNative(String recording, String title, String statistics, String text);

    /** Does nothing: what a native call costs, the baseline of the benchmarks. */
    static native int emptyNative();
}
