package tickbus.petri.page;

import com.sun.net.httpserver.Headers;
import com.sun.net.httpserver.HttpExchange;
import com.sun.net.httpserver.HttpServer;
import java.io.IOException;
import java.io.InputStream;
import java.io.OutputStream;
import java.net.InetAddress;
import java.net.InetSocketAddress;
import java.net.URI;
import java.net.UnknownHostException;
import java.nio.charset.StandardCharsets;
import java.util.List;
import java.util.Map;
import java.util.UUID;
import tickbus.petri.draw.NetSvg;
import tickbus.petri.run.NetWatch;
import tickbus.petri.run.RunningNet;

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
 * <p>The page only shows: nobody can change anything by it. Its own threads (daemons) serve it, at most 30 times a second
 * and only while somebody looks; the thread that runs the nets never waits for it. Up to {@value #MOST_VIEWERS} viewers see
 * it at once. Requests under another name than that of the address, and those from a page of another site, are refused. The
 * page needs the JDK's module {@code jdk.httpserver}.
 */
public final class NetPage implements AutoCloseable {
    private static final int MOST_VIEWERS = 16;
    /** Threads in addition to the viewers', for the files of the page. */
    private static final int MORE_THREADS = 8;
    /** How long a client may read or write. */
    private static final long PATIENCE_NANOS = 10_000_000_000L;
    private static final long LONGEST_END_MILLIS = 2000;
    private static final int OK = 200;
    private static final int FORBIDDEN = 403;
    private static final int NOT_FOUND = 404;
    private static final int NOT_ALLOWED = 405;
    private static final int BUSY = 503;
    private static final String POLICY = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
        + "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
    private static final Map<String, String> TYPES = Map.of("/", "text/html; charset=utf-8", "/page.css",
        "text/css; charset=utf-8", "/page.js", "text/javascript; charset=utf-8");

    private final String run = UUID.randomUUID().toString();
    private final String title;
    private final String name;
    private final List<NetWatch> watches;
    private final Workers workers;
    private final Feed feed;
    private final Guard guard;
    private final HttpServer server;
    private final Thread looker;
    private byte[] nets;

    private NetPage(String name, InetSocketAddress at, String title, long patienceNanos, List<NetWatch> watches) throws IOException {
        this.name = name;
        this.title = title;
        this.watches = watches;
        workers = new Workers(MOST_VIEWERS + MORE_THREADS, patienceNanos);
        feed = new Feed(run, watches, workers);
        guard = new Guard(name);
        server = HttpServer.create(at, 0);
        server.setExecutor(workers);
        server.createContext("/", this::answer);
        // The server's own thread is a daemon if the thread that starts it is one.
        join(Workers.start(server::start, "start of a net page"));
        looker = Workers.start(feed, "net page");
    }

    /**
     * Serves a page until it is closed.
     *
     * @param address host and port, such as {@code 127.0.0.1:8080} for this computer alone or {@code 0.0.0.0:8080} for every
     *     one that can reach it; the system chooses port 0
     * @param title the page's heading
     * @param watches the nets on the page; closed by the caller
     * @throws IllegalArgumentException if the address is invalid
     * @throws IOException if the address is not available
     */
    public static NetPage open(String address, String title, NetWatch... watches) throws IOException {
        return open(address, title, PATIENCE_NANOS, List.of(watches));
    }

    static NetPage open(String address, String title, long patienceNanos, List<NetWatch> watches) throws IOException {
        int colon = address.lastIndexOf(':');
        String host = address.substring(0, Math.max(0, colon));
        int port = -1;
        try {
            port = Integer.parseInt(address.substring(colon + 1));
        } catch (NumberFormatException none) {
            // The message below says what was expected.
        }
        boolean open = host.contains(":") && !host.matches("\\[.*]");
        if (host.isEmpty() || open || port < 0 || port > 65_535) {
            throw new IllegalArgumentException("the page's address '" + address + "': expected a host and a port, such as "
                + "127.0.0.1:8080 or [::1]:8080");
        }
        InetSocketAddress at;
        try {
            at = new InetSocketAddress(InetAddress.getByName(host), port);
        } catch (UnknownHostException e) {
            throw new IOException("the page cannot be served at " + address + ": there is no host " + host + "; give one of this "
                + "computer's addresses", e);
        }
        try {
            return new NetPage(host, at, title, patienceNanos, watches);
        } catch (IOException e) {
            throw new IOException("the page cannot be served at " + address + ": " + e.getMessage()
                + "; give another port, or 0 for any", e);
        }
    }

    /** The page's address; for a page at every address of this computer, its address on this computer. */
    public URI address() {
        InetSocketAddress at = server.getAddress();
        String host = at.getAddress().isAnyLocalAddress() ? "127.0.0.1" : name;
        return URI.create("http://" + host + ":" + at.getPort() + "/");
    }

    /** Closes the page and informs its viewers that the displayed state is old. */
    @Override
    public void close() {
        feed.close();
        looker.interrupt();
        server.stop(0);
        workers.close();
        // Another page can ask the same watches from now on.
        join(looker);
    }

    private static void join(Thread thread) {
        try {
            thread.join(LONGEST_END_MILLIS);
        } catch (InterruptedException e) {
            Thread.currentThread().interrupt();
        }
    }

    private void answer(HttpExchange exchange) throws IOException {
        try (exchange) {
            workers.busy();
            Headers headers = exchange.getResponseHeaders();
            headers.set("Cache-Control", "no-store");
            headers.set("Content-Security-Policy", POLICY);
            headers.set("Referrer-Policy", "no-referrer");
            headers.set("X-Content-Type-Options", "nosniff");
            headers.set("Cross-Origin-Resource-Policy", "same-origin");
            String refusal = guard.refusal(exchange.getRequestHeaders());
            String path = exchange.getRequestURI().getPath();
            if (refusal != null) {
                refuse(exchange, FORBIDDEN, refusal);
            } else if (!exchange.getRequestMethod().equals("GET")) {
                headers.set("Allow", "GET");
                refuse(exchange, NOT_ALLOWED, "this page only shows; use GET");
            } else if (path.equals("/events") || path.equals("/state")) {
                watch(exchange, path.equals("/events"));
            } else if (path.equals("/nets")) {
                send(exchange, OK, "application/json", nets());
            } else if (path.equals("/net.css")) {
                send(exchange, OK, "text/css; charset=utf-8", NetSvg.style().getBytes(StandardCharsets.UTF_8));
            } else if (path.equals("/style.css") || TYPES.containsKey(path)) {
                send(exchange, OK, TYPES.getOrDefault(path, "text/css; charset=utf-8"), file(path));
            } else {
                refuse(exchange, NOT_FOUND, "there is no " + path + " here");
            }
        }
    }

    private static byte[] file(String path) throws IOException {
        try (InputStream file = NetPage.class.getResourceAsStream(path.equals("/") ? "page.html" : path.substring(1))) {
            return file.readAllBytes();
        }
    }

    /** Laying out a large net takes a while, so the first viewer triggers it. */
    private synchronized byte[] nets() {
        if (nets == null) {
            List<RunningNet> all = watches.stream().flatMap(watch -> watch.nets().stream()).toList();
            nets = Json.nets(run, title, all).getBytes(StandardCharsets.UTF_8);
        }
        return nets;
    }

    private void watch(HttpExchange exchange, boolean forGood) throws IOException {
        long known = feed.enter(MOST_VIEWERS);
        if (known < 0) {
            refuse(exchange, BUSY, MOST_VIEWERS + " viewers look already; close one of them");
            return;
        }
        try {
            workers.free();
            Feed.State state = feed.after(known);
            if (!forGood && state != null) {
                workers.busy();
                send(exchange, OK, "application/json", state.json());
                return;
            }
            exchange.getResponseHeaders().set("Content-Type", "text/event-stream");
            exchange.sendResponseHeaders(OK, 0);
            OutputStream out = exchange.getResponseBody();
            while (state != null) {
                workers.busy();
                out.write(state.event());
                out.flush();
                workers.free();
                state = feed.after(state.version());
            }
        } catch (InterruptedException e) {
            // The client took nothing for too long, or the page is closed: the connection ends with this exchange.
        } finally {
            feed.leave();
        }
    }

    private static void refuse(HttpExchange exchange, int code, String why) throws IOException {
        send(exchange, code, "application/json", Json.refusal(code, why).getBytes(StandardCharsets.UTF_8));
    }

    private static void send(HttpExchange exchange, int code, String type, byte[] body) throws IOException {
        exchange.getResponseHeaders().set("Content-Type", type);
        exchange.sendResponseHeaders(code, body.length);
        exchange.getResponseBody().write(body);
    }
}
