package tickbus.cell;

import java.util.Set;
import tickbus.identification.PalletRecord;
import tickbus.identification.PalletRecord.Content;
import tickbus.identification.PalletRecord.Piece;
import tickbus.petri.control.BoundNet;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;

/** The nets of stations 1, 3 and 4. Each waits for "working" of the cell's net, works, and is "done". */
final class StationNets {
    private static final long MS = 1_000_000;
    /** The contents of a pallet after station 1, and after station 3. */
    static final Set<Content> SLEEVE = Set.of(Content.SLEEVE, Content.PIECE);
    static final Set<Content> CLOSED =
        Set.of(Content.SLEEVE, Content.PISTON, Content.SPRING, Content.HEAD, Content.PIECE);
    static final Set<Piece> CAPPED = Set.of(Piece.BLACK_WITH_CAP, Piece.RED_WITH_CAP, Piece.METALLIC_WITH_CAP);

    private StationNets() {
    }

    /** A transition from one place to another. */
    static void step(NetBuilder net, String name, String from, String to) {
        net.transition(name).input(from).output(to);
    }

    /** Retries a failed step in its place, after a moment. */
    static void retry(NetBuilder net, String name, String place) {
        net.transition(name).delay(Delay.fixed(100 * MS)).input(place).output(place);
    }

    /** The head works while the place is marked, and again when {@code retry} fires. */
    static BoundNet works(BoundNet bound, StationHead head, String place, Runnable begin, String retry) {
        // The answer is forgotten when the net leaves the place: conditions on it are tested before the next entry.
        return bound.entry(place).run((in, out) -> begin.run()).exit(place).run((in, out) -> head.rest())
            .firing(retry).run((in, out) -> head.again());
    }

    /** Prepares a sleeve, whether or not a pallet is there, and puts it on the pallet that comes. */
    static BoundNet one(Plan plan, StationHead head) {
        NetBuilder net = PetriNet.named("station 1")
            .place("supply", 1).place("loading").place("freeing").place("looking").delay(60 * MS).place("no sleeve")
            .place("advancing").place("fetching").place("closing").delay(70 * MS).place("lifting").place("sleeve ready")
            .place("waiting", 1).place("reader out").place("reading").place("drawing back").place("pallet empty")
            .place("swinging").place("lowering").place("writing").place("opening").delay(50 * MS).place("raising").place("going back")
            .place("done");
        step(net, "feed", "supply", "loading");
        // Fires before the time is over, even if a scan comes late.
        net.transition("loaded").priority(1).input("loading").output("looking");
        net.transition("loader jams").delay(Delay.fixed(500 * MS)).input("loading").output("freeing");
        step(net, "try again", "freeing", "loading");
        step(net, "sleeve known", "looking", "advancing");
        step(net, "magazine empty", "looking", "no sleeve");
        step(net, "magazine filled", "no sleeve", "supply");
        step(net, "at the front", "advancing", "fetching");
        step(net, "at the sleeve", "fetching", "closing");
        step(net, "closed", "closing", "lifting");
        step(net, "lifted", "lifting", "sleeve ready");
        step(net, "begin", "waiting", "reader out");
        step(net, "pallet seen", "reader out", "reading");
        step(net, "pallet free", "reading", "pallet empty");
        step(net, "pallet occupied", "reading", "going back");
        step(net, "carrier missed", "reading", "drawing back");
        step(net, "reader is back", "drawing back", "reader out");
        net.transition("swing").input("pallet empty", "sleeve ready").output("swinging");
        // Pallets continue without a sleeve; otherwise the pieces on the other pallets would never come out.
        net.transition("pass, no sleeve").input("pallet empty").test("no sleeve", 1).output("going back");
        net.transition("pass, stopped").input("pallet empty").test("supply", 1).output("going back");
        step(net, "over the pallet", "swinging", "lowering");
        // The record is written before the sleeve is let go: a carrier never has less than its pallet.
        step(net, "on the pallet", "lowering", "writing");
        step(net, "written", "writing", "opening");
        retry(net, "write again", "writing");
        step(net, "let go", "opening", "raising");
        net.transition("raised").input("raising").output("going back", "supply");
        step(net, "back", "going back", "done");
        step(net, "rest", "done", "waiting");
        BoundNet bound = BoundNet.of(net.build())
            .when("feed").marked("cell", "running").on("S1 loader back")
            .when("loaded").on("S1 loader forward")
            .when("try again").on("S1 loader back")
            .when("sleeve known").on("S1 capacitive")
            .when("magazine empty").off("S1 capacitive")
            .when("magazine filled").on("S1 rearm").rising()
            .when("at the front").on("S1 belt front").on("S1 arm left").on("S1 arm up")
            .when("at the sleeve").on("S1 arm down")
            // After an emergency stop the air comes back later than the nets' clock.
            .when("closed").on("S1 sleeve held")
            .when("lifted").on("S1 arm up")
            .when("begin").marked("cell", "working 1")
            .when("pallet seen").on("S1 reader forward").on("S1 reader optical")
            .when("pallet free").that(in -> head.isDone() && head.record().contents().isEmpty())
            .when("pallet occupied").that(in -> head.isDone() && !head.record().contents().isEmpty())
            .when("carrier missed").that(in -> head.hasFailed())
            .when("reader is back").on("S1 reader back")
            .when("pass, stopped").unmarked("cell", "running")
            .when("over the pallet").on("S1 arm right")
            .when("on the pallet").on("S1 arm down")
            .when("let go").off("S1 sleeve held")
            .when("raised").on("S1 arm up")
            .when("written").that(in -> head.isDone())
            .when("write again").that(in -> head.hasFailed())
            .when("back").on("S1 reader back").on("S1 arm left")
            .when("rest").unmarked("cell", "working 1")
            .during("loading").set("S1 loader")
            .during("advancing").set("S1 belt advance")
            .during("fetching").set("S1 arm lower")
            .during("closing").set("S1 arm lower").set("S1 gripper")
            .during("lifting").set("S1 gripper")
            .during("sleeve ready").set("S1 gripper")
            .during("swinging").set("S1 gripper").set("S1 arm out")
            .during("lowering").set("S1 gripper").set("S1 arm lower")
            .during("writing").set("S1 gripper").set("S1 arm lower")
            .during("opening").set("S1 arm lower")
            .during("going back").set("S1 arm in");
        for (String place : new String[] {"reader out", "reading", "pallet empty", "swinging", "lowering", "writing",
                "opening"}) {
            bound.during(place).set("S1 reader");
        }
        works(bound, head, "reading", head::read, "carrier missed");
        return works(bound, head, "writing", () -> head.write(new PalletRecord(null, plan.piece(), SLEEVE)), "write again");
    }

    /** Presses piston and spring, then the head, into a sleeve. */
    static BoundNet three(StationHead head) {
        NetBuilder net = PetriNet.named("station 3")
            .place("waiting", 1).place("reading").place("parts wanted").place("no parts").place("feeding parts")
            .place("pressing parts").place("head wanted").place("no heads").place("feeding head").place("pressing head").place("raising")
            .place("writing").place("done");
        step(net, "begin", "waiting", "reading");
        step(net, "sleeve alone", "reading", "parts wanted");
        step(net, "nothing to do", "reading", "done");
        retry(net, "read again", "reading");
        step(net, "parts there", "parts wanted", "feeding parts");
        step(net, "parts run out", "parts wanted", "no parts");
        step(net, "parts filled", "no parts", "parts wanted");
        step(net, "parts fed", "feeding parts", "pressing parts");
        step(net, "parts pressed", "pressing parts", "head wanted");
        step(net, "head there", "head wanted", "feeding head");
        step(net, "heads run out", "head wanted", "no heads");
        step(net, "heads filled", "no heads", "head wanted");
        step(net, "head fed", "feeding head", "pressing head");
        step(net, "head pressed", "pressing head", "raising");
        step(net, "raised", "raising", "writing");
        step(net, "written", "writing", "done");
        retry(net, "write again", "writing");
        step(net, "rest", "done", "waiting");
        BoundNet bound = BoundNet.of(net.build())
            .when("begin").marked("cell", "working 3")
            .when("sleeve alone").that(in -> head.isDone() && head.record().contents().equals(SLEEVE))
            .when("nothing to do").that(in -> head.isDone() && !head.record().contents().equals(SLEEVE))
            .when("read again").that(in -> head.hasFailed())
            .when("parts there").on("S3 parts there")
            .when("parts run out").off("S3 parts there")
            .when("parts filled").on("S3 parts there")
            .when("parts fed").on("S3 parts forward")
            .when("parts pressed").on("S3 press down")
            .when("head there").on("S3 heads there").on("S3 press up").on("S3 parts back")
            .when("heads run out").off("S3 heads there")
            .when("heads filled").on("S3 heads there")
            .when("head fed").on("S3 head forward")
            .when("head pressed").on("S3 press down")
            .when("raised").on("S3 press up").on("S3 head back")
            .when("written").that(in -> head.isDone())
            .when("write again").that(in -> head.hasFailed())
            .when("rest").unmarked("cell", "working 3")
            .during("no parts").set("S3 empty lamp")
            .during("no heads").set("S3 empty lamp")
            .during("feeding parts").set("S3 parts feeder")
            .during("pressing parts").set("S3 parts feeder").set("S3 press")
            .during("feeding head").set("S3 head feeder")
            .during("pressing head").set("S3 head feeder").set("S3 press");
        works(bound, head, "reading", head::read, "read again");
        return works(bound, head, "writing", () -> head.change(record -> new PalletRecord(null, record.piece(), CLOSED)),
            "write again");
    }

    /** Presses the cap on, if the kind has one, and takes the cylinder to the exit. */
    static BoundNet four(StationHead head) {
        NetBuilder net = PetriNet.named("station 4")
            .place("waiting", 1).place("reading").place("cap wanted").place("no caps").place("feeding cap").place("pressing cap")
            .place("press rising").place("lowering").place("sucking").place("lifting").place("writing").place("swinging")
            .place("putting down").place("letting go").place("raising").place("returning").place("done");
        step(net, "begin", "waiting", "reading");
        step(net, "cap to be put on", "reading", "cap wanted");
        step(net, "no cap", "reading", "lowering");
        step(net, "nothing to do", "reading", "done");
        retry(net, "read again", "reading");
        step(net, "cap there", "cap wanted", "feeding cap");
        step(net, "caps run out", "cap wanted", "no caps");
        step(net, "caps filled", "no caps", "cap wanted");
        step(net, "cap fed", "feeding cap", "pressing cap");
        step(net, "cap pressed", "pressing cap", "press rising");
        step(net, "capped", "press rising", "lowering");
        step(net, "at the piece", "lowering", "sucking");
        step(net, "sucked", "sucking", "lifting");
        // The record is cleared while the piece is in the gripper: what the gripper lets go is on no pallet's record.
        step(net, "lifted", "lifting", "writing");
        step(net, "written", "writing", "swinging");
        retry(net, "write again", "writing");
        step(net, "vacuum lost", "lifting", "lowering");
        step(net, "over the exit", "swinging", "putting down");
        step(net, "at the exit", "putting down", "letting go");
        step(net, "let go", "letting go", "raising");
        step(net, "raised", "raising", "returning");
        step(net, "back", "returning", "done");
        step(net, "rest", "done", "waiting");
        BoundNet bound = BoundNet.of(net.build())
            .when("begin").marked("cell", "working 4")
            .when("cap to be put on").that(in -> isClosed(head) && CAPPED.contains(head.record().piece()))
            .when("no cap").that(in -> isClosed(head) && !CAPPED.contains(head.record().piece()))
            .when("nothing to do").that(in -> head.isDone() && !isClosed(head))
            .when("read again").that(in -> head.hasFailed())
            .when("cap there").on("S4 caps there")
            .when("caps run out").off("S4 caps there")
            .when("caps filled").on("S4 caps there")
            .when("cap fed").on("S4 cap forward")
            .when("cap pressed").on("S4 press down")
            .when("capped").on("S4 press up").on("S4 cap back")
            .when("at the piece").on("S4 arm down")
            .when("sucked").on("S4 vacuum")
            .when("lifted").on("S4 arm up").on("S4 vacuum")
            .when("vacuum lost").on("S4 arm up").off("S4 vacuum")
            .when("over the exit").on("S4 arm outside")
            .when("at the exit").on("S4 arm down")
            .when("let go").off("S4 vacuum")
            .when("raised").on("S4 arm up")
            .when("back").on("S4 arm inside")
            .when("written").that(in -> head.isDone())
            .when("write again").that(in -> head.hasFailed())
            .when("rest").unmarked("cell", "working 4")
            .during("no caps").set("S4 empty lamp")
            .during("feeding cap").set("S4 cap feeder")
            .during("pressing cap").set("S4 cap feeder").set("S4 press")
            .during("lowering").set("S4 arm lower")
            .during("sucking").set("S4 arm lower").set("S4 vacuum valve")
            .during("lifting").set("S4 vacuum valve")
            .during("writing").set("S4 vacuum valve")
            .during("swinging").set("S4 vacuum valve").set("S4 arm out")
            .during("putting down").set("S4 vacuum valve").set("S4 arm out").set("S4 arm lower")
            .during("letting go").set("S4 arm out").set("S4 arm lower")
            .during("raising").set("S4 arm out")
            .during("returning").set("S4 arm in");
        works(bound, head, "reading", head::read, "read again");
        return works(bound, head, "writing", () -> head.write(PalletRecord.BLANK), "write again");
    }

    private static boolean isClosed(StationHead head) {
        return head.isDone() && head.record().contents().equals(CLOSED);
    }
}
