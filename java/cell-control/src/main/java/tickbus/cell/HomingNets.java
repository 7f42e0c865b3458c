package tickbus.cell;

import static tickbus.cell.StationNets.step;

import java.time.Duration;
import java.util.Set;
import tickbus.petri.control.BoundNet;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Inputs;

/**
 * The nets that bring the cell to a known state when no saved marking fits it, and find the marking of each station's net:
 * "found X" means that the station continues in its place X.
 *
 * <p>Nothing moves before Rearm. Then the stations draw back from the pallets, without letting go of anything; the belt takes each
 * pallet to its next stop; and each station finds from its sensors and its pallet's carrier what is done already.
 */
final class HomingNets {
    static final String TRANSPORT = "homing of the transport";
    static final String FOUND = "found ";
    private static final int PALLETS = 3;
    private static final long MS = 1_000_000;
    /** Longer than a pallet takes past a sensor. */
    private static final Duration STILL = Duration.ofMillis(100);

    private HomingNets() {
    }

    /** The name of a station's homing net. */
    static String station(int number) {
        return "homing of station " + number;
    }

    /** All homing nets. */
    static BoundNet[] all(Heads heads) {
        return new BoundNet[] {one(heads.one()), three(heads.three()), four(heads.four()), transport()};
    }

    private static NetBuilder begin(String name, String... places) {
        NetBuilder net = PetriNet.named(name).place("waiting", 1);
        for (String place : places) {
            net.place(place);
        }
        return net;
    }

    private static NetBuilder station(int number, Set<String> found, String... places) {
        NetBuilder net = begin(station(number), places);
        found.forEach(place -> net.place(FOUND + place));
        step(net, "rearmed", "waiting", "drawing back");
        step(net, "drawn back", "drawing back", "back");
        return net;
    }

    private static BoundNet bind(NetBuilder net) {
        return BoundNet.of(net.build()).when("rearmed").marked(TRANSPORT, "drawing back");
    }

    /** Puts a sleeve that is not for the pallet back on the belt, and the belt's sleeve back to the sensors. */
    private static BoundNet one(StationHead head) {
        NetBuilder net = station(1, Set.of("supply", "looking", "swinging"), "drawing back", "back", "reader out", "reading",
            "missed", "carrying back", "lowering", "rising", "arm back", "returning");
        net.place("opening").delay(50 * MS);
        step(net, "nothing held", "back", "arm back");
        step(net, "held without a pallet", "back", "carrying back");
        step(net, "held", "back", "reader out");
        step(net, "pallet seen", "reader out", "reading");
        step(net, "carrier missed", "reading", "missed");
        step(net, "reader is back", "missed", "reader out");
        step(net, "sleeve of this pallet", "reading", FOUND + "swinging");
        step(net, "sleeve of the next pallet", "reading", "carrying back");
        step(net, "over the belt", "carrying back", "lowering");
        step(net, "on the belt", "lowering", "opening");
        step(net, "let go", "opening", "rising");
        step(net, "risen", "rising", "returning");
        step(net, "arm is back", "arm back", "returning");
        net.transition("a sleeve").priority(1).input("returning").output(FOUND + "looking");
        net.transition("no sleeve").delay(Delay.fixed(400 * MS)).input("returning").output(FOUND + "supply");
        BoundNet bound = bind(net)
            .when("drawn back").on("S1 arm up").on("S1 loader back").on("S1 reader back")
            .when("nothing held").marked(TRANSPORT, "settled").off("S1 sleeve held")
            .when("held without a pallet").marked(TRANSPORT, "settled").on("S1 sleeve held").off("Pallet at stop 1")
            .when("held").marked(TRANSPORT, "settled").on("S1 sleeve held").on("Pallet at stop 1")
            .when("pallet seen").on("S1 reader forward").on("S1 reader optical")
            .when("carrier missed").that(in -> head.hasFailed())
            .when("reader is back").on("S1 reader back")
            .when("sleeve of this pallet").that(in -> head.isDone() && isForPallet(in, head))
            .when("sleeve of the next pallet").that(in -> head.isDone() && !isForPallet(in, head))
            .when("over the belt").on("S1 arm left")
            .when("on the belt").on("S1 arm down")
            .when("let go").off("S1 sleeve held")
            .when("risen").on("S1 arm up")
            .when("arm is back").on("S1 arm left")
            .when("a sleeve").on("S1 belt back")
            .during("carrying back").set("S1 arm in")
            .during("lowering").set("S1 arm lower")
            .during("opening").set("S1 arm lower")
            .during("arm back").set("S1 arm in")
            .during("returning").set("S1 belt return");
        for (String place : new String[] {"waiting", "drawing back", "back", "reader out", "reading", "missed", "carrying back",
                "lowering", FOUND + "swinging"}) {
            bound.during(place).set("S1 gripper");
        }
        for (String place : new String[] {"reader out", "reading", FOUND + "swinging"}) {
            bound.during(place).set("S1 reader");
        }
        return StationNets.works(bound, head, "reading", head::read, "carrier missed");
    }

    /** The sleeve's record is written over the pallet, so the record belongs to the sleeve only if the arm is there. */
    private static boolean isForPallet(Inputs in, StationHead head) {
        return in.isOn("S1 arm right") && head.record().contents().equals(StationNets.SLEEVE);
    }

    /** Presses what may lie below the press into the sleeve, and looks into it. */
    private static BoundNet three(StationHead head) {
        NetBuilder net = station(3, Set.of("waiting", "parts wanted", "head wanted", "writing"), "drawing back", "back",
            "reading", "pressing", "rising", "looking");
        step(net, "no pallet", "back", FOUND + "waiting");
        step(net, "pallet", "back", "reading");
        StationNets.retry(net, "read again", "reading");
        step(net, "no work", "reading", FOUND + "waiting");
        step(net, "work", "reading", "pressing");
        step(net, "pressed", "pressing", "rising");
        step(net, "risen", "rising", "looking");
        step(net, "empty", "looking", FOUND + "parts wanted");
        step(net, "piston in", "looking", FOUND + "head wanted");
        step(net, "head on", "looking", FOUND + "writing");
        BoundNet bound = bind(net)
            .when("drawn back").on("S3 press up").on("S3 parts back").on("S3 head back")
            .when("no pallet").marked(TRANSPORT, "settled").off("Pallet at stop 3")
            .when("pallet").marked(TRANSPORT, "settled").on("Pallet at stop 3")
            .when("read again").that(in -> head.hasFailed())
            .when("no work").that(in -> head.isDone() && !head.record().contents().equals(StationNets.SLEEVE))
            .when("work").that(in -> head.isDone() && head.record().contents().equals(StationNets.SLEEVE))
            .when("pressed").on("S3 press down")
            .when("risen").on("S3 press up")
            .when("empty").off("S3 piston in").off("S3 head on")
            .when("piston in").on("S3 piston in").off("S3 head on")
            .when("head on").on("S3 head on")
            .during("pressing").set("S3 press");
        return StationNets.works(bound, head, "reading", head::read, "read again");
    }

    /** Presses a cap that may lie below the press, and keeps what the gripper has. */
    private static BoundNet four(StationHead head) {
        NetBuilder net = station(4, Set.of("waiting", "cap wanted", "lowering", "writing", "swinging"), "drawing back", "back",
            "reading", "arm back", "pressing", "rising", "looking");
        step(net, "no pallet", "back", FOUND + "waiting");
        step(net, "pallet", "back", "reading");
        StationNets.retry(net, "read again", "reading");
        step(net, "held, record is cleared", "reading", FOUND + "swinging");
        step(net, "held, record is not cleared", "reading", FOUND + "writing");
        step(net, "nothing held", "reading", "arm back");
        step(net, "no work", "arm back", FOUND + "waiting");
        step(net, "no cap", "arm back", FOUND + "lowering");
        step(net, "perhaps a cap", "arm back", "pressing");
        step(net, "pressed", "pressing", "rising");
        step(net, "risen", "rising", "looking");
        step(net, "cap to be put on", "looking", FOUND + "cap wanted");
        step(net, "cap on", "looking", FOUND + "lowering");
        BoundNet bound = bind(net)
            .when("drawn back").on("S4 arm up").on("S4 press up").on("S4 cap back")
            .when("no pallet").marked(TRANSPORT, "settled").off("Pallet at stop 4").off("S4 vacuum").on("S4 arm inside")
            .when("pallet").marked(TRANSPORT, "settled").on("Pallet at stop 4")
            .when("read again").that(in -> head.hasFailed())
            .when("held, record is cleared").on("S4 vacuum").that(in -> head.isDone() && !isClosed(head))
            .when("held, record is not cleared").on("S4 vacuum").that(in -> head.isDone() && isClosed(head))
            .when("nothing held").off("S4 vacuum").that(in -> head.isDone())
            .when("no work").on("S4 arm inside").that(in -> !isClosed(head))
            .when("no cap").on("S4 arm inside").that(in -> isClosed(head) && !isCapped(head))
            .when("perhaps a cap").on("S4 arm inside").that(in -> isClosed(head) && isCapped(head))
            .when("pressed").on("S4 press down")
            .when("risen").on("S4 press up")
            .when("cap to be put on").off("S4 cap on")
            .when("cap on").on("S4 cap on")
            .during("arm back").set("S4 arm in")
            .during("pressing").set("S4 press");
        for (String place : new String[] {"waiting", "drawing back", "back", "reading", FOUND + "writing", FOUND + "swinging"}) {
            bound.during(place).set("S4 vacuum valve");
        }
        return StationNets.works(bound, head, "reading", head::read, "read again");
    }

    private static boolean isClosed(StationHead head) {
        return head.record().contents().equals(StationNets.CLOSED);
    }

    private static boolean isCapped(StationHead head) {
        return StationNets.CAPPED.contains(head.record().piece());
    }

    /** Waits for Rearm, then for the stations, and takes the pallets to stops. */
    private static BoundNet transport() {
        NetBuilder net = begin(TRANSPORT, "drawing back", "driving", "all at stops", "settled");
        net.place("backward").delay(300 * MS);
        step(net, "rearmed", "waiting", "drawing back");
        step(net, "drawn back", "drawing back", "driving");
        step(net, "all seen", "driving", "all at stops");
        step(net, "not all seen", "all at stops", "driving");
        step(net, "settled", "all at stops", "settled");
        net.transition("stuck").delay(Delay.fixed(1200 * MS)).input("driving").output("backward");
        step(net, "free", "backward", "driving");
        return BoundNet.of(net.build())
            .when("rearmed").on("S1 rearm").rising()
            .when("drawn back").marked(station(1), "back").marked(station(3), "back").marked(station(4), "back")
            .when("all seen").that(in -> seen(in) == PALLETS)
            .when("not all seen").that(in -> seen(in) != PALLETS)
            .when("settled").marked("all at stops").atLeast(STILL).that(in -> seen(in) == PALLETS)
            .during("waiting").set("Rearm lamp")
            .during("driving").set("Belt")
            .during("all at stops").set("Belt")
            .during("backward").set("Belt back");
    }

    private static int seen(Inputs in) {
        int seen = 0;
        for (int stop = 1; stop <= CellNets.STOPS; stop++) {
            seen += in.isOn("Pallet at stop " + stop) ? 1 : 0;
        }
        return seen;
    }
}
