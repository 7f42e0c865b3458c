package tickbus.cell;

import java.util.Arrays;
import tickbus.Tickbus;
import tickbus.petri.control.BoundNet;
import tickbus.petri.control.Composition;
import tickbus.petri.control.NetController;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;

/** The nets of the transport and of the whole cell, and all nets together. */
final class CellNets {
    /** Stops along the belt; at stop 2 no station is on the bus. */
    static final int STOPS = 4;
    private static final long MS = 1_000_000;

    private CellNets() {
    }

    /** The nets of the plan, of stations 1, 3 and 4, of the transport and of the cell, bound to the signals of plc/cell/cell.cfg. */
    static BoundNet[] all(Heads heads) {
        return all(heads, 1, 3, 4);
    }

    /** The controller of the nets. After an emergency stop and Rearm they continue where they stopped. */
    static NetController controller(Tickbus bus, BoundNet... all) {
        return NetController.of(bus, all).failSafeWhile("S1 emergency", "S1 rearm");
    }

    private static BoundNet[] all(Heads heads, int... pallets) {
        Plan plan = new Plan();
        return new BoundNet[] {plan.net(), StationNets.one(plan, heads.one()), StationNets.three(heads.three()),
            StationNets.four(heads.four()), transport(pallets), cell(pallets)};
    }

    /** The composition of all nets, with pallets that come to these stops at first. */
    static PetriNet composition(int... pallets) {
        // No net waits for the plan.
        return Composition.of("manufacturing cell", Arrays.stream(all(Heads.none(), pallets))
            .filter(one -> !one.net().name().equals(Plan.NAME)).toArray(BoundNet[]::new));
    }

    private static int after(int stop) {
        return stop % STOPS + 1;
    }

    private static int among(int[] pallets, int stop) {
        return (int) Arrays.stream(pallets).filter(one -> one == stop).count();
    }

    /** Lets pallets pass the stops as the cell's net commands, and reverses the belt for a moment when a pallet gets stuck. */
    private static BoundNet transport(int... pallets) {
        NetBuilder net = PetriNet.named("transport").place("forward", 1).place("backward").delay(300 * MS);
        for (int stop = 1; stop <= STOPS; stop++) {
            net.place("to " + stop, among(pallets, stop)).place("at " + stop).place("leaving " + stop)
                .place("stuck before " + stop);
            net.transition("arrives at " + stop).priority(1).input("to " + stop).output("at " + stop);
            net.transition("opens " + stop).input("at " + stop).output("leaving " + stop);
            net.transition("leaves " + stop).input("leaving " + stop).output("to " + after(stop));
            net.transition("stuck before " + stop).delay(Delay.fixed(1200 * MS))
                .input("to " + stop, "forward").output("stuck before " + stop, "backward");
            net.transition("free before " + stop).input("stuck before " + stop, "backward").output("to " + stop, "forward");
        }
        BoundNet bound = BoundNet.of(net.build()).during("forward").set("Belt").during("backward").set("Belt back");
        for (int stop = 1; stop <= STOPS; stop++) {
            bound.when("arrives at " + stop).on("Pallet at stop " + stop)
                .when("opens " + stop).marked("cell", "sending from " + stop)
                .when("leaves " + stop).off("Pallet at stop " + stop)
                .during("leaving " + stop).set("Open stop " + stop);
        }
        return bound;
    }

    /** Decides which station works, and sends a pallet on when the next stop has room for it. */
    private static BoundNet cell(int... pallets) {
        NetBuilder net = PetriNet.named("cell").place("stopped", 1).place("running");
        net.transition("start").input("stopped").output("running").transition("stop").input("running").output("stopped");
        for (int stop = 1; stop <= STOPS; stop++) {
            net.place("empty " + stop, 1).place("worked " + stop).place("sending from " + stop)
                .place("room at " + stop, 1 - among(pallets, stop));
            if (isStation(stop)) {
                net.place("working " + stop);
                net.transition("work " + stop).input("empty " + stop).output("working " + stop);
                net.transition("worked " + stop).input("working " + stop).output("worked " + stop);
            } else {
                net.transition("pass " + stop).input("empty " + stop).output("worked " + stop);
            }
            net.transition("send from " + stop).input("worked " + stop, "room at " + after(stop)).output("sending from " + stop);
            net.transition("gone from " + stop).input("sending from " + stop).output("empty " + stop, "room at " + stop);
        }
        BoundNet bound = BoundNet.of(net.build())
            .when("start").on("S1 start").on("S1 automatic").on("S1 integrated")
            .when("stop").off("S1 start")
            .during("running").set("Running lamp");
        for (int stop = 1; stop <= STOPS; stop++) {
            if (isStation(stop)) {
                bound.when("work " + stop).marked("transport", "at " + stop).marked("station " + stop, "waiting")
                    .when("worked " + stop).marked("station " + stop, "done");
            } else {
                bound.when("pass " + stop).marked("transport", "at " + stop);
            }
            bound.when("gone from " + stop).unmarked("transport", "at " + stop).unmarked("transport", "leaving " + stop);
        }
        return bound;
    }

    static boolean isStation(int stop) {
        return stop != 2;
    }
}
