package tickbus;

import java.net.URI;

/**
 * Petri nets on the live page of this process, as JSON that docs/petri.md describes. {@code tickbus.petri.page.NetPage} of
 * the module {@code org.tickbus.petri} is made of it, and is what most programs use.
 *
 * <p>A program hands over the drawings once, and then states:
 *
 * <pre>{@code
 * nets.draw(drawings);
 * while (running) {
 *     if (nets.isWanted(100_000_000)) {
 *         nets.put(states);
 *     }
 * }
 * }</pre>
 *
 * <p>Any thread may call any method. None of them waits for a viewer, but {@link #isWanted} if it is told to.
 */
public final class LiveNets implements AutoCloseable {
    private final long handle;
    private final URI address;
    private boolean closed;

    private LiveNets(long handle) {
        this.handle = handle;
        address = URI.create(pageNative(handle));
    }

    /**
     * Shows nets under a heading. The page is that of the drivers if one of them has a page; otherwise it is served at this
     * address until it is closed.
     *
     * @param address host and port, such as {@code 127.0.0.1:8080} for this computer alone; the system chooses port 0
     * @param title the heading
     * @return the nets, to be closed by the caller
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} if the address is invalid, {@link Status#BUS_FAILED} if it is not
     *     available, {@link Status#UNSUPPORTED} if the native library was built without pages
     */
    public static LiveNets open(String address, String title) {
        NativeLibrary.load();
        return new LiveNets(openNative(address, title));
    }

    /**
     * The address of the page with the nets. It has no token: the page of nets only shows.
     *
     * @return the address, for a browser
     */
    public URI address() {
        return address;
    }

    /**
     * Hands over the names, conditions and drawings of the nets, once.
     *
     * @param json the nets
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} with what is wrong
     */
    public void draw(String json) {
        drawNative(handle, json);
    }

    /**
     * Returns true if a state is wanted: somebody looks, and the last state is 33 ms old. Otherwise waits for that.
     *
     * @param patienceNanos waits at most this long; with 0 it never waits
     * @return false if it was in vain
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} if the nets are closed
     */
    public boolean isWanted(long patienceNanos) {
        return wantedNative(handle, patienceNanos);
    }

    /**
     * Hands over the present states of the nets.
     *
     * @param json the states
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} with what is wrong
     */
    public void put(String json) {
        putNative(handle, json);
    }

    /** Takes the nets from the page. */
    @Override
    public synchronized void close() {
        if (!closed) {
            closed = true;
            closeNative(handle);
        }
    }

    private static native long openNative(String address, String title);

    private static native String pageNative(long handle);

    private static native void drawNative(long handle, String json);

    private static native boolean wantedNative(long handle, long nanos);

    private static native void putNative(long handle, String json);

    private static native void closeNative(long handle);
}
