package tickbus;

/**
 * A fault injected into a driver, such as a stuck signal or a broken line. It comes from a
 * {@code [[fault]]} section of driver.cfg or from {@link Tickbus#inject}.
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
 * <p>It can be used by any thread, like {@link Tickbus#statistics}.
 */
public final class InjectedFault implements AutoCloseable {
    /** The state of a fault. */
    public enum State {
        /** It has not begun, or may begin again. */
        WAITING,
        /** It has its effect. */
        ACTIVE,
        /** It is over for good. */
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
     * Its number.
     *
     * @return numbers from 1, in order of injection
     */
    public int id() {
        return id;
    }

    /**
     * Its name.
     *
     * @return as in its section, or derived from what it does
     */
    public String name() {
        return name;
    }

    /**
     * Its kind.
     *
     * @return as in its section, such as {@code link-down}
     */
    public String kind() {
        return kind;
    }

    /**
     * Its state.
     *
     * @return as of the last exchange
     * @throws FieldbusException {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public State state() {
        return bus.faultState(id);
    }

    /**
     * Whether it has its effect.
     *
     * @return as of the last exchange
     * @throws FieldbusException as {@link #state}
     */
    public boolean isActive() {
        return state() == State.ACTIVE;
    }

    /**
     * How often it has begun.
     *
     * @return 0 for never
     * @throws FieldbusException as {@link #state}
     */
    public long begun() {
        return bus.faultBegun(id);
    }

    /**
     * Ends it at the next exchange, which has the true values again. A fault that has not begun yet never will.
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

    /** Name, kind, and what it does. */
    @Override
    public String toString() {
        return name + " (" + kind + "): " + what;
    }
}
