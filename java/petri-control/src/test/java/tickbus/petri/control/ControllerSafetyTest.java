package tickbus.petri.control;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.io.UncheckedIOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.concurrent.CountDownLatch;
import org.junit.jupiter.api.AfterEach;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.Tickbus;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Stop;

/** How a controller stops, holds, ends and resumes. */
@Tag("native")
class ControllerSafetyTest {
    @TempDir
    Path folder;

    private String[] ends;
    private Tickbus machine;
    private Tickbus plc;
    private NetController nets;
    private long nanos;

    @BeforeEach
    void open() {
        ends = Line.steppedLink();
        machine = Line.open(folder, 1, ends[0]);
        plc = Line.open(folder, 2, ends[1]);
    }

    @AfterEach
    void close() {
        plc.close();
        machine.close();
    }

    private int scan() {
        nanos += 1_000_000;
        machine.send();
        int fired = nets.scan(nanos);
        machine.receive(nanos);
        return fired;
    }

    private void begin(NetController controller) {
        nets = controller;
        // An end is on the link from its first tick; earlier data are stale.
        machine.receive(nanos);
        nets.scan(nanos);
        scan();
    }

    private void in(String signal, boolean on) {
        machine.signal(signal).setBoolean(on);
    }

    private boolean out(String signal) {
        return machine.signal(signal).getBoolean();
    }

    private static PetriNet toggle() {
        return PetriNet.named("toggle").place("off", 1).place("on")
            .transition("go").input("off").output("on").transition("halt").input("on").output("off").build();
    }

    private static BoundNet button(PetriNet net) {
        return BoundNet.of(net).when("go").on("Piece at stop").rising().when("halt").on("Piece at stop").rising()
            .during("on").set("Gripper");
    }

    @Test
    void aButtonTogglesANetWithEachPress() {
        begin(NetController.of(plc, button(toggle())));
        for (int press = 1; press <= 4; press++) {
            in("Piece at stop", true);
            assertEquals(1, scan(), "press " + press);
            assertEquals(press % 2 == 1, out("Gripper"));
            assertEquals(0, scan());
            in("Piece at stop", false);
            assertEquals(0, scan());
        }
    }

    @Test
    void anEdgeThatIsKeptCountsForTheWholeScan() {
        begin(NetController.of(plc, button(toggle()).keepEdges()));
        in("Piece at stop", true);
        scan();
        assertEquals(Stop.Cause.LIVELOCK, nets.stops().get(0).cause());
    }

    @Test
    void aClockThatGoesBackStopsTheNetsWithTheirOutputsFailSafe() {
        begin(NetController.of(plc, button(toggle())));
        in("Piece at stop", true);
        scan();
        assertTrue(out("Gripper"));
        machine.send();
        nets.scan(nanos - 1);
        machine.receive(nanos + 1);
        assertTrue(nets.stopped());
        assertEquals("clock", nets.stops().get(0).element());
        assertFalse(out("Gripper"));
    }

    @Test
    void outputsAreFailSafeWhileAnInputAsksAndUntilRearmGoesOnAfterThat() {
        BoundNet net = BoundNet.of(PetriNet.named("n").place("p", 1).place("q").transition("later").delay(4_500_000).input("p").output("q")
            .build()).during("p").set("Gripper").during("q").set("Brake");
        begin(NetController.of(plc, net).failSafeWhile("Piece at stop", "Gripper closed"));
        scan();
        assertTrue(out("Gripper"));
        assertFalse(out("Brake"));
        in("Piece at stop", true);
        in("Gripper closed", true);
        for (int i = 0; i < 10; i++) {
            scan();
            assertFalse(out("Gripper"));
            assertTrue(out("Brake"), "its fail-safe value");
        }
        in("Piece at stop", false);
        for (int i = 0; i < 10; i++) {
            scan();
            assertFalse(out("Gripper"), "a rearm button that is stuck does not count");
        }
        nets.watch().ask();
        scan();
        assertEquals("the outputs are fail-safe until 'Gripper closed' goes on", nets.watch().note());
        in("Gripper closed", false);
        scan();
        in("Gripper closed", true);
        scan();
        assertFalse(out("Gripper"), "from the next scan on");
        scan();
        assertTrue(out("Gripper"));
        assertFalse(out("Brake"));
        assertEquals(0, scan(), "its clock stood still");
        assertEquals(0, scan());
        assertEquals(1, scan());
        assertTrue(out("Brake"));
    }

    @Test
    void aBrokenWireIsAStopWhereTheCircuitIsClosed() {
        begin(NetController.of(plc, BoundNet.of(toggle()).when("go").on("Gripper closed").when("halt").off("Gripper closed")
            .during("on").set("Gripper")).failSafeUnless("Piece at stop", "Gripper closed"));
        in("Gripper closed", true);
        scan();
        scan();
        assertFalse(out("Gripper"));
        in("Piece at stop", true);
        in("Gripper closed", false);
        scan();
        in("Gripper closed", true);
        scan();
        assertEquals(1, scan());
        assertTrue(out("Gripper"));
        assertThrows(IllegalStateException.class, () -> nets.failSafeWhile("Piece at stop", "Gripper closed"));
        assertThrows(IllegalArgumentException.class, () -> nets.failSafeWhile("Gripper", "Gripper closed"));
    }

    private void reopen() {
        plc.close();
        machine.close();
        open();
    }

    @Test
    void aControllerResumesTheMarkingThatWasSavedLast() throws IOException {
        Path file = folder.resolve("markings");
        begin(NetController.of(plc, button(toggle())).keepMarkings(file));
        assertEquals("tickbus markings 1\nnet toggle\n1 off\nend\n", Files.readString(file));
        in("Piece at stop", true);
        scan();
        assertEquals("tickbus markings 1\nnet toggle\n1 on\nend\n", Files.readString(file));
        reopen();
        // The file is read before it is written, whatever the order of the calls.
        begin(NetController.of(plc, button(toggle())).keepMarkings(file).resume(file));
        scan();
        assertTrue(out("Gripper"));
        assertEquals("{on}", nets.coordinator("toggle").marking().toString());
        assertThrows(IllegalStateException.class, () -> nets.resume(file));
    }

    @Test
    void netsThatMayNotBeginWaitForTheirMarkings() throws IOException {
        Path file = folder.resolve("markings");
        in("Piece at stop", true);
        machine.signal("Weight").set(4);
        begin(NetController.of(plc, button(toggle())).keepMarkings(file).numberMarkings("Pieces", 7)
            .beginIf(() -> plc.signal("Weight").get() == 5));
        machine.signal("Weight").set(5);
        in("Piece at stop", false);
        assertEquals(0, scan(), "it is asked once");
        assertTrue(nets.isWaiting());
        assertFalse(out("Gripper"));
        assertFalse(Files.exists(file));
        nets.begin(List.of(nets.coordinator("toggle").net().marking(0, 1)));
        scan();
        assertTrue(out("Gripper"));
        assertEquals("tickbus markings 1\nnet toggle\n1 on\nnet number of the markings\n8 number\nend\n", Files.readString(file));
        assertEquals(8, machine.signal("Pieces").get());
        reopen();
        begin(NetController.of(plc, button(toggle())).numberMarkings("Pieces", 1).resume(file));
        assertEquals(8, nets.markingNumber());
        assertThrows(IllegalArgumentException.class, () -> nets.numberMarkings("Weight", 1));
        assertThrows(IllegalArgumentException.class, () -> nets.numberMarkings("Pieces", 0));
    }

    @Test
    void aStopThatWaitsForRearmIsResumedToo() throws IOException {
        Path file = folder.resolve("markings");
        BoundNet net = BoundNet.of(PetriNet.named("n").place("p", 1).build()).during("p").set("Gripper");
        begin(NetController.of(plc, net).failSafeWhile("Piece at stop", "Gripper closed").keepMarkings(file)
            .numberMarkings("Pieces", 1));
        assertTrue(out("Gripper"));
        in("Piece at stop", true);
        scan();
        reopen();
        BoundNet same = BoundNet.of(PetriNet.named("n").place("p", 1).build()).during("p").set("Gripper");
        begin(NetController.of(plc, same).failSafeWhile("Piece at stop", "Gripper closed").keepMarkings(file)
            .numberMarkings("Pieces", 1).resume(file));
        scan();
        assertFalse(out("Gripper"), "the stop was released meanwhile");
        in("Gripper closed", true);
        scan();
        scan();
        assertTrue(out("Gripper"));
        assertEquals("tickbus markings 1\nnet n\n1 p\nnet number of the markings\n5 number\nend\n", Files.readString(file));
    }

    @Test
    void aFileOfOtherNetsOrACutOneIsRefused() throws IOException {
        Path file = folder.resolve("markings");
        NetController fresh = NetController.of(plc, button(toggle()));
        for (String[] one : new String[][] {
                {"tickbus markings 1\nnet toggle\n1 on\n", ":1: expected the markings that were saved"},
                {"tickbus markings 1\nend\n", ":2: there is no net toggle"},
                {"tickbus markings 1\nnet other\nend\n", ":2: net other: expected one of [toggle], each once"},
                {"tickbus markings 1\nnet toggle\nnet toggle\nend\n", ":3: net toggle: expected one of [toggle], each once"},
                {"tickbus markings 1\n1 on\nend\n", ":2: '1 on'; expected a net"},
                {"tickbus markings 1\nnet toggle\n1 p\nend\n", "there is no place 'p'"},
                {"tickbus markings 1\nnet toggle\nx on\nend\n", ":3: place on: tokens 'x'; expected a whole number"}}) {
            Files.writeString(file, one[0]);
            String message = assertThrows(NetException.class, () -> fresh.resume(file)).getMessage();
            assertTrue(message.contains(one[1]), message);
        }
    }

    @Test
    void aMarkingThatCannotBeSavedEndsTheScan() {
        NetController unsaved = NetController.of(plc, button(toggle())).keepMarkings(folder.resolve("no folder/markings"));
        assertTrue(assertThrows(UncheckedIOException.class, () -> begin(unsaved)).getMessage().contains("the markings cannot be saved in"));
    }

    @Test
    void aRunThatEndsByAnExceptionClosesTheDriver() {
        nets = NetController.of(plc, button(toggle()));
        machine.receive(0);
        ArithmeticException bug = new ArithmeticException("a bug of the user");
        assertEquals(bug, assertThrows(ArithmeticException.class, () -> nets.run(1, () -> {
            throw bug;
        })));
        assertThrows(RuntimeException.class, () -> plc.receive(5));
    }

    @Test
    void aRunThatTheEndOfTheJvmEndsClosesTheDriver() throws InterruptedException {
        nets = NetController.of(plc, button(toggle()));
        CountDownLatch scanned = new CountDownLatch(1);
        CountDownLatch ended = new CountDownLatch(1);
        Thread running = new Thread(() -> {
            nets.run(3_600_000_000_000L, () -> {
                scanned.countDown();
                return true;
            });
            ended.countDown();
        });
        running.start();
        scanned.await();
        nets.end(running, ended);
        running.join();
        assertEquals(List.of(), nets.stops());
        assertThrows(RuntimeException.class, () -> plc.receive(5));
    }
}
