package tickbus.cell;

import tickbus.petri.Delay;
import tickbus.petri.NetBuilder;
import tickbus.petri.PetriNet;
import tickbus.petri.control.BoundNet;

/** The nets of stations 1, 3 and 4. Each waits until the cell's net says "working", works, and is "done". */
final class StationNets {
    private static final long MS = 1_000_000;
    /** Contents of a pallet: sleeve and piece; these with piston, spring and head. */
    private static final int SLEEVE = 0b100001;
    private static final int CLOSED = 0b101111;

    private StationNets() {
    }

    /** A transition from one place to another. */
    private static void step(NetBuilder net, String name, String from, String to) {
        net.transition(name).input(from).output(to);
    }

    /** Prepares a sleeve, whether or not a pallet is there, and puts it on the pallet that comes. */
    static BoundNet one(Plan plan) {
        NetBuilder net = PetriNet.named("station 1")
            .place("supply", 1).place("loading").place("freeing").place("looking").delay(60 * MS).place("no sleeve")
            .place("advancing").place("fetching").place("closing").delay(70 * MS).place("lifting").place("sleeve ready")
            .place("waiting", 1).place("reader out").place("reading").place("pallet empty").place("swinging")
            .place("lowering").place("opening").delay(50 * MS).place("raising").place("writing").place("going back")
            .place("done");
        step(net, "feed", "supply", "loading");
        // Before the time is over, even if a scan comes late.
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
        net.transition("swing").input("pallet empty", "sleeve ready").output("swinging");
        // Pallets go on without a sleeve, or what is on the others would not come out.
        net.transition("pass, no sleeve").input("pallet empty").test("no sleeve", 1).output("going back");
        net.transition("pass, stopped").input("pallet empty").test("supply", 1).output("going back");
        step(net, "over the pallet", "swinging", "lowering");
        step(net, "on the pallet", "lowering", "opening");
        step(net, "let go", "opening", "raising");
        step(net, "raised", "raising", "writing");
        net.transition("written").input("writing").output("going back", "supply");
        step(net, "back", "going back", "done");
        step(net, "rest", "done", "waiting");
        BoundNet bound = BoundNet.of(net.build())
            .when("feed").marked("cell", "running").on("S1 loader back")
            .when("loaded").on("S1 loader forward")
            .when("loader jams").off("S1 emergency")
            .when("try again").on("S1 loader back")
            .when("sleeve known").on("S1 capacitive")
            .when("magazine empty").off("S1 capacitive")
            .when("magazine filled").on("S1 rearm").rising()
            .when("at the front").on("S1 belt front").on("S1 arm left").on("S1 arm up")
            .when("at the sleeve").on("S1 arm down")
            .when("lifted").on("S1 arm up")
            .when("begin").marked("cell", "working 1")
            .when("pallet seen").on("S1 reader forward").on("S1 reader optical").on("Head 1 carrier")
            .when("pallet free").is("Head 1 contents", 0)
            .when("pallet occupied").atLeast("Head 1 contents", 1)
            .when("pass, stopped").unmarked("cell", "running")
            .when("over the pallet").on("S1 arm right")
            .when("on the pallet").on("S1 arm down")
            .when("raised").on("S1 arm up")
            .when("written").on("Head 1 done")
            .when("back").on("S1 reader back").on("S1 arm left")
            .when("rest").unmarked("cell", "working 1")
            .firing("sleeve known").run((in, out) -> out.set("Head 1 new kind", plan.next(in))).writes("Head 1 new kind")
            .during("loading").set("S1 loader")
            .during("advancing").set("S1 belt advance")
            .during("fetching").set("S1 arm lower")
            .during("closing").set("S1 arm lower").set("S1 gripper")
            .during("lifting").set("S1 gripper")
            .during("sleeve ready").set("S1 gripper")
            .during("swinging").set("S1 gripper").set("S1 arm out")
            .during("lowering").set("S1 gripper").set("S1 arm lower")
            .during("opening").set("S1 arm lower")
            .during("writing").set("S1 arm in").set("Head 1 write").set("Head 1 new contents", SLEEVE)
            .during("going back").set("S1 arm in");
        for (String place : new String[] {"reader out", "reading", "pallet empty", "swinging", "lowering", "opening",
                "raising", "writing"}) {
            bound.during(place).set("S1 reader");
        }
        return bound;
    }

    /** Presses piston and spring, then the head, into a sleeve. */
    static BoundNet three() {
        NetBuilder net = PetriNet.named("station 3")
            .place("waiting", 1).place("parts wanted").place("no parts").place("feeding parts").place("pressing parts")
            .place("head wanted").place("no heads").place("feeding head").place("pressing head").place("raising")
            .place("writing").place("done");
        step(net, "begin", "waiting", "parts wanted");
        step(net, "nothing to do", "waiting", "done");
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
        step(net, "rest", "done", "waiting");
        return BoundNet.of(net.build())
            .when("begin").marked("cell", "working 3").is("Head 3 contents", SLEEVE)
            .when("nothing to do").marked("cell", "working 3").on("Head 3 carrier")
            .that(in -> in.get("Head 3 contents") != SLEEVE)
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
            .when("written").on("Head 3 done")
            .when("rest").unmarked("cell", "working 3")
            .firing("begin").run((in, out) -> out.set("Head 3 new kind", in.get("Head 3 kind"))).writes("Head 3 new kind")
            .during("no parts").set("S3 empty lamp")
            .during("no heads").set("S3 empty lamp")
            .during("feeding parts").set("S3 parts feeder")
            .during("pressing parts").set("S3 parts feeder").set("S3 press")
            .during("feeding head").set("S3 head feeder")
            .during("pressing head").set("S3 head feeder").set("S3 press")
            .during("writing").set("Head 3 write").set("Head 3 new contents", CLOSED);
    }

    /** Presses the cap on, if the kind has one, and takes the cylinder to the exit. */
    static BoundNet four() {
        NetBuilder net = PetriNet.named("station 4")
            .place("waiting", 1).place("cap wanted").place("no caps").place("feeding cap").place("pressing cap")
            .place("press rising").place("lowering").place("sucking").place("lifting").place("swinging")
            .place("putting down").place("letting go").place("raising").place("returning").place("writing").place("done");
        step(net, "begin with a cap", "waiting", "cap wanted");
        step(net, "begin without", "waiting", "lowering");
        step(net, "nothing to do", "waiting", "done");
        step(net, "cap there", "cap wanted", "feeding cap");
        step(net, "caps run out", "cap wanted", "no caps");
        step(net, "caps filled", "no caps", "cap wanted");
        step(net, "cap fed", "feeding cap", "pressing cap");
        step(net, "cap pressed", "pressing cap", "press rising");
        step(net, "capped", "press rising", "lowering");
        step(net, "at the piece", "lowering", "sucking");
        step(net, "sucked", "sucking", "lifting");
        step(net, "lifted", "lifting", "swinging");
        step(net, "vacuum lost", "lifting", "lowering");
        step(net, "over the exit", "swinging", "putting down");
        step(net, "at the exit", "putting down", "letting go");
        step(net, "let go", "letting go", "raising");
        step(net, "raised", "raising", "returning");
        step(net, "back", "returning", "writing");
        step(net, "written", "writing", "done");
        step(net, "rest", "done", "waiting");
        return BoundNet.of(net.build())
            .when("begin with a cap").marked("cell", "working 4").is("Head 4 contents", CLOSED)
            .that(in -> hasCap(in.get("Head 4 kind")))
            .when("begin without").marked("cell", "working 4").is("Head 4 contents", CLOSED)
            .that(in -> !hasCap(in.get("Head 4 kind")))
            .when("nothing to do").marked("cell", "working 4").on("Head 4 carrier")
            .that(in -> in.get("Head 4 contents") != CLOSED)
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
            .when("written").on("Head 4 done")
            .when("rest").unmarked("cell", "working 4")
            .during("no caps").set("S4 empty lamp")
            .during("feeding cap").set("S4 cap feeder")
            .during("pressing cap").set("S4 cap feeder").set("S4 press")
            .during("lowering").set("S4 arm lower")
            .during("sucking").set("S4 arm lower").set("S4 vacuum valve")
            .during("lifting").set("S4 vacuum valve")
            .during("swinging").set("S4 vacuum valve").set("S4 arm out")
            .during("putting down").set("S4 vacuum valve").set("S4 arm out").set("S4 arm lower")
            .during("letting go").set("S4 arm out").set("S4 arm lower")
            .during("raising").set("S4 arm out")
            .during("writing").set("Head 4 write").set("Head 4 new kind", 0).set("Head 4 new contents", 0);
    }

    /** 20, 40 and 60 have one, 10, 30 and 50 have none (hexadecimal). */
    private static boolean hasCap(double kind) {
        return kind > 0 && (int) kind / 0x10 % 2 == 0;
    }
}
