package tickbus.petri.page;

import java.io.IOException;
import java.net.URI;
import java.util.List;
import tickbus.petri.run.NetWatch;

/**
 * A page that shows running nets live: markings, enabled transitions, the conditions that hold one back, and recent firings.
 *
 * <pre>{@code
 * try (NetPage page = NetPage.open("127.0.0.1:8080", "The press", NetWatch.of(press))) {
 *     System.out.println("see " + page.address());
 *     …
 * }
 * }</pre>
 *
 * <p>The native library of tickbus serves it: the nets are a tab of the live page that drivers of this process have, or the
 * page alone. It needs the jar of {@code org.tickbus:tickbus}, on which this module otherwise does not depend.
 *
 * <p>The page only shows: nobody can change anything by it. A thread (a daemon) hands over the states, at most 30 times a
 * second and only while somebody looks; the thread that runs the nets never waits for it.
 */
public final class NetPage implements AutoCloseable {
    /** The one class that knows tickbus: without the jar it cannot be loaded. */
    private final Feed feed;

    private NetPage(Feed feed) {
        this.feed = feed;
    }

    /**
     * Shows nets until the page is closed. If a driver of this process has a page, the nets are on that one, wherever it is.
     *
     * @param address host and port, such as {@code 127.0.0.1:8080} for this computer alone or {@code 0.0.0.0:8080} for every
     *     one that can reach it; the system chooses port 0
     * @param title the page's heading
     * @param watches the nets on the page; closed by the caller
     * @throws IllegalArgumentException if the address is invalid
     * @throws IllegalStateException if tickbus is not on the class path, or its native library was built without pages
     * @throws IOException if the address is not available
     */
    public static NetPage open(String address, String title, NetWatch... watches) throws IOException {
        try {
            return new NetPage(Feed.open(address, title, List.of(watches)));
        } catch (NoClassDefFoundError e) {
            if (e.getMessage() == null || !e.getMessage().startsWith("tickbus/")) {
                throw e;
            }
            throw new IllegalStateException("tickbus serves the page of nets, and its jar is not there; add "
                + "org.tickbus:tickbus of the same version to the class path (the command looks for it beside its own jar)", e);
        }
    }

    /** The page's address. */
    public URI address() {
        return feed.address();
    }

    /** Takes the nets from the page. */
    @Override
    public void close() {
        feed.close();
    }
}
