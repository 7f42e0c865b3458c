package tickbus.petri;

import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.PlaceStep;
import tickbus.petri.net.TransitionStep;
import tickbus.petri.run.Draws;

/** Seeded nets for tests against an oracle. */
public final class RandomNets {
    private RandomNets() {
    }

    /** A net with arcs of all kinds and some capacities; often unbounded. */
    public static PetriNet any(Draws random, int places, int transitions) {
        return net(random, places, transitions, true);
    }

    /** A net with input and output arcs only. */
    public static PetriNet plain(Draws random, int places, int transitions) {
        return net(random, places, transitions, false);
    }

    private static PetriNet net(Draws random, int places, int transitions, boolean special) {
        NetBuilder builder = PetriNet.named("random");
        for (int p = 0; p < places; p++) {
            PlaceStep place = builder.place("p" + p, random.below(3));
            if (special && random.below(3) == 0) {
                place.capacity(2 + random.below(2));
            }
        }
        for (int t = 0; t < transitions; t++) {
            TransitionStep transition = builder.transition("t" + t);
            for (int p = 0; p < places; p++) {
                int kind = random.below(12);
                int weight = 1 + random.below(4) / 3;
                if (kind < 2) {
                    transition.input("p" + p, weight);
                }
                if (kind == 1 || kind == 2 || kind == 3) {
                    transition.output("p" + p, weight);
                }
                if (special && kind == 4) {
                    transition.test("p" + p, weight);
                }
                if (special && kind == 5) {
                    transition.inhibitor("p" + p, weight + 1);
                }
            }
        }
        return builder.build();
    }
}
