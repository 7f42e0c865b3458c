package tickbus.sdsp;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.net.UnixDomainSocketAddress;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.CompletionException;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.condition.DisabledOnOs;
import org.junit.jupiter.api.condition.OS;
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

    private Sync robot(String... arguments) throws IOException {
        Path run = Path.of(System.getProperty("tickbus.root"), "examples", "robot", "robot.toml");
        return new Sync(folder, Files.readString(run), arguments);
    }

    @Test
    void plantAndPlcGiveTheTraceHashOfThoseInRustWhoeverIsFirst() throws IOException {
        for (int run = 0; run < 3; run++) {
            try (Sync sync = robot()) {
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
    @DisabledOnOs(OS.WINDOWS)
    void overAUnixSocketTheRunIsTheSame() throws IOException {
        Path socket = folder.resolve("socket");
        String run = Files.readString(Path.of(System.getProperty("tickbus.root"), "examples", "robot", "robot.toml"))
            .replace("127.0.0.1:20060", "unix:" + socket);
        UnixDomainSocketAddress address = UnixDomainSocketAddress.of(socket);
        EndedException early = assertThrows(EndedException.class, () -> Client.join(address, new RobotPlant()));
        assertEquals(Cause.LOST, early.cause());
        assertTrue(early.getMessage().contains("start it first"), early.getMessage());
        try (Sync sync = new Sync(folder, run)) {
            assertEquals(address, sync.address());
            CompletableFuture<Outcome> plant = sync.join(new RobotPlant());
            assertEquals(HASH, sync.join(new RobotProgram()).join().hashText());
            assertEquals(HASH, plant.join().hashText());
            assertTrue(sync.await("sync: ok ").endsWith("hash=" + HASH));
        }
    }

    @Test
    void aRunThatWasSavedContinuesWithTheSameTraceHash() throws IOException {
        String saved = folder.resolve("robot.saved").toString();
        try (Sync sync = robot("--save-to", saved, "--save-at", "3000")) {
            CompletableFuture<Outcome> plant = sync.join(new RobotPlant());
            sync.join(new RobotProgram());
            assertEquals("sync: saved after step 3000 in " + saved, sync.await("sync: saved "));
            assertEquals(HASH, plant.join().hashText());
        }
        try (Sync sync = robot("--restore", saved)) {
            RobotPlant restored = new RobotPlant();
            CompletableFuture<Outcome> plant = sync.join(restored);
            CompletableFuture<Outcome> plc = sync.join(new RobotProgram());
            sync.await("sync: all have joined: 1 of 2 clients run the steps up to 3000 again, the others take over");
            assertEquals(HASH, plant.join().hashText());
            assertEquals(HASH, plc.join().hashText());
            assertEquals(1702, restored.steps);
        }
    }

    @Test
    void aPlantThatBreaksDownEndsTheRunForAllWithItsReason() throws IOException {
        try (Sync sync = robot()) {
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
