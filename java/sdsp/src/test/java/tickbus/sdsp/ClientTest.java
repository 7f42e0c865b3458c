package tickbus.sdsp;

import static java.nio.charset.StandardCharsets.UTF_8;
import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertSame;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import com.sun.management.ThreadMXBean;
import java.io.IOException;
import java.lang.management.ManagementFactory;
import java.net.InetAddress;
import java.net.InetSocketAddress;
import java.net.ServerSocket;
import java.nio.ByteBuffer;
import java.time.Duration;
import java.util.ArrayList;
import java.util.List;
import java.util.Optional;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import tickbus.sdsp.EndedException.Cause;

@Timeout(60)
class ClientTest {
    /** Counts: writes what it reads plus one, and fails at a certain value. */
    private static class Counter implements Participant {
        final List<String> steps = new ArrayList<>();

        @Override
        public Declaration declare() {
            return new Declaration("zähler", 3, List.of(new Variable("out", DataType.DINT)), List.of("in"));
        }

        @Override
        public void initial(long[] writes) {
            writes[0] = -1;
        }

        @Override
        public void run(long sequence, long nanos, long[] reads, long[] writes) throws IOException {
            steps.add(sequence + "@" + nanos + ":" + reads[0] + "," + writes[0]);
            if (reads[0] == 13) {
                throw new IOException("13 is too much");
            }
            writes[0] = reads[0] + 1;
        }
    }

    private static void assertDone(long sequence, long value, ByteBuffer frame) {
        assertEquals(17, frame.remaining());
        assertEquals(0x02, frame.get());
        assertEquals(sequence, frame.getLong());
        assertEquals(value, frame.getLong());
    }

    @Test
    void aRunIsPlayedToItsEnd() throws Exception {
        Counter counter = new Counter();
        try (FakeServer server = new FakeServer(s -> {
            ByteBuffer expected = FakeServer.buffer(40).put((byte) 1).put("SDSP".getBytes(UTF_8)).putShort((short) 4).putInt(3)
                .putLong(0).put((byte) 7).put("zähler".getBytes(UTF_8)).putShort((short) 1).put((byte) 9).put((byte) 3)
                .put("out".getBytes(UTF_8)).putShort((short) 1).put((byte) 2).put("in".getBytes(UTF_8));
            assertEquals(expected.flip(), s.receive());
            assertDone(0, -1, s.start(1));
            s.step(1, 0, 7);
            assertDone(1, 8, s.receive());
            s.step(4, 3_000_000, -9);
            assertDone(4, -8, s.receive());
            s.finish(6, 5_000_000, 0xFEL);
        })) {
            Outcome outcome = Client.join(server.address(), counter);
            assertEquals(new Outcome(6, 5_000_000, 0xFE), outcome);
            assertEquals("00000000000000fe", outcome.hashText());
        }
        assertEquals(List.of("1@0:7,-1", "4@3000000:-9,8"), counter.steps);
    }

    /** Asks for the step of its next event, and hears for whom the server waits. */
    private static final class Events extends Counter {
        final List<String> waits = new ArrayList<>();
        private final long[] times = {Long.MIN_VALUE, 2_500_000, 3_000_000, 3_000_001, 0, Long.MAX_VALUE};

        @Override
        public Declaration declare() {
            return Declaration.every("e", Duration.ofMillis(20), List.of(new Variable("out", DataType.DINT)), List.of("in"));
        }

        @Override
        public long nextUpdate() {
            return times[steps.size()];
        }

        @Override
        public void waiting(String forWhom) {
            waits.add(forWhom);
        }
    }

    @Test
    void aSimulationOfEventsAsksForItsNextStepAndKnowsWhomItWaitsFor() throws Exception {
        Events events = new Events();
        try (FakeServer server = new FakeServer(s -> {
            ByteBuffer join = s.receive();
            assertEquals(4, join.getShort(5));
            assertEquals(1, join.getInt(7));
            assertEquals(20_000_000, join.getLong(11));
            s.send(0x85, FakeServer.buffer(50).put("\"plc\" to join".getBytes(UTF_8)));
            assertDone(0, -1, s.start(1));
            long[] wanted = {4, 4, 5, 1, Long.MAX_VALUE / 1_000_000 + 2};
            for (int step = 1; step <= wanted.length; step++) {
                s.step(step, 0, 7);
                ByteBuffer frame = s.receive();
                assertEquals(25, frame.remaining());
                assertEquals(0x04, frame.get());
                assertEquals(step, frame.getLong());
                assertEquals(wanted[step - 1], frame.getLong());
                assertEquals(8, frame.getLong());
                s.send(0x85, FakeServer.buffer(0));
            }
            s.finish(5, 0, 0);
        })) {
            Client.join(server.address(), events);
        }
        assertEquals(List.of("\"plc\" to join", "", "", "", "", ""), events.waits);
        assertThrows(IllegalArgumentException.class,
            () -> Declaration.every("a", Duration.ofNanos(-1), List.of(), List.of()));
        assertThrows(IllegalArgumentException.class, () -> Declaration.every("a", Duration.ZERO, List.of(), List.of()));
    }

    @Test
    void framesInPiecesAreFramesAndSeveralAtOnceAreSeveral() throws Exception {
        try (FakeServer server = new FakeServer(s -> {
            s.receive();
            byte[] start = {10, 0, 0, 0, (byte) 0x81, 1, 0, 0, 0, 0, 0, 0, 0, 9};
            for (byte part : start) {
                s.sendRaw(part);
            }
            assertDone(0, -1, s.receive());
            ByteBuffer both = FakeServer.buffer(29 + 29).putInt(25).put((byte) 0x82).putLong(1).putLong(0).putLong(5)
                .putInt(25).put((byte) 0x83).putLong(1).putLong(0).putLong(2);
            s.sendRaw(both.array());
            assertDone(1, 6, s.receive());
        })) {
            assertEquals(new Outcome(1, 0, 2), Client.join(server.address(), new Counter()));
        }
    }

    @Test
    void manyVariablesFit() throws Exception {
        int count = 20_000;
        List<Variable> writes = new ArrayList<>();
        List<String> reads = new ArrayList<>();
        for (int at = 0; at < count; at++) {
            writes.add(new Variable("w" + at, DataType.LINT));
            reads.add("r" + at);
        }
        Participant mirror = new Participant() {
            @Override
            public Declaration declare() {
                return new Declaration("mirror", 1, writes, reads);
            }

            @Override
            public void initial(long[] slots) {
            }

            @Override
            public void run(long sequence, long nanos, long[] readSlots, long[] writeSlots) {
                System.arraycopy(readSlots, 0, writeSlots, 0, count);
            }
        };
        long[] values = new long[count];
        for (int at = 0; at < count; at++) {
            values[at] = at * 0x1_0000_0001L;
        }
        try (FakeServer server = new FakeServer(s -> {
            s.receive();
            s.start(count);
            s.step(1, 0, values);
            ByteBuffer frame = s.receive();
            frame.position(9);
            long[] answered = new long[count];
            frame.asLongBuffer().get(answered);
            assertArrayEquals(values, answered);
            s.finish(1, 0, 0);
        })) {
            Client.join(server.address(), mirror);
        }
    }

    @Test
    void whoCannotGoOnSaysWhy() throws Exception {
        try (FakeServer server = new FakeServer(s -> {
            s.receive();
            s.start(1);
            s.step(1, 0, 13);
            ByteBuffer frame = s.receive();
            assertEquals(0x03, frame.get());
            assertEquals("13 is too much", UTF_8.decode(frame).toString());
            byte[] reason = "gave up: 13 is too much".getBytes(UTF_8);
            s.send(0x84, FakeServer.buffer(100).put((byte) 6).putLong(0).put((byte) 1).put((byte) 'z').put(reason));
        })) {
            EndedException ended = assertThrows(EndedException.class, () -> Client.join(server.address(), new Counter()));
            assertSame(Cause.FAILED, ended.cause());
            assertEquals(Optional.of("z"), ended.client());
            assertEquals(0, ended.steps());
            assertEquals("the run ended before its first step: client \"z\" gave up: 13 is too much", ended.getMessage());
            assertEquals("13 is too much", ended.getCause().getMessage());
        }
    }

    /** The server gets this reason when a participant throws in its initial values, or in its first step. */
    private static void assertSaid(String reason, boolean inStep, Class<? extends Throwable> told, Throwable thrown) throws Exception {
        Counter counter = new Counter() {
            @Override
            public void initial(long[] writes) {
                if (!inStep) {
                    ClientTest.<RuntimeException>sneak(thrown);
                }
            }

            @Override
            public void run(long sequence, long nanos, long[] reads, long[] writes) {
                ClientTest.<RuntimeException>sneak(thrown);
            }
        };
        try (FakeServer server = new FakeServer(s -> {
            s.receive();
            s.sendStart(1);
            if (inStep) {
                s.receive();
                s.step(1, 0, 7);
            }
            ByteBuffer frame = s.receive();
            assertEquals(0x03, frame.get());
            assertEquals(reason, UTF_8.decode(frame).toString());
            s.send(0x84, FakeServer.buffer(100).put((byte) 6).putLong(0).put((byte) 0).put((byte) 'x'));
        })) {
            assertThrows(told, () -> Client.join(server.address(), counter));
        }
    }

    @SuppressWarnings("unchecked")
    private static <E extends Throwable> void sneak(Throwable thrown) throws E {
        throw (E) thrown;
    }

    @Test
    void aParticipantThatFailsAnywhereSaysWhy() throws Exception {
        assertSaid("no paper", false, EndedException.class, new IllegalStateException("no paper"));
        assertSaid("too deep", false, StackOverflowError.class, new StackOverflowError("too deep"));
        assertSaid("too deep", true, StackOverflowError.class, new StackOverflowError("too deep"));
    }

    private static EndedException endOf(FakeServer.Script script) throws Exception {
        try (FakeServer server = new FakeServer(script)) {
            return assertThrows(EndedException.class, () -> Client.join(server.address(), new Counter()));
        }
    }

    @Test
    void aRefusedClientLearnsWhy() throws Exception {
        EndedException ended = endOf(s -> {
            s.receive();
            s.send(0x84, FakeServer.buffer(100).put((byte) 2).putLong(7).put((byte) 0).put("too late".getBytes(UTF_8)));
        });
        assertSame(Cause.REFUSED, ended.cause());
        assertEquals(Optional.empty(), ended.client());
        assertEquals("the server refused this client: too late", ended.getMessage());
    }

    @Test
    void aServerThatViolatesTheProtocolIsLeftWithTheReason() throws Exception {
        record Case(String part, FakeServer.Script script) {
        }
        for (Case wrong : List.of(
            new Case("unknown kind 0x99", s -> s.send(0x99, FakeServer.buffer(0))),
            new Case("a frame of 0 bytes", s -> s.sendRaw(new byte[4])),
            new Case("a frame of 4294967295 bytes", s -> s.sendRaw((byte) -1, (byte) -1, (byte) -1, (byte) -1)),
            new Case("step 1 out of order", s -> s.step(1, 0, 7)),
            new Case("sent 2 values, expected 1", s -> s.sendStart(2)),
            new Case("too short", s -> s.send(0x83, FakeServer.buffer(23).put(new byte[23]))),
            new Case("unknown cause 10", s -> s.send(0x84, FakeServer.buffer(10).put((byte) 10).put(new byte[9]))),
            new Case("too short", s -> s.send(0x84, FakeServer.buffer(10).put((byte) 1).put(new byte[8]).put((byte) 5))),
            new Case("steps of 0 ns", s -> s.send(0x81, FakeServer.buffer(9).putLong(0).put((byte) 15))),
            new Case("started twice", s -> {
                s.sendStart(1);
                s.sendStart(1);
            }),
            new Case("step 2 out of order", s -> {
                s.sendStart(1);
                s.step(2, 0, 7);
                s.step(2, 0, 7);
            }),
            new Case("sent 0 values, expected 1", s -> {
                s.sendStart(1);
                s.step(1, 0);
            }),
            new Case("ends within a value", s -> {
                s.sendStart(1);
                s.send(0x82, FakeServer.buffer(25).put(new byte[7]).put((byte) 1).put(new byte[17]));
            })
        )) {
            EndedException ended = endOf(s -> {
                s.receive();
                wrong.script.play(s);
                // After its answers so far, the client sends the reason why it leaves.
                while (s.receive().get() != 0x03) {
                    continue;
                }
            });
            assertSame(Cause.PROTOCOL, ended.cause(), wrong.part);
            assertTrue(ended.getMessage().contains("the server violates the protocol: it "), ended.getMessage());
            assertTrue(ended.getMessage().contains(wrong.part), ended.getMessage());
        }
    }

    @Test
    void aLostServerIsReported() throws Exception {
        EndedException ended = endOf(s -> {
            s.receive();
            s.start(1);
        });
        assertSame(Cause.LOST, ended.cause());
        assertTrue(ended.getMessage().contains("the server was lost"), ended.getMessage());
    }

    @Test
    void withoutAServerTheMessageSaysWhatToDo() throws Exception {
        int port;
        try (ServerSocket closed = new ServerSocket(0, 1, InetAddress.getLoopbackAddress())) {
            port = closed.getLocalPort();
        }
        for (InetSocketAddress address : List.of(new InetSocketAddress(InetAddress.getLoopbackAddress(), port),
            InetSocketAddress.createUnresolved("host.invalid", 1))) {
            EndedException ended = assertThrows(EndedException.class, () -> Client.join(address, new Counter()));
            assertSame(Cause.LOST, ended.cause());
            assertTrue(ended.getMessage().contains("start it first"), ended.getMessage());
        }
    }

    @Test
    void anInterruptLeavesTheRun() throws Exception {
        Thread client = Thread.currentThread();
        EndedException ended = endOf(s -> {
            s.receive();
            s.start(1);
            client.interrupt();
            assertThrows(IOException.class, s::receive);
        });
        assertTrue(Thread.interrupted());
        assertSame(Cause.STOPPED, ended.cause());
    }

    @Test
    void whatCannotBeDeclaredIsRefusedAtOnce() {
        assertThrows(IllegalArgumentException.class, () -> new Declaration("a", 0, List.of(), List.of()));
        for (String name : List.of("", "ä".repeat(128))) {
            Participant participant = new RobotPlant() {
                @Override
                public Declaration declare() {
                    return new Declaration("a", 1, List.of(), List.of(name));
                }
            };
            IllegalArgumentException told = assertThrows(IllegalArgumentException.class,
                () -> Client.join(new InetSocketAddress(1), participant));
            assertTrue(told.getMessage().contains("a name has 1 to 255"), told.getMessage());
        }
    }

    @Test
    void stepsMakeNoGarbage() throws Exception {
        assumeTrue(ManagementFactory.getThreadMXBean() instanceof ThreadMXBean, "this JVM counts no allocations");
        ThreadMXBean threads = (ThreadMXBean) ManagementFactory.getThreadMXBean();
        int round = 5_000;
        int rounds = 4;
        long[] least = {Long.MAX_VALUE};
        RobotPlant plant = new RobotPlant() {
            private long before;

            @Override
            public void run(long sequence, long nanos, long[] reads, long[] writes) {
                super.run(sequence, nanos, reads, writes);
                if (sequence % round == 1) {
                    long now = threads.getCurrentThreadAllocatedBytes();
                    // The JVM itself allocates a little now and then; a step that allocates would do so in every round.
                    least[0] = sequence == 1 ? Long.MAX_VALUE : Math.min(least[0], now - before);
                    before = threads.getCurrentThreadAllocatedBytes();
                }
            }
        };
        try (FakeServer server = new FakeServer(s -> {
            s.receive();
            s.start(2);
            for (int step = 1; step <= round * rounds + 1; step++) {
                s.step(step, step * 1_000_000L, 0, 0);
                s.receive();
            }
            s.finish(round * rounds + 1, 0, 0);
        })) {
            Client.join(server.address(), plant);
        }
        assertEquals(0, least[0], "bytes in " + round + " steps");
    }
}
