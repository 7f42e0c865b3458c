package tickbus.petri.page;

import com.sun.net.httpserver.Headers;
import java.util.List;
import java.util.Locale;
import java.util.regex.Pattern;

/**
 * Accepts a request only if it is meant for this page and comes from this page.
 *
 * <p>A page of another site, open in the same browser, can send requests to this machine, but it cannot forge {@code
 * Origin}. If the other site's name suddenly resolves to this machine (DNS rebinding), its page has the same origin as this
 * page, but then {@code Host} has that name.
 */
final class Guard {
    private static final Pattern HOST = Pattern.compile("(\\[[^\\[\\]]*]|[^:\\[\\]@/]+)(?::\\d*)?");
    private static final Pattern ADDRESS = Pattern.compile("\\d{1,3}(\\.\\d{1,3}){3}|\\[[0-9a-f:.]*:[0-9a-f:.]*]");
    private static final String OTHER = "the request comes from a page of another site; open the address that was printed";

    /** The name under which the page is served. */
    private final String name;

    Guard(String name) {
        this.name = name.toLowerCase(Locale.ROOT);
    }

    /** Null if the request may be answered; otherwise the reason for the refusal. */
    String refusal(Headers headers) {
        String host = only(headers, "Host");
        if (host == null) {
            return "the request does not say once for which host it is; send one Host header";
        }
        if (!isOwn(host)) {
            return "this page is not served under the name " + host.replaceFirst(":\\d*$", "")
                + "; open it by the computer's IP address, or have it listen under that name";
        }
        String origin = only(headers, "Origin");
        if (headers.containsKey("Origin") && !("http://" + host).equalsIgnoreCase(origin)) {
            return OTHER;
        }
        // A browser sends no Origin with pictures and scripts that another site loads. Following a link is different.
        List<String> sites = headers.getOrDefault("Sec-Fetch-Site", List.of());
        boolean elsewhere = sites.contains("cross-site") || sites.contains("same-site");
        return elsewhere && !"navigate".equals(only(headers, "Sec-Fetch-Mode")) ? OTHER : null;
    }

    /**
     * True for an address, which cannot be rebound, or the page's own name. The port is not compared: a tunnel can have
     * another.
     */
    private boolean isOwn(String host) {
        var parts = HOST.matcher(host.toLowerCase(Locale.ROOT));
        if (!parts.matches()) {
            return false;
        }
        String called = parts.group(1);
        return ADDRESS.matcher(called).matches() || called.equals("localhost") || called.equals(name);
    }

    private static String only(Headers headers, String header) {
        List<String> all = headers.get(header);
        return all != null && all.size() == 1 ? all.get(0) : null;
    }
}
