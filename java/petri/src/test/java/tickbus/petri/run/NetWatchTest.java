package tickbus.petri.run;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertSame;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.List;
import java.util.concurrent.atomic.AtomicBoolean;
import org.junit.jupiter.api.Test;
import tickbus.petri.net.Delay;
import tickbus.petri.net.PetriNet;

class NetWatchTest {
    private static final PetriNet NET = PetriNet.named("lamp").place("off", 1).place("on").delay(50)
        .transition("switch on").input("off").output("on")
        .transition("switch off").input("on").output("off").delay(Delay.fixed(100))
        .build();

    /** The state after a scan with a pending request. */
    private static NetState state(NetWatch watch, Coordinator lamp, long nanos) {
        watch.ask();
        lamp.scan(nanos);
        assertTrue(watch.isThere());
        return watch.state(0);
    }

    @Test
    void aStateSaysWhatEachTransitionWaitsFor() {
        Coordinator lamp = Coordinator.of(NET).inputs("button").reader(values -> values[0] = lampButton).output("lamp", 0)
            .when("switch on", in -> in.isOn("button")).during("on", (in, out) -> out.set("lamp", true)).build();
        NetWatch watch = NetWatch.of(lamp);
        NetState state = state(watch, lamp, 1000);
        assertEquals(NetState.Phase.HELD, state.phase(0));
        assertEquals(NetState.Phase.DISABLED, state.phase(1));
        assertEquals(0, state.fired(0));
        lampButton = 1;
        state = state(watch, lamp, 1010);
        assertEquals(1, state.fired(0));
        assertEquals(1010, state.lastFired(0));
        assertEquals(1, state.tokens(1));
        assertEquals(0, state.available(1), "the token is too young");
        assertEquals(NetState.Phase.DISABLED, state.phase(1));
        assertEquals(1, state.input(0));
        assertEquals(1, state.output(0));
        state = state(watch, lamp, 1060);
        assertEquals(1, state.available(1));
        assertEquals(NetState.Phase.DELAYED, state.phase(1));
        assertEquals(1160, state.due(1));
        assertEquals(3, state.scans());
        assertEquals(1060, state.nanos());
    }

    private double lampButton;

    @Test
    void nothingIsHandedOverUnlessAskedForAndACopyStaysAsItIs() {
        Coordinator lamp = Coordinator.of(NET).build();
        NetWatch watch = NetWatch.of(lamp);
        lamp.scan(0);
        assertFalse(watch.isThere());
        watch.ask();
        lamp.scan(1);
        assertEquals(1, watch.state(0).nanos());
        lamp.scan(2);
        assertEquals(1, watch.state(0).nanos(), "it belongs to the one that shows it");
        watch.ask();
        assertFalse(watch.isThere());
    }

    @Test
    void aStoppedControllerStillSaysWhy() {
        Coordinator lamp = Coordinator.of(NET).when("switch on", in -> {
            throw new IllegalStateException("no button");
        }).build();
        NetWatch watch = NetWatch.of(lamp);
        state(watch, lamp, 0);
        NetState state = state(watch, lamp, 1);
        assertTrue(state.stop().orElseThrow().message().contains("condition of transition switch on"), () -> state.stop().toString());
    }

    @Test
    void theInitialMarkingIsShownBeforeTheFirstScan() {
        Coordinator lamp = Coordinator.of(NET).build();
        NetState state = new NetState(lamp);
        lamp.copyTo(state);
        assertEquals(0, state.scans());
        assertEquals(1, state.tokens(0));
        assertEquals(NetState.Phase.READY, state.phase(0));
    }

    @Test
    void aConjunctionTellsThePartThatFailed() {
        Coordinator lamp = Coordinator.of(NET).when("switch on", new Conjunction() {
            @Override
            public List<Part> parts() {
                return List.of(new Part("a", null, null, null), new Part("b", null, null, null));
            }

            @Override
            public int failed() {
                return 1;
            }

            @Override
            public boolean test(Inputs inputs) {
                return false;
            }
        }).build();
        assertEquals(1, state(NetWatch.of(lamp), lamp, 0).failed(0));
    }

    @Test
    void aCoordinatorHasOneWatchAtATime() {
        Coordinator lamp = Coordinator.of(NET).build();
        NetWatch first = NetWatch.of(lamp);
        assertThrows(IllegalStateException.class, () -> NetWatch.of(lamp));
        first.close();
        assertSame(lamp, NetWatch.of(lamp).nets().get(0));
    }

    /** A copy that mixes two scans would have the token in both places or in neither. */
    @Test
    void anotherThreadSeesWholeScansOnly() throws InterruptedException {
        PetriNet net = PetriNet.named("ring").place("a", 1).place("b").transition("go").input("a").output("b").delay(Delay.fixed(1))
            .transition("back").input("b").output("a").delay(Delay.fixed(1)).build();
        Coordinator ring = Coordinator.of(net).build();
        NetWatch watch = NetWatch.of(ring);
        AtomicBoolean over = new AtomicBoolean();
        Thread scans = new Thread(() -> {
            for (long now = 0; !over.get(); now++) {
                ring.scan(now);
            }
        });
        scans.start();
        long last = -1;
        for (int seen = 0; seen < 300;) {
            watch.ask();
            while (!watch.isThere()) {
                Thread.yield();
            }
            NetState state = watch.state(0);
            assertEquals(1, state.tokens(0) + state.tokens(1));
            assertEquals(state.tokens(1), state.fired(0) - state.fired(1));
            assertTrue(state.nanos() > last);
            last = state.nanos();
            seen++;
        }
        over.set(true);
        scans.join();
    }
}
