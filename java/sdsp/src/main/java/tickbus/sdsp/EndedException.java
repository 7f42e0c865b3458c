package tickbus.sdsp;

import java.util.Optional;

/** A run that was broken off, or never began. */
public final class EndedException extends Exception {
    private static final long serialVersionUID = 1L;

    /** Why a run was broken off. The order is that of the codes on the wire. */
    public enum Cause {
        /** The declarations contradict each other. */
        CONFIGURATION,
        /** The server did not let this client take part. */
        REFUSED,
        /** The connection with a client, or with the server, broke. */
        LOST,
        /** A client did not answer in time. */
        HUNG,
        /** A client, or the server, violated the protocol. */
        PROTOCOL,
        /** A client reported that it cannot continue. */
        FAILED,
        /** The server's logic failed. */
        LOGIC,
        /** Somebody stopped the run before a step could be finished. */
        STOPPED,
        /** A system call failed. */
        SYSTEM
    }

    /** The kind of reason. */
    private final Cause cause;
    /** The client to blame; null without one. */
    private final String client;
    /** The number of steps that were committed before. */
    private final long steps;

    EndedException(Cause cause, String client, String reason, long steps) {
        super(cause == Cause.REFUSED
            ? "the server refused this client: " + reason
            : "the run ended " + (steps == 0 ? "before its first step" : "after " + steps + (steps == 1 ? " step" : " steps"))
                + ": " + (client == null ? "" : "client \"" + client + "\" ") + reason);
        this.cause = cause;
        this.client = client;
        this.steps = steps;
    }

    /**
     * The kind of reason; the message has the reason itself.
     *
     * @return one of the kinds
     */
    public Cause cause() {
        return cause;
    }

    /**
     * The client to blame.
     *
     * @return the client's name; empty if no client is to blame
     */
    public Optional<String> client() {
        return Optional.ofNullable(client);
    }

    /**
     * How far the run came.
     *
     * @return the number of steps that were committed before
     */
    public long steps() {
        return steps;
    }
}
