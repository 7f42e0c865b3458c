package tickbus.cell;

import java.time.Duration;
import java.util.List;
import java.util.Locale;
import tickbus.identification.PalletRecord.Piece;
import tickbus.petri.control.BoundNet;
import tickbus.petri.net.Marking;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;

/**
 * The products, as a net: of each colour, every second cylinder gets a cap. A saved marking so has the decisions. The net waits
 * for station 1, and no net waits for it.
 */
final class Plan {
    static final String NAME = "plan";
    /** Shorter than station 1 looks. */
    private static final Duration LOOK = Duration.ofMillis(50);
    private static final List<Piece> PIECES = List.of(Piece.BLACK, Piece.BLACK_WITH_CAP, Piece.RED, Piece.RED_WITH_CAP,
        Piece.METALLIC, Piece.METALLIC_WITH_CAP);
    private static final String UNDECIDED = "undecided";

    private Piece piece = Piece.UNDEFINED;

    /** The net, which decides about the sleeve at station 1's sensors. */
    BoundNet net() {
        NetBuilder net = PetriNet.named(NAME).place(UNDECIDED, 1);
        for (int i = 0; i < PIECES.size(); i++) {
            net.place(name(i)).place(next(i), 1 - i % 2);
        }
        for (int i = 0; i < PIECES.size(); i++) {
            net.transition(name(i)).input(UNDECIDED, next(i)).output(name(i), next(i ^ 1));
            net.transition("end of " + name(i)).input(name(i)).output(UNDECIDED);
        }
        BoundNet bound = BoundNet.of(net.build());
        for (int i = 0; i < PIECES.size(); i++) {
            Piece one = PIECES.get(i);
            bound.when(name(i)).marked("station 1", "looking").atLeast(LOOK).on("S1 capacitive");
            if (i < 2) {
                bound.off("S1 inductive").off("S1 optical");
            } else if (i < 4) {
                bound.off("S1 inductive").on("S1 optical");
            } else {
                bound.on("S1 inductive");
            }
            bound.when("end of " + name(i)).marked("station 1", "raising")
                .entry(name(i)).run((in, out) -> piece = one);
        }
        return bound;
    }

    private static String name(int i) {
        return PIECES.get(i).name().toLowerCase(Locale.ROOT).replace('_', ' ');
    }

    private static String next(int i) {
        return "next is " + name(i);
    }

    /** Makes a marking in which the kind of the sleeve in work is decided. */
    static void decide(Marking marking, Piece wanted) {
        for (int i = 0; i < PIECES.size(); i++) {
            marking.set(marking.net().place(name(i)).index(), PIECES.get(i) == wanted ? 1 : 0);
        }
        marking.set(marking.net().place(UNDECIDED).index(), PIECES.contains(wanted) ? 0 : 1);
    }

    /** The last decision. */
    Piece piece() {
        return piece;
    }
}
