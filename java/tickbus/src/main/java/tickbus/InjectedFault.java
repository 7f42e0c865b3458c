package tickbus;

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

    private final Tickbus bus;
    private final int id;
    private final String name;
    private final String kind;
    private final String what;

    InjectedFault(Tickbus bus, int id, String kind, String name, String what) {
        this.bus = bus;
        this.id = id;
        this.name = name;
        this.kind = kind;
        this.what = what;
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
        return bus.faultState(id);
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
        return bus.faultBegun(id);
    }

    /**
     * Ends the fault at the next exchange, which has the true values again. A fault that has not begun yet never will.
     *
     * @throws FieldbusException as {@link #state}
     */
    public void end() {
        bus.endFault(id);
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
