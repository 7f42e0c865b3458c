package tickbus.petri.page;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.BufferedReader;
import java.io.IOException;
import java.io.InputStreamReader;
import java.lang.reflect.InvocationTargetException;
import java.net.HttpURLConnection;
import java.net.Socket;
import java.net.URL;
import java.net.URLClassLoader;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.concurrent.atomic.AtomicInteger;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.io.TempDir;
import tickbus.Tickbus;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Condition;
import tickbus.petri.run.NetState;
import tickbus.petri.run.NetWatch;
import tickbus.petri.run.RunningNet;
import tickbus.petri.run.Stepper;

/** The tests of the page itself are in crates/tools/net-page and crates/tools/web. */
@Tag("native")
@Timeout(120)
class NetPageTest {
    /** A viewer that does not read unless it is told to, which no library would. */
    private static final class Client implements AutoCloseable {
        private final Socket socket;
        private final BufferedReader in;

        Client(NetPage page, String path) throws IOException {
            String base = page.address().getPath();
            socket = new Socket("127.0.0.1", page.address().getPort());
            socket.setSoTimeout(60_000);
            socket.getOutputStream().write(("GET " + base + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n")
                .getBytes(StandardCharsets.UTF_8));
            in = new BufferedReader(new InputStreamReader(socket.getInputStream(), StandardCharsets.UTF_8));
        }

        /** The next state of an event stream; null at its end. */
        String event() throws IOException {
            String line = in.readLine();
            while (line != null && !line.startsWith("data: {")) {
                line = in.readLine();
            }
            return line;
        }

        /** The next state with this in it. */
        String eventWith(String part) throws IOException {
            String event = event();
            while (!event.contains(part)) {
                event = event();
            }
            return event;
        }

        String rest() {
            return String.join("\n", in.lines().toList());
        }

        @Override
        public void close() throws IOException {
            socket.close();
        }
    }

    @Test
    void anAddressThatIsNoneOrInUseIsExplained() throws IOException {
        try (Scanning scanning = new Scanning(); var taken = new java.net.ServerSocket(0)) {
            String address = "127.0.0.1:" + taken.getLocalPort();
            IOException inUse = assertThrows(IOException.class, () -> NetPage.open(address, "t", scanning.watch));
            assertTrue(inUse.getMessage().contains("the page cannot be served on " + address), inUse.getMessage());
            for (String wrong : List.of("", "8080", "localhost", "localhost:", ":80", "localhost:99999", "::1:80", "a:-1")) {
                var none = assertThrows(IllegalArgumentException.class, () -> NetPage.open(wrong, "t", scanning.watch), wrong);
                assertTrue(none.getMessage().contains("the page's address: "), none.getMessage());
            }
        }
    }

    @Test
    void withoutTickbusAnExceptionSaysWhatToAdd() throws Exception {
        URL here = NetPage.class.getProtectionDomain().getCodeSource().getLocation();
        try (URLClassLoader alone = new URLClassLoader(new URL[] {here}, ClassLoader.getPlatformClassLoader())) {
            Class<?> watch = alone.loadClass(NetWatch.class.getName());
            Object none = java.lang.reflect.Array.newInstance(watch, 0);
            var open = alone.loadClass(NetPage.class.getName()).getMethod("open", String.class, String.class, none.getClass());
            var thrown = assertThrows(InvocationTargetException.class, () -> open.invoke(null, "127.0.0.1:0", "t", none));
            assertTrue(thrown.getCause() instanceof IllegalStateException, thrown.getCause().toString());
            assertTrue(thrown.getCause().getMessage().contains("add org.tickbus:tickbus"), thrown.getCause().getMessage());
        }
    }

    @Test
    void aViewerWhoReadsNothingHoldsNeitherTheNetsNorTheOthers() throws IOException {
        try (Scanning scanning = new Scanning(); NetPage page = NetPage.open("127.0.0.1:0", "t", scanning.watch);
                Client deaf = new Client(page, "/events"); Client other = new Client(page, "/events")) {
            scanning.part(true);
            long scans = scanning.scans();
            assertTrue(deaf.socket.isConnected());
            String first = other.eventWith("\"phases\"");
            String last = first;
            for (int i = 0; i < 30; i++) {
                last = other.event();
            }
            assertTrue(!last.equals(first) && last.contains("\"phases\""), last);
            assertTrue(scanning.scans() > scans);
        }
    }

    @Test
    void theNetsOfSeveralProgramsAreOnThePageOfTheDrivers(@TempDir Path folder) throws IOException {
        Path file = Files.writeString(folder.resolve("driver.cfg"), """
            [driver]
            id = 1
            name = "Line"

            [fieldbus]
            kind = "loopback"
            program = "mirror"
            mode = "stepped"
            scan = "1ms"

            [page]
            listen = "127.0.0.1:0"

            [[signal]]
            name = "in"
            address = "%IB0"
            """);
        try (Scanning one = new Scanning(); Scanning two = new Scanning(); NetPage first = NetPage.open("127.0.0.1:0", "One", one.watch)) {
            assertEquals("/nets", first.address().getPath());
            var start = (HttpURLConnection) first.address().resolve("/").toURL().openConnection();
            assertEquals(200, start.getResponseCode());
            assertEquals("/nets", start.getURL().getPath(), "there is no other page yet");
            try (Tickbus bus = Tickbus.open(file); NetPage second = NetPage.open("127.0.0.1:0", "Two", two.watch)) {
                String page = bus.page().orElseThrow();
                assertTrue(page.startsWith(first.address().resolve("/#token=").toString()), page);
                assertEquals(first.address(), second.address());
                assertFalse(second.address().toString().contains("token"));
                try (Client client = new Client(first, "/events")) {
                    String both = client.eventWith("\"title\":\"Two\"");
                    assertTrue(both.contains("\"title\":\"One\""), both);
                }
            }
            try (Client client = new Client(first, "/state")) {
                String alone = client.rest();
                assertTrue(alone.contains("\"One\"") && !alone.contains("\"Two\""), alone);
            }
        }
    }

    /** Counts the requests for its state. */
    private static final class Counting implements RunningNet {
        final Stepper stepper;
        final AtomicInteger copies = new AtomicInteger();

        Counting(PetriNet net) {
            stepper = new Stepper(net, 0);
        }

        @Override
        public PetriNet net() {
            return stepper.net();
        }

        @Override
        public List<String> inputNames() {
            return List.of("a \"b\" \\ \u0001 \u2028 \uD83D\uDE00");
        }

        @Override
        public List<String> outputNames() {
            return List.of();
        }

        @Override
        public Condition condition(int transition) {
            return null;
        }

        @Override
        public void copyTo(NetState state) {
            copies.incrementAndGet();
            stepper.copyTo(state);
        }
    }

    @Test
    void aStateIsAskedForOnlyWhileSomebodyLooksAndAtMostThirtyTimesASecond() throws IOException {
        Counting net = new Counting(Scanning.NET);
        NetWatch watch = NetWatch.of(List.of(net));
        try (NetPage page = NetPage.open("127.0.0.1:0", "t", watch)) {
            for (int i = 0; i < 1000; i++) {
                watch.offer();
            }
            assertEquals(0, net.copies.get());
            try (Client viewer = new Client(page, "/events")) {
                viewer.event();
                int before = net.copies.get();
                long begun = System.nanoTime();
                while (System.nanoTime() - begun < 1_000_000_000L) {
                    watch.offer();
                }
                int asked = net.copies.get() - before;
                assertTrue(asked > 0 && asked <= 31, asked + " in a second");
                viewer.eventWith("\"tokens\":[1,0,0,7]");
            }
        }
    }

    @Test
    void everyNameComesToThePage() throws IOException {
        Counting net = new Counting(PetriNet.named("\"</script>\\ \uD83D").place("<img src=x onerror=a()>", 1).build());
        try (NetPage page = NetPage.open("127.0.0.1:0", "\"t\"\n", NetWatch.of(List.of(net)));
                Client viewer = new Client(page, "/events")) {
            String event = viewer.eventWith("\"drawn\":true");
            assertTrue(event.contains("\"title\":\"\\\"t\\\"\\n\""), event);
            String number = event.replaceFirst(".*\"id\":(\\d+).*", "$1");
            try (Client client = new Client(page, "/layout/" + number)) {
                String nets = client.rest();
                assertTrue(nets.contains("\"name\":\"\\\"</script>\\\\ \uFFFD\""), nets);
                assertTrue(nets.contains("[\"a \\\"b\\\" \\\\ \\u0001 \u2028 \uD83D\uDE00\"]"), nets);
                assertTrue(nets.contains("&lt;img src=x onerror=a()&gt;"), nets);
            }
        }
    }

    @Test
    void aPageIsClosedWhileSomebodyLooks() throws IOException {
        try (Scanning scanning = new Scanning()) {
            NetPage page = NetPage.open("127.0.0.1:0", "t", scanning.watch);
            try (Client viewer = new Client(page, "/events")) {
                viewer.eventWith("\"phases\"");
                page.close();
                page.close();
                String line = "";
                while (line != null) {
                    try {
                        line = viewer.event();
                    } catch (IOException reset) {
                        line = null;
                    }
                }
            }
            try (NetPage again = NetPage.open("127.0.0.1:" + page.address().getPort(), "t", scanning.watch);
                    Client viewer = new Client(again, "/events")) {
                viewer.eventWith("\"phases\"");
            }
        }
    }
}
