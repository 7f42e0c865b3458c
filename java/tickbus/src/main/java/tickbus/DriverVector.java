package tickbus;

import java.nio.file.Path;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.Collections;
import java.util.IdentityHashMap;
import java.util.List;
import java.util.Objects;
import java.util.Set;
import java.util.function.IntFunction;

/**
 * Many drivers that tick in one call: a vectorised environment, with a machine and a PLC in each place.
 *
 * <pre>{@code
 * try (DriverVector plcs = DriverVector.open(Path.of("driver.cfg"), 1024, place -> "")) {
 *     for (long time = 0; training; time += STEP) {
 *         plcs.receive(time);
 *         model.step(plcs.drivers());
 *         plcs.send();
 *     }
 * }
 * }</pre>
 *
 * <p>The drivers tick one after the other on the calling thread. A driver that fails stops no other one: each call returns how
 * many have failed, and {@link #status} has the status of each. Each driver remains usable alone. The rules of {@link Tickbus}
 * about threads hold for each driver: one that another thread ticks has the status {@link Status#BUSY}. Drivers that wait for
 * each other, as two clients of one run on virtual time do, need a thread each.
 *
 * <p>Ticks allocate nothing.
 */
public final class DriverVector implements AutoCloseable {
    /** As many as a process can open. */
    private static final int MOST = 4096;
    private static final int EXCHANGE = 0;
    private static final int RECEIVE = 1;
    private static final int SEND = 2;
    /** The handle of no driver. */
    private static final long NONE = 0;

    private final List<Tickbus> drivers;
    private final long[] handles;
    /** The handles of the drivers that this thread may tick, while it ticks them. */
    private final long[] ticked;
    private final long[] sameTime;
    private final int[] statuses;

    private DriverVector(List<Tickbus> drivers) {
        this.drivers = List.copyOf(drivers);
        this.handles = this.drivers.stream().mapToLong(Tickbus::handle).toArray();
        this.ticked = new long[handles.length];
        this.sameTime = new long[handles.length];
        this.statuses = new int[handles.length];
        Arrays.fill(statuses, Status.STALE.code());
    }

    /**
     * Joins open drivers.
     *
     * @param drivers each at most once; closing the vector closes them
     * @return the vector, with the drivers in this order
     * @throws IllegalArgumentException if a driver is in the list twice, or if there are more than 4096
     */
    public static DriverVector of(List<Tickbus> drivers) {
        mustBePossible(drivers.size());
        Set<Tickbus> seen = Collections.newSetFromMap(new IdentityHashMap<>());
        for (Tickbus driver : drivers) {
            if (!seen.add(Objects.requireNonNull(driver, "driver"))) {
                throw new IllegalArgumentException("driver '" + driver.name() + "' is in the list twice; expected each driver"
                    + " once");
            }
        }
        return new DriverVector(drivers);
    }

    /**
     * Opens a configuration file many times. If one of the drivers cannot be opened, all are closed.
     *
     * @param driverCfg the driver.cfg
     * @param count how many drivers, from 1 to 4096
     * @param tables for each place, from 0, the tables as in {@link Tickbus#open(Path, String)}; the result may be empty
     * @return the vector
     * @throws IllegalArgumentException if the count is out of range
     * @throws FieldbusException as {@link Tickbus#open(Path, String)}
     */
    public static DriverVector open(Path driverCfg, int count, IntFunction<String> tables) {
        if (count < 1) {
            throw new IllegalArgumentException("the count is " + count + "; expected 1 to " + MOST);
        }
        mustBePossible(count);
        List<Tickbus> drivers = new ArrayList<>(count);
        try {
            for (int place = 0; place < count; place++) {
                drivers.add(Tickbus.open(driverCfg, tables.apply(place)));
            }
            return new DriverVector(drivers);
        } catch (RuntimeException | Error e) {
            drivers.forEach(Tickbus::close);
            throw e;
        }
    }

    private static void mustBePossible(int count) {
        if (count > MOST) {
            throw new IllegalArgumentException("the count is " + count + "; a process can open " + MOST + " drivers");
        }
    }

    /**
     * One tick of each driver, as {@link Tickbus#exchange()}.
     *
     * @return how many have failed; {@link #status} tells which
     */
    public int exchange() {
        return tick(EXCHANGE, null);
    }

    /**
     * One tick of each driver at the same simulation time, as {@link Tickbus#exchange(long)}.
     *
     * @param simulationNanos nanoseconds since the simulation began
     * @return how many have failed; {@link #status} tells which
     */
    public int exchange(long simulationNanos) {
        return tickAt(EXCHANGE, simulationNanos);
    }

    /**
     * One tick of each driver at its own simulation time.
     *
     * @param simulationNanos a time for each driver
     * @return how many have failed; {@link #status} tells which
     * @throws IllegalArgumentException if there are more or fewer times than drivers
     */
    public int exchange(long[] simulationNanos) {
        return tick(EXCHANGE, simulationNanos);
    }

    /**
     * Begins a tick of each driver, as {@link Tickbus#receive()}.
     *
     * @return how many have failed; {@link #status} tells which
     */
    public int receive() {
        return tick(RECEIVE, null);
    }

    /**
     * Begins a tick of each driver at the same simulation time, as {@link Tickbus#receive(long)}.
     *
     * @param simulationNanos nanoseconds since the simulation began
     * @return how many have failed; {@link #status} tells which
     */
    public int receive(long simulationNanos) {
        return tickAt(RECEIVE, simulationNanos);
    }

    /**
     * Begins a tick of each driver at its own simulation time.
     *
     * @param simulationNanos a time for each driver
     * @return how many have failed; {@link #status} tells which
     * @throws IllegalArgumentException if there are more or fewer times than drivers
     */
    public int receive(long[] simulationNanos) {
        return tick(RECEIVE, simulationNanos);
    }

    /**
     * Ends the tick of each driver, as {@link Tickbus#send()}.
     *
     * @return how many have failed; {@link #status} tells which
     */
    public int send() {
        return tick(SEND, null);
    }

    private synchronized int tickAt(int half, long simulationNanos) {
        Arrays.fill(sameTime, simulationNanos);
        return tick(half, sameTime);
    }

    private synchronized int tick(int half, long[] times) {
        if (times != null && times.length != handles.length) {
            throw new IllegalArgumentException("there are " + times.length + " times; expected one for each of the "
                + handles.length + " drivers");
        }
        boolean allMine = true;
        for (int place = 0; place < handles.length; place++) {
            boolean mine = drivers.get(place).isTickedHere();
            ticked[place] = mine ? handles[place] : NONE;
            allMine &= mine;
        }
        int failed = tickNative(half, ticked, times, statuses);
        if (!allMine) {
            for (int place = 0; place < handles.length; place++) {
                if (ticked[place] == NONE) {
                    statuses[place] = (drivers.get(place).isClosed() ? Status.CLOSED : Status.BUSY).code();
                }
            }
        }
        return failed;
    }

    /**
     * The status of a driver in the last call: 0 fresh, 1 unchanged, 2 stale, or below 0 the code of its failure.
     *
     * @param place from 0
     * @return as {@link Status#code}
     */
    public int status(int place) {
        return statuses[place];
    }

    /**
     * The drivers.
     *
     * @return unmodifiable, in the order of the places
     */
    public List<Tickbus> drivers() {
        return drivers;
    }

    /**
     * Lets another thread become the ticking thread of each driver, as {@link Tickbus#releaseThread}.
     */
    public void releaseThread() {
        drivers.forEach(Tickbus::releaseThread);
    }

    /**
     * Closes all drivers.
     *
     * @throws FieldbusException as {@link Tickbus#close}, after all others are closed
     */
    @Override
    public void close() {
        FieldbusException first = null;
        for (Tickbus driver : drivers) {
            try {
                driver.close();
            } catch (FieldbusException e) {
                first = first == null ? e : first;
            }
        }
        if (first != null) {
            throw first;
        }
    }

    /** Ticks the drivers of these handles, each of which is in the list once; returns how many have failed. */
    private static native int tickNative(int half, long[] handles, long[] times, int[] statuses);
}
