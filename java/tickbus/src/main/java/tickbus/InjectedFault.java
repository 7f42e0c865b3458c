package tickbus;

import java.util.List;
import java.util.Locale;
import java.util.Optional;
import java.util.stream.Stream;

/**
 * A fault injected into a driver, such as a stuck signal or a broken line, by a {@code [[fault]]} section of driver.cfg or
 * by {@link Tickbus#inject}.
 *
 * <pre>{@code
 * InjectedFault stuck = bus.inject("""
 *     kind   = "stuck"
 *     signal = "LA1 bottom"
 *     value  = true
 *     """);
 * ...
 * stuck.end();
 * }</pre>
 *
 * <p>Any thread can use a fault, as it can call {@link Tickbus#statistics}.
 */
public final class InjectedFault implements AutoCloseable {
    /** The state of a fault. */
    public enum State {
        /** The fault has not begun, or can begin again. */
        WAITING,
        /** The fault has its effect. */
        ACTIVE,
        /** The fault is over for good. */
        OVER
    }

    /** The fields of a fault's line. */
    private static final int ID = 0;
    private static final int STATE = 1;
    private static final int BEGUN = 2;
    private static final int KIND = 3;
    private static final int NAME = 4;
    private static final int WHAT = 5;
    private static final int FIELDS = 6;

    private final Tickbus bus;
    private final int id;
    private final String name;
    private final String kind;
    private final String what;

    private InjectedFault(Tickbus bus, String[] line) {
        this.bus = bus;
        this.id = Integer.parseInt(line[ID]);
        this.name = line[NAME];
        this.kind = line[KIND];
        this.what = line[WHAT];
    }

    /** The faults of a driver, in order of injection. */
    static List<InjectedFault> all(Tickbus bus) {
        return lines(bus).map(line -> new InjectedFault(bus, line)).toList();
    }

    private static Stream<String[]> lines(Tickbus bus) {
        return Tickbus.faultsNative(bus.handle()).lines().map(line -> line.split("\t", FIELDS));
    }

    private Optional<String[]> line() {
        return lines(bus).filter(line -> Integer.parseInt(line[ID]) == id).findFirst();
    }

    /**
     * The fault's number.
     *
     * @return counts from 1, in order of injection
     */
    public int id() {
        return id;
    }

    /**
     * The fault's name.
     *
     * @return as in the fault's section, or derived from its effect
     */
    public String name() {
        return name;
    }

    /**
     * The fault's kind.
     *
     * @return as in the fault's section, such as {@code link-down}
     */
    public String kind() {
        return kind;
    }

    /**
     * The fault's state.
     *
     * @return as of the last exchange
     * @throws FieldbusException {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public State state() {
        return line().map(line -> State.valueOf(line[STATE].toUpperCase(Locale.ROOT))).orElse(State.OVER);
    }

    /**
     * Returns whether the fault has its effect.
     *
     * @return true if active, as of the last exchange
     * @throws FieldbusException as {@link #state}
     */
    public boolean isActive() {
        return state() == State.ACTIVE;
    }

    /**
     * How often the fault has begun.
     *
     * @return 0 for never
     * @throws FieldbusException as {@link #state}
     */
    public long begun() {
        return line().map(line -> Long.parseLong(line[BEGUN])).orElse(0L);
    }

    /**
     * Ends the fault at the next exchange, which has the true values again. A fault that has not begun yet never will.
     *
     * @throws FieldbusException as {@link #state}
     */
    public void end() {
        Tickbus.endFaultNative(bus.handle(), id);
    }

    /** The same as {@link #end}, for try-with-resources; does nothing if the driver is closed. */
    @Override
    public void close() {
        try {
            end();
        } catch (FieldbusException e) {
            if (e.status() != Status.CLOSED) {
                throw e;
            }
        }
    }

    /** Name, kind and effect. */
    @Override
    public String toString() {
        return name + " (" + kind + "): " + what;
    }
}
