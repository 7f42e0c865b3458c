package tickbus;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertNotEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.net.URI;
import java.net.http.HttpClient;
import java.net.http.HttpRequest;
import java.net.http.HttpRequest.BodyPublishers;
import java.net.http.HttpResponse.BodyHandlers;
import java.nio.file.Path;
import java.util.Optional;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;

@Tag("native")
class LivePageTest {
    private static final HttpClient CLIENT = HttpClient.newHttpClient();

    @TempDir
    Path directory;

    private long now;

    private Tickbus shown(int id) {
        return DriverCfg.mirror(id).fieldbus("[page]\nlisten = \"127.0.0.1:0\"\n")
            .signal("in", "%IB0")
            .signal("out", "%QB0")
            .open(directory);
    }

    private static String get(String page, String path) throws IOException, InterruptedException {
        URI uri = URI.create(page.replaceFirst("/#.*", path));
        return CLIENT.send(HttpRequest.newBuilder(uri).build(), BodyHandlers.ofString()).body();
    }

    private void tick(Tickbus bus) {
        now += 1_000_000;
        bus.exchange(now);
    }

    @Test
    void driversOfOneProcessShareAPageOnWhichSignalsAreForced() throws Exception {
        String page;
        try (Tickbus one = shown(11); Tickbus two = shown(12); Tickbus three = DriverCfg.mirror(13)
                .signal("in", "%IB0").open(directory)) {
            page = one.page().orElseThrow();
            assertTrue(page.matches("http://127\\.0\\.0\\.1:\\d+/#token=[0-9a-f]{32}"), page);
            assertEquals(Optional.of(page), two.page());
            assertEquals(Optional.empty(), three.page(), "its driver.cfg asks for none");
            String signals = get(page, "/signals");
            assertTrue(signals.contains("\"Driver 11\"") && signals.contains("\"Driver 12\""), signals);
            assertTrue(!signals.contains("\"Driver 13\""), signals);
            HttpRequest force = HttpRequest.newBuilder(URI.create(page.replaceFirst("/#.*", "/force/12/out")))
                .header("Authorization", "Bearer " + page.substring(page.indexOf('=') + 1))
                .PUT(BodyPublishers.ofString("77")).build();
            assertEquals(200, CLIENT.send(force, BodyHandlers.ofString()).statusCode());
            for (int i = 0; i < 3; i++) {
                tick(two);
            }
            assertEquals(77, two.signal("out").get());
        }
        try (Tickbus again = shown(11)) {
            assertNotEquals(page, again.page().orElseThrow(), "it closed with its last driver");
        }
    }
}
