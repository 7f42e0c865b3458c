package tickbus.cell;

import tickbus.identification.PalletRecord.Piece;
import tickbus.petri.run.Inputs;

/** The products: of each colour, every second cylinder gets a cap. */
final class Plan {
    private static final int RED = 1;
    private static final int METALLIC = 2;

    private final boolean[] capNext = new boolean[3];
    private Piece piece = Piece.UNDEFINED;

    /** Decides about the sleeve at station 1's sensors; the next sleeve of its colour becomes the other kind. */
    void decide(Inputs in) {
        int colour = in.isOn("S1 inductive") ? METALLIC : in.isOn("S1 optical") ? RED : 0;
        boolean cap = capNext[colour];
        capNext[colour] = !cap;
        piece = Piece.values()[Piece.BLACK.ordinal() + 2 * colour + (cap ? 1 : 0)];
    }

    /** The last decision. */
    Piece piece() {
        return piece;
    }
}
