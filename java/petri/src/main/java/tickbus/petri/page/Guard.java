package tickbus.petri.page;

import com.sun.net.httpserver.Headers;
import java.util.List;
import java.util.Locale;
import java.util.regex.Pattern;

/**
 * Whether a request is meant for this page, and comes from nowhere else.
 *
 * <p>A page of another site, open in the same browser, can send requests to this machine, but it cannot forge
 * {@code Origin}; by a name of its own that suddenly means this machine (DNS rebinding) it would be of one origin with
 * this page, but then {@code Host} has that name.
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

    /** Null if the request may be answered; otherwise why not. */
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
        // A browser sends no Origin with what another site loads as a picture or a script. To follow a link is another thing.
        List<String> sites = headers.getOrDefault("Sec-Fetch-Site", List.of());
        boolean elsewhere = sites.contains("cross-site") || sites.contains("same-site");
        return elsewhere && !"navigate".equals(only(headers, "Sec-Fetch-Mode")) ? OTHER : null;
    }

    /** By an address, which cannot be rebound, or by its name. The port is not compared: a tunnel may have another one. */
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
