package tickbus.sdsp;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.BufferedReader;
import java.io.File;
import java.io.IOException;
import java.net.InetSocketAddress;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.CompletionException;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.io.TempDir;
import tickbus.sdsp.EndedException.Cause;

/** The robot of examples/robot in Java, with the server that users have. */
@Tag("native")
@Timeout(120)
class LockStepTest {
    /** The trace hash of the same run in Rust: examples/robot/tests/lock_step.rs has it, too. */
    private static final String HASH = "9e758daaecadc30e";

    @TempDir
    Path folder;

    /** {@code tickbus sync} on a port of its own. */
    private static final class Sync implements AutoCloseable {
        private final Process process;
        private final BufferedReader out;
        private final InetSocketAddress address;

        Sync(Path folder) throws IOException {
            String file = Files.readString(Path.of(System.getProperty("tickbus.root"), "examples", "robot", "robot.toml"));
            Path here = folder.resolve("robot.toml");
            Files.writeString(here, file.replace(":20060", ":0"));
            String command = File.separatorChar == '\\' ? "tickbus.exe" : "tickbus";
            process = new ProcessBuilder(Path.of(System.getProperty("tickbus.native.dir"), command).toString(), "sync",
                here.toString()).redirectError(ProcessBuilder.Redirect.INHERIT).start();
            out = process.inputReader();
            String line = await("sync: listening on ");
            address = new InetSocketAddress("127.0.0.1", Integer.parseInt(line.substring(line.lastIndexOf(':') + 1)));
        }

        /** Waits for a line of its output that begins like this. */
        String await(String begin) throws IOException {
            StringBuilder all = new StringBuilder();
            for (String line = out.readLine(); line != null; line = out.readLine()) {
                if (line.startsWith(begin)) {
                    return line;
                }
                all.append(line).append('\n');
            }
            throw new AssertionError("no line that begins with \"" + begin + "\" in:\n" + all);
        }

        CompletableFuture<Outcome> join(Participant participant) {
            return CompletableFuture.supplyAsync(() -> {
                try {
                    return Client.join(address, participant);
                } catch (EndedException e) {
                    throw new CompletionException(e);
                }
            }, task -> new Thread(task).start());
        }

        @Override
        public void close() {
            process.destroy();
        }
    }

    @Test
    void plantAndPlcGiveTheTraceHashOfThoseInRustWhoeverIsFirst() throws IOException {
        for (int run = 0; run < 3; run++) {
            try (Sync sync = new Sync(folder)) {
                boolean plcFirst = run % 2 == 0;
                CompletableFuture<Outcome> first = sync.join(plcFirst ? new RobotProgram() : new RobotPlant());
                CompletableFuture<Outcome> second = sync.join(plcFirst ? new RobotPlant() : new RobotProgram());
                assertEquals(4702, first.join().steps());
                assertEquals(4_701_000_000L, first.join().nanos());
                assertEquals(HASH, first.join().hashText());
                assertEquals(first.join(), second.join());
                String last = sync.await("sync: ok ");
                assertTrue(last.contains("steps=4702 ") && last.endsWith("hash=" + HASH), last);
            }
        }
    }

    @Test
    void aPlantThatBreaksDownEndsTheRunForAllWithItsReason() throws IOException {
        try (Sync sync = new Sync(folder)) {
            CompletableFuture<Outcome> plc = sync.join(new RobotProgram());
            CompletableFuture<Outcome> plant = sync.join(new RobotPlant() {
                @Override
                public void run(long sequence, long nanos, long[] reads, long[] writes) {
                    if (sequence == 100) {
                        throw new IllegalStateException("axis x is blocked");
                    }
                    super.run(sequence, nanos, reads, writes);
                }
            });
            for (CompletableFuture<Outcome> client : List.of(plc, plant)) {
                EndedException ended =
                    (EndedException) assertThrows(CompletionException.class, client::join).getCause();
                assertEquals(Cause.FAILED, ended.cause());
                assertEquals("plant", ended.client().orElseThrow());
                assertEquals(99, ended.steps());
                assertTrue(ended.getMessage().contains("axis x is blocked"), ended.getMessage());
            }
            assertTrue(sync.await("sync: failed ").contains("axis x is blocked"));
        }
    }
}
