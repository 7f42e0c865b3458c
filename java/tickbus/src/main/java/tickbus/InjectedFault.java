package tickbus;

/**
 * A fault that was injected into a driver: a signal that is stuck, a cable that is pulled. It came from a
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
 * <p>It can be used by any thread, as {@link Tickbus#statistics} can.
 */
public final class InjectedFault implements AutoCloseable {
    /** Where a fault stands in its life. */
    public enum State {
        /** It has not begun, or may begin again. */
        WAITING,
        /** It does its harm. */
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
     * @return counts from 1, in the order of injection
     */
    public int id() {
        return id;
    }

    /**
     * Its name.
     *
     * @return as its section says, or made from what it does
     */
    public String name() {
        return name;
    }

    /**
     * Its kind.
     *
     * @return as its section says, such as {@code link-down}
     */
    public String kind() {
        return kind;
    }

    /**
     * Where it stands.
     *
     * @return as of the last exchange
     * @throws FieldbusException {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public State state() {
        return bus.faultState(id);
    }

    /**
     * Whether it does its harm.
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
     * Ends it at the next exchange, which has the true values again. A fault that is over, or has not begun, is
     * over then.
     *
     * @throws FieldbusException as {@link #state}
     */
    public void end() {
        bus.endFault(id);
    }

    /** The same as {@link #end}, for a fault that lasts as long as a block; nothing if the driver is closed. */
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
