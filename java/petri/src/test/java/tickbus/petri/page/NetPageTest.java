package tickbus.petri.page;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.BufferedReader;
import java.io.IOException;
import java.io.InputStream;
import java.io.InputStreamReader;
import java.net.Socket;
import java.net.URI;
import java.nio.charset.StandardCharsets;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.atomic.AtomicInteger;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Condition;
import tickbus.petri.run.NetState;
import tickbus.petri.run.NetWatch;
import tickbus.petri.run.RunningNet;
import tickbus.petri.run.Stepper;

@Timeout(120)
class NetPageTest {
    /** A client that sends arbitrary bytes, which no library would. */
    private static final class Client implements AutoCloseable {
        final Socket socket;
        final BufferedReader in;

        Client(NetPage page, String request) throws IOException {
            URI address = page.address();
            socket = new Socket("127.0.0.1", address.getPort());
            socket.setSoTimeout(60_000);
            socket.getOutputStream().write(request.getBytes(StandardCharsets.UTF_8));
            in = new BufferedReader(new InputStreamReader(socket.getInputStream(), StandardCharsets.UTF_8));
        }

        static Client get(NetPage page, String path, String... headers) throws IOException {
            return new Client(page, "GET " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                + String.join("", List.of(headers).stream().map(one -> one + "\r\n").toList()) + "\r\n");
        }

        String status() throws IOException {
            String line = in.readLine();
            return line == null ? "closed" : line.split(" ")[1];
        }

        /** The next state of an event stream. */
        String event() throws IOException {
            String line = in.readLine();
            while (line != null && !line.startsWith("data: ")) {
                line = in.readLine();
            }
            return line;
        }

        @Override
        public void close() throws IOException {
            socket.close();
        }
    }

    private static String status(NetPage page, String request) throws IOException {
        try (Client client = new Client(page, request)) {
            return client.status();
        }
    }

    @Test
    void onlyRequestsThatAreMeantForThisPageAreAnswered() throws IOException {
        try (Scanning scanning = new Scanning(); NetPage page = NetPage.open("127.0.0.1:0", "t", scanning.watch)) {
            int port = page.address().getPort();
            for (String host : List.of("127.0.0.1", "127.0.0.1:" + port, "localhost:1", "LOCALHOST", "[::1]:8", "192.168.0.20")) {
                assertEquals("200", status(page, "GET /nets HTTP/1.1\r\nHost: " + host + "\r\n\r\n"), host);
            }
            for (String host : List.of("evil.example", "127.0.0.1.evil.example", "localhost.evil.example:80", ":80",
                    "127.0.0.1:80@evil.example", "[::1].evil.example")) {
                assertEquals("403", status(page, "GET /nets HTTP/1.1\r\nHost: " + host + "\r\n\r\n"), host);
            }
            assertEquals("403", status(page, "GET / HTTP/1.0\r\n\r\n"));
            String own = "GET / HTTP/1.1\r\nHost: 127.0.0.1:80\r\n";
            assertEquals("200", status(page, own + "Origin: http://127.0.0.1:80\r\n\r\n"));
            for (String origin : List.of("http://evil.example", "http://127.0.0.1:81", "https://127.0.0.1:80", "null", "")) {
                assertEquals("403", status(page, own + "Origin: " + origin + "\r\n\r\n"), origin);
            }
            assertEquals("403", status(page, own + "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: no-cors\r\n\r\n"));
            assertEquals("200", status(page, own + "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate\r\n\r\n"));
        }
    }

    @Test
    void nothingCanBeChangedAndOnlyItsOwnFilesAreThere() throws IOException {
        try (Scanning scanning = new Scanning(); NetPage page = NetPage.open("127.0.0.1:0", "t", scanning.watch)) {
            for (String method : List.of("PUT", "POST", "DELETE", "OPTIONS")) {
                assertEquals("405", status(page, method + " /state HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 0\r\n\r\n"));
            }
            for (String path : List.of("/x", "/../pom.xml", "/NetPage.class", "/page.html", "//page.js")) {
                assertEquals("404", status(page, "GET " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"), path);
            }
            for (String path : List.of("/", "/page.js", "/page.css", "/style.css", "/net.css", "/nets", "/state")) {
                assertEquals("200", status(page, "GET " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"), path);
            }
        }
    }

    @Test
    void anAddressThatIsNoneOrInUseIsExplained() throws IOException {
        try (Scanning scanning = new Scanning(); NetPage page = NetPage.open("127.0.0.1:0", "t", scanning.watch)) {
            String taken = "127.0.0.1:" + page.address().getPort();
            IOException inUse = assertThrows(IOException.class, () -> NetPage.open(taken, "t", scanning.watch));
            assertTrue(inUse.getMessage().startsWith("the page cannot be served at " + taken), inUse.getMessage());
            for (String wrong : List.of("", "8080", "localhost", "localhost:", ":80", "localhost:99999", "::1:80", "a:-1")) {
                var none = assertThrows(IllegalArgumentException.class, () -> NetPage.open(wrong, "t", scanning.watch), wrong);
                assertTrue(none.getMessage().contains("'" + wrong + "': expected a host and a port"), none.getMessage());
            }
        }
    }

    @Test
    void oneWhoReadsNothingHoldsNeitherTheNetsNorTheOthers() throws IOException {
        try (Scanning scanning = new Scanning(); NetPage page = NetPage.open("127.0.0.1:0", "t", scanning.watch);
                Client deaf = Client.get(page, "/events"); Client other = Client.get(page, "/events")) {
            scanning.part(true);
            assertEquals("200", deaf.status());
            long scans = scanning.scans();
            String first = other.event();
            String last = first;
            for (int i = 0; i < 30; i++) {
                last = other.event();
            }
            assertTrue(!last.equals(first) && last.contains("\"phases\""), last);
            assertTrue(scanning.scans() > scans);
        }
    }

    @Test
    void thereAreOnlySoManyViewersAndOneWhoGoesMakesRoom() throws IOException {
        try (Scanning scanning = new Scanning(); NetPage page = NetPage.open("127.0.0.1:0", "t", scanning.watch)) {
            List<Client> all = new ArrayList<>();
            for (int i = 0; i < 16; i++) {
                Client one = Client.get(page, "/events");
                all.add(one);
                assertEquals("200", one.status());
            }
            try (Client late = Client.get(page, "/events")) {
                assertEquals("503", late.status());
            }
            assertEquals("200", status(page, "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"));
            all.remove(0).close();
            String status = "503";
            while (status.equals("503")) {
                // The viewer's place becomes free when the next state cannot be sent.
                all.get(0).event();
                status = status(page, "GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
            }
            assertEquals("200", status);
            for (Client one : all) {
                one.close();
            }
        }
    }

    @Test
    void whoNeverEndsARequestLosesTheConnection() throws IOException {
        try (Scanning scanning = new Scanning(); NetPage page = NetPage.open("127.0.0.1:0", "t", 100_000_000, List.of(scanning.watch));
                Client slow = new Client(page, "GET / HTTP/1.1\r\nHost: 127")) {
            InputStream in = slow.socket.getInputStream();
            int end;
            try {
                end = in.read();
            } catch (IOException reset) {
                end = -1;
            }
            assertEquals(-1, end);
            // On a busy computer another request can take as long.
            String status = "closed";
            while (status.equals("closed")) {
                status = status(page, "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
            }
            assertEquals("200", status);
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
            try (Client viewer = Client.get(page, "/events")) {
                assertEquals("200", viewer.status());
                int before = net.copies.get();
                long begun = System.nanoTime();
                while (System.nanoTime() - begun < 1_000_000_000L) {
                    watch.offer();
                }
                int asked = net.copies.get() - before;
                assertTrue(asked > 0 && asked <= 31, asked + " in a second");
                String event = firstOfARunNet(viewer);
                assertTrue(event.contains("\"tokens\":[1,0,0,7]"), event);
            }
        }
    }

    @Test
    void everyNameIsWrittenAsJsonHasIt() throws IOException {
        Counting net = new Counting(PetriNet.named("\"</script>\\").place("x", 1).build());
        try (NetPage page = NetPage.open("127.0.0.1:0", "t", NetWatch.of(List.of(net)));
                Client client = Client.get(page, "/nets", "Connection: close")) {
            assertEquals("200", client.status());
            String nets = String.join("\n", client.in.lines().toList());
            assertTrue(nets.contains("\"name\":\"\\\"</script>\\\\\""), nets);
            assertTrue(nets.contains("[\"a \\\"b\\\" \\\\ \\u0001 \\u2028 \\ud83d\\ude00\"]"), nets);
        }
    }

    /** The first event after the net has run. */
    private static String firstOfARunNet(Client viewer) throws IOException {
        String event = viewer.event();
        while (event.contains("[null]")) {
            event = viewer.event();
        }
        return event;
    }

    @Test
    void aPageIsClosedWhileSomebodyLooks() throws IOException {
        try (Scanning scanning = new Scanning()) {
            NetPage page = NetPage.open("127.0.0.1:0", "t", scanning.watch);
            try (Client viewer = Client.get(page, "/events")) {
                assertTrue(firstOfARunNet(viewer).contains("\"nets\":[{"));
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
            try (NetPage again = NetPage.open("127.0.0.1:" + page.address().getPort(), "t", scanning.watch)) {
                assertEquals("200", status(again, "GET /state HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"));
            }
        }
    }
}
