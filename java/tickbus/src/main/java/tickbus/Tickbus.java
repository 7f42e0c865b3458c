package tickbus;

import java.lang.invoke.MethodHandles;
import java.lang.invoke.VarHandle;
import java.lang.ref.Cleaner;
import java.nio.LongBuffer;
import java.nio.file.Path;
import java.util.Collections;
import java.util.HashMap;
import java.util.List;
import java.util.Map;
import java.util.Objects;
import java.util.Optional;
import java.util.function.LongToIntFunction;

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
 * <p><b>A tick</b> is either {@link #receive()}, the model, {@link #send()}, or one {@link #exchange()}. The first way
 * answers within the tick: the model gets at once what the PLC sent, and its answer is sent at the end of the same tick.
 * {@code exchange()} sends first and then receives, so that an answer is sent with the next tick; it suits simulators that
 * pass all values in one place. Edges, age and status are the same in both. {@link #receive()}, {@link #send()} and {@link
 * #exchange()} take no lock, make no system call, and allocate nothing, neither in Java nor in native code; they never wait
 * for the bus unless driver.cfg says {@code mode = "stepped"}.
 *
 * <p><b>Time.</b> {@link #exchange(long)} and {@link #receive(long)} take the simulation's time. Stepped buses run
 * the PLC by it, and recordings and faults use it. Without it a tick has the computer's time since the first tick, which is
 * right if the simulation keeps pace with the clock. A simulation that runs as fast as it can outruns a PLC with
 * its own clock: thousands of ticks pass between two of the PLC's scans, and the machine has long moved past the
 * point at which the PLC would have stopped it. Let such a simulation keep pace with the clock, or run the PLC in
 * simulation time, with {@code mode = "stepped"}.
 *
 * <p><b>Threads.</b> The first thread that ticks becomes the driver's ticking thread: ticks, events and the getters
 * and setters of the signals belong to it. Another thread's tick throws {@link Status#BUSY} and does nothing, until
 * the ticking thread has ended or has called {@link #releaseThread}. A simulation engine whose events run on changing
 * threads calls {@code releaseThread} at the end of each event that ticks. Any thread can call {@link #statistics}, {@link
 * #inject}, {@link #faults} and {@link #close}, also in a shutdown hook. They wait for a tick in progress, and a simulation
 * that ticks without a pause lets them in. They throw {@link Status#BUSY} only if one tick takes longer than 2 s, as on a
 * stepped bus whose PLC is slow. A tick that meets one of them waits until it is done. Different drivers are independent of
 * each other.
 *
 * <p><b>The end.</b> Close a driver by try-with-resources. The garbage collector closes a driver that nothing refers to any
 * more, and logs its name. When the JVM ends, open drivers are closed after its shutdown hooks (not on Windows; there close
 * them in a hook). SIGTERM and SIGINT are such an end, SIGKILL is not.
 *
 * <p>After {@link #close} every method but {@link #close}, {@link #id}, {@link #name} and {@link #toString}
 * throws {@link FieldbusException} with {@link Status#CLOSED}.
 */
public final class Tickbus implements AutoCloseable {
    private static final VarHandle TICKER;
    /** Closes forgotten drivers. */
    private static final Cleaner CLEANER = Cleaner.create();
    /** No driver's handle. */
    private static final long NO_HANDLE = 0;

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
    private final Conversions conversions;
    private final SignalGroup written;
    private final SignalGroup read;
    private final Events events = new Events(this);
    /** The faults that the model has declared; null if it has declared none. */
    private ModelFaults modelFaults;
    /**
     * The thread that the slots belong to; null before the first tick and after a release. A thread that reads its own name
     * here has written it itself, so a plain comparison suffices on every tick except a thread's first.
     */
    private Thread ticker;
    private volatile boolean closed;
    private final Forgotten forgotten;
    private final Cleaner.Cleanable cleanable;

    private Tickbus(long handle, Layout layout) {
        this.handle = handle;
        this.id = layout.id();
        this.name = layout.name();
        this.words = layout.words();
        this.conversions = new Conversions(words);
        this.signals = Signal.all(this, layout);
        for (Signal signal : signals) {
            byName.put(signal.name(), signal);
        }
        this.written = new SignalGroup(layout, signals, true, conversions);
        this.read = new SignalGroup(layout, signals, false, conversions);
        this.forgotten = new Forgotten(handle);
        this.cleanable = CLEANER.register(this, forgotten);
    }

    /** Closes a driver that nothing refers to any more, and logs its name. Must not refer to the driver itself. */
    private static final class Forgotten implements Runnable {
        private final long handle;
        private volatile boolean closed;

        Forgotten(long handle) {
            this.handle = handle;
        }

        @Override
        public void run() {
            if (!closed) {
                forgottenNative(handle);
            }
        }
    }

    /**
     * Opens the driver that a configuration file describes, and starts its fieldbus. Returns at once, whether or not
     * the PLC is there: until it is, {@link #exchange()} returns {@link Status#STALE}.
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
     * Opens the driver that a configuration file describes, with some of its tables replaced: for example, a test
     * uses the plant's own signal table, with a PLC program in this process at the other end.
     *
     * <p>A {@code [fieldbus]} with a {@code kind} replaces the file's; one without sets the {@code mode} of the
     * file's own loopback. Times, sizes and life signs of the file stay. {@code [[station]]} tables give, by name,
     * what another bus needs to know about the file's stations. A bus that replays a recording removes the file's own
     * {@code [record]}.
     *
     * @param driverCfg the driver.cfg, which must be valid on its own
     * @param tables TOML as in a driver.cfg; empty changes nothing
     * @return the open driver, to be closed
     * @throws FieldbusException as {@link #open(Path)}; mistakes in the tables also have their lines and columns
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

    /**
     * Describes the driver of a configuration file, and opens nothing: no fieldbus, no recording, no live page. The
     * result has id, name and signals; a tick throws {@link Status#NOT_OPEN}. It need not be closed.
     *
     * @param driverCfg the driver.cfg
     * @return the description
     * @throws FieldbusException {@link Status#BAD_CONFIG} or {@link Status#LIBRARY}, as {@link #open(Path)}
     */
    public static Tickbus look(Path driverCfg) {
        Objects.requireNonNull(driverCfg, "driverCfg");
        NativeLibrary.load();
        Layout layout = new Layout();
        lookNative(nameOf(driverCfg), layout);
        layout.allocateAlone();
        return new Tickbus(NO_HANDLE, layout);
    }

    /** The file's name for native code: its URI if the JVM's file encoding cannot represent the path as text. */
    private static String nameOf(Path file) {
        String name = file.toString();
        return name.indexOf('\uFFFD') < 0 ? name : "file://" + file.toUri().getRawPath();
    }

    /**
     * One tick: sends the signals that this end writes, and receives those that it reads.
     *
     * <p>The last given simulation time is kept. If none was ever given, the tick has the computer's time since the
     * first tick; a stepped fieldbus then advances by one step, to the time that it granted last.
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
     * One tick at a given simulation time, for stepped fieldbuses and recordings.
     *
     * @param simulationNanos nanoseconds since the simulation began, never decreasing; a stepped fieldbus refuses an
     * earlier time than the last
     * @return 0 fresh, 1 unchanged, 2 stale: the codes of {@link Status}
     * @throws FieldbusException as {@link #exchange()}
     */
    public int exchange(long simulationNanos) {
        mustBeTicker();
        words.put(Layout.WORD_SIMULATION_TIME, simulationNanos);
        return exchange();
    }

    /**
     * Begins a tick: receives the signals that this end reads. The model computes, and {@link #send()} ends the tick.
     *
     * <p>Time is as in {@link #exchange()}. On a stepped fieldbus the PLC runs up to that time, with the values sent in the
     * previous tick. Receiving again without having sent begins another tick; the previous one then has no answer.
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
     * Begins a tick at a given simulation time, for stepped fieldbuses and recordings.
     *
     * @param simulationNanos nanoseconds since the simulation began, never decreasing; a stepped fieldbus refuses an
     * earlier time than the last
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
     * <p>Sending again in the same tick publishes the newer values, but is not a tick.
     *
     * @throws FieldbusException as {@link #exchange()}; also if the {@code receive()} of this tick failed: then
     * nothing is sent
     */
    public void send() {
        mustBeTicker();
        int code = sendNative(handle);
        if (code < 0) {
            after(code, Tickbus::sendNative);
        }
    }

    /**
     * Begins the next episode of the simulation without opening again, which is faster. The signals have their initial
     * values, and {@code exchange(0)} can follow: simulation time begins again. All that belongs to the ticks is as after
     * opening: their counters, the counts of edges, heartbeats, axes, the faults of driver.cfg; injected ones end, and
     * events that were not polled are dropped.
     *
     * <p>A PLC program or a recording in this process begins again, too: the program is at its first scan. A connection to
     * a PLC stays, and the PLC gets the initial values with the next tick. A {@code [record]} continues in the same file.
     *
     * <p>Called by the ticking thread.
     *
     * @throws FieldbusException {@link Status#UNSUPPORTED} if the time of a stepped fieldbus belongs to other participants as
     *     well; {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public void reset() {
        mustBeTicker();
        mustBeOpen();
        resetNative(handle);
        events.drop();
    }

    /**
     * Lets the line take the settings that driver.cfg has now, while the simulation ticks. Called by any thread.
     *
     * @return false if the line has them already
     * @throws FieldbusException {@link Status#UNSUPPORTED} if more than the line differs, {@link Status#BAD_CONFIG} and others
     */
    public boolean reload() {
        mustBeOpen();
        return reloadNative(handle);
    }

    /**
     * Retries a call that was refused because another thread's {@link #statistics}, {@link #inject} or {@link #close} was
     * using the driver. Those hold the driver only while they copy what they need, or take it over; after {@code close} the
     * result is {@link Status#CLOSED}.
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
     * Sets all signals that this end writes. Unlike {@link Signal#set} it accepts NaN and infinities: for NaN the
     * native library sends the signal's fail-safe value, and counts it.
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
     * Reads all signals that this end reads.
     *
     * @param into gets one value per signal that is not {@link Signal#isWritten}, in the order of
     *     {@link #signals}; may be longer
     * @return the number of values read
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
     * The age of the data at the last exchange; with several stations, that of the oldest.
     *
     * @return nanoseconds; {@link Long#MAX_VALUE} if nothing has arrived yet
     */
    public long ageNanos() {
        return header(Layout.WORD_AGE);
    }

    /**
     * How many bus cycles had arrived by the last exchange.
     *
     * @return counts from 0
     */
    public long sequence() {
        return header(Layout.WORD_SEQUENCE);
    }

    /**
     * The simulation time up to which the simulation may run after the last exchange.
     *
     * @return nanoseconds; on buses that are not stepped, the time that was passed
     */
    public long grantedNanos() {
        return header(Layout.WORD_GRANTED);
    }

    /**
     * Returns true once the bus has ended the run on its own, as virtual time does. Further ticks bring stale values.
     *
     * @return false while the run can continue
     */
    public boolean isOver() {
        return overNative(handle);
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
     * The driver's counters and state: {@code ticks}, {@code fresh}, {@code stale}, {@code state} and more. Not to be
     * called on every tick.
     *
     * @return unmodifiable, in an order fit for printing
     * @throws FieldbusException {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public Map<String, String> statistics() {
        return Collections.unmodifiableMap(StatisticsText.read(statisticsNative(handle)));
    }

    /** For a {@link DriverVector}. */
    boolean isClosed() {
        return closed;
    }

    /** For a {@link DriverVector}: true if this thread may tick the driver. */
    boolean isTickedHere() {
        if (ticker == Thread.currentThread()) {
            return true;
        }
        try {
            becomeTicker();
            return true;
        } catch (FieldbusException e) {
            return false;
        }
    }

    /** For a {@link DriverVector}, and for tests. */
    long handle() {
        return handle;
    }

    /** For the signals of this driver. */
    Conversions conversions() {
        return conversions;
    }

    /**
     * Injects a fault: a wrong value of a signal, or trouble on the line. It can begin at the next exchange.
     *
     * <p>Times and ticks count from this driver's first exchange: {@code at = "2s"} is two seconds after that.
     *
     * @param fault the keys of a {@code [[fault]]} section of driver.cfg, one per line, with or without its header
     * @return the fault, for ending it
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} with every mistake at its line and column;
     *     {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public InjectedFault inject(String fault) {
        Objects.requireNonNull(fault, "fault");
        int id = injectNative(handle, fault);
        // The fault is injected: throwing BUSY now would deny that.
        return Patience.untilIdle(this::faults).stream().filter(one -> one.id() == id).findFirst().orElseThrow();
    }

    /**
     * Names the faults of the simulation's model, which a fault of the kind {@code model} can name. Called before the first
     * tick; a later call replaces the names.
     *
     * @param names names without control characters, each once
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} if a fault of driver.cfg has another name, with the nearest one, or
     *     if a name cannot be used; {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public void declareFaults(List<String> names) {
        modelFaults = ModelFaults.declare(handle, List.copyOf(names));
    }

    /**
     * Hands over the faults of the model that have begun, changed their value or ended since the last call. The model asks
     * after each {@link #exchange()}, or between {@link #receive()} and {@link #send()}, and has a fault in the tick in which it
     * begins. Allocates nothing.
     *
     * @param handler called on this thread, for each change
     * @return how many changes there were
     * @throws FieldbusException {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public int pollFaults(FaultHandler handler) {
        Objects.requireNonNull(handler, "handler");
        mustBeTicker();
        mustBeOpen();
        return modelFaults == null ? 0 : modelFaults.poll(handler);
    }

    /**
     * The faults that were injected by driver.cfg or by {@link #inject}.
     *
     * @return in order of injection; if there were more than 64, those that ended long ago may be missing
     * @throws FieldbusException {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public List<InjectedFault> faults() {
        return InjectedFault.all(this);
    }

    /**
     * The address of the live page on which this driver is shown, for a browser. The address contains the page's token:
     * everyone who has it can force signals.
     *
     * @return empty if driver.cfg has no {@code [page]}
     * @throws FieldbusException {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public Optional<String> page() {
        return Optional.of(pageNative(handle)).filter(address -> !address.isEmpty());
    }

    /**
     * Hands over the pending events, oldest first: the writes of the PLC one by one, on buses that have them.
     *
     * <p>One call hands over at most 4096, the capacity of the driver's ring, so that a PLC which writes faster than the
     * handler works cannot hold up the tick forever. If the handler throws, the event counts as handed over, and the next
     * call continues after it. If the handler closes the driver, it gets no further event.
     *
     * @param handler called on this thread, for each event
     * @return how many events there were
     * @throws FieldbusException {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public int pollEvents(EventHandler handler) {
        Objects.requireNonNull(handler, "handler");
        mustBeTicker();
        mustBeOpen();
        return events.poll(handler);
    }

    /**
     * Closes the connection. Closing twice is allowed.
     *
     * @throws FieldbusException {@link Status#BUSY} if another thread has been in one exchange for 2 s; the driver stays
     *     open
     */
    @Override
    public synchronized void close() {
        if (closed || handle == NO_HANDLE) {
            return;
        }
        try {
            finalizeNative(handle);
        } catch (FieldbusException e) {
            // The native library has closed the driver, unless it was in use.
            if (e.status() != Status.BUSY) {
                closed();
            }
            throw e;
        }
        closed();
    }

    /**
     * Lets another thread become the ticking thread. Called by the ticking thread; does nothing on any other. The
     * hand-over to the next thread must also order memory, as every executor, lock and queue does.
     */
    public void releaseThread() {
        TICKER.compareAndSet(this, Thread.currentThread(), null);
    }

    private void closed() {
        closed = true;
        for (Signal signal : signals) {
            signal.close();
        }
        forgotten.closed = true;
        cleanable.clean();
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

    void mustBeTicker() {
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

    /** The exception for a negative code, with the driver's own reason if it has one. */
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
     * Makes an HTML page from a recording: a chart of the signals, faults, states of the line. The page is self-contained,
     * lies beside the recording, and opens in any browser.
     *
     * @param recording the VCD or CSV file that a {@code [record]} table named; its driver must be closed
     * @param title the page's heading
     * @param statistics the last result of {@link #statistics}; may be empty
     * @param heading the heading of the text
     * @param text shown verbatim; empty for none
     * @return the page
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} with the reason if it cannot be made
     */
    public static Path report(Path recording, String title, Map<String, String> statistics, String heading, String text) {
        NativeLibrary.load();
        return Path.of(reportNative(recording.toString(), title, StatisticsText.write(statistics), heading + "\n" + text));
    }

    /** Opens a driver and describes it to {@code layout}; throws {@link FieldbusException}. */
    static native void lookNative(String driverCfg, Layout layout);

    static native long initializeNative(String driverCfg, String tables, Layout layout);

    /** The tick; returns a status code and never throws, for any handle. */
    static native int xChangeData(long handle);
    /** The receiving half of the tick; as {@link #xChangeData}. */
    static native int receiveNative(long handle);
    /** The sending half of the tick; as {@link #xChangeData}. */
    static native int sendNative(long handle);
    /** Begins the next episode; throws {@link FieldbusException}. */
    static native void resetNative(long handle);
    /** Gives the line the settings of the file; throws {@link FieldbusException}. */
    static native boolean reloadNative(long handle);
    /** Closes a driver; throws {@link FieldbusException}. */
    static native void finalizeNative(long handle);
    /** Closes a driver that was never closed, and logs its name; throws {@link FieldbusException}. */
    static native void forgottenNative(long handle);
    /** Text for {@link StatisticsText}; throws {@link FieldbusException}. */
    static native String statisticsNative(long handle);
    /** Moves events into {@code into}, three longs each; returns their number. Throws {@link FieldbusException}. */
    static native int eventsNative(long handle, long[] into);
    /** Injects the fault that a section describes, and returns its number; throws {@link FieldbusException}. */
    static native int injectNative(long handle, String fault);
    /** Ends a fault at the next exchange; false if it does not exist. Throws {@link FieldbusException}. */
    static native boolean endFaultNative(long handle, int id);
    /** A line per fault, with tabs between its fields; throws {@link FieldbusException}. */
    static native String faultsNative(long handle);

    static native boolean overNative(long handle);
    static native String pageNative(long handle);
    /** Makes the page of a recording; the text's first line is the heading. Throws {@link FieldbusException}. */
    static native String reportNative(String recording, String title, String statistics, String text);
    /** Does nothing: the cost of a native call, the baseline of the benchmarks. */
    static native int emptyNative();
}
