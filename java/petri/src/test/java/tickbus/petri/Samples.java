package tickbus.petri;

import tickbus.petri.format.HpsimText;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;

/** Nets that several tests use. */
public final class Samples {
    /** The export that the paper on the cell prints, with its wrapped comment and its missing parenthesis. */
    public static final String PAPER = """
        // Transition Name Vector:
        (T0 ;T1 ;T2 ;T3 ;)
        // Position Name Vector:
        (P0;P1;P2;P3;P4;)
        // Inzidenz Matrix:
        {
        (1 0 0 -1)
        (-1 1 0 0)
        (-1 0 1 0)
        (0 -1 0 1)
        (0 0 -1 1)
        }
        // Marking Vector:
        (1 0 0 0 0)
        // Arc Type Matrix:
        // Code:0 = None; 1 = Normal; 2 = Inhibitor; 3 = Test
        {
        (1 0 0 1)
        (1 1 0 0)
        (1 0 1 0)
        (0 1 0 1)
        (0 0 1 1)
        }
        // Transition Time Model Vektor:
        // Code:1 = Immediate; 2= Delay;3 = Exponential; 4 =
        Equal Distribution;
        (1 ;1 ;1 ;1 ;
        """;

    private Samples() {
    }

    public static PetriNet paper() {
        return HpsimText.parse("paper.txt", PAPER, java.util.Map.of()).net();
    }

    /** A producer and a consumer about a buffer of three, with arcs of all kinds. */
    public static PetriNet everything() {
        return PetriNet.named("every kind")
            .place("ready", 1).place("made").delay(5_000L).place("buffer").capacity(3).place("idle", 2).place("stop & <go>")
            .transition("make").input("ready").output("made").inhibitor("stop & <go>", 1).delay(Delay.fixed(1_000_000))
            .transition("put").input("made").output("ready").output("buffer", 2).priority(3)
            .transition("take").input("buffer", 1).test("idle", 2).delay(Delay.uniform(10, 20)).priority(-1)
            .transition("halt").output("stop & <go>").inhibitor("stop & <go>", 2).delay(Delay.exponential(7))
            .build();
    }

    /** Dining philosophers who take both forks at once. */
    public static PetriNet philosophers(int count) {
        NetBuilder builder = PetriNet.named("philosophers");
        for (int i = 0; i < count; i++) {
            builder.place("fork" + i, 1).place("thinks" + i, 1).place("eats" + i);
        }
        for (int i = 0; i < count; i++) {
            String other = "fork" + (i + 1) % count;
            builder.transition("start" + i).input("fork" + i, other, "thinks" + i).output("eats" + i);
            builder.transition("end" + i).input("eats" + i).output("fork" + i, other, "thinks" + i);
        }
        return builder.build();
    }

    /** One token in a ring of places. */
    public static PetriNet ring(int size) {
        NetBuilder builder = PetriNet.named("ring");
        for (int i = 0; i < size; i++) {
            builder.place("p" + i, i == 0 ? 1 : 0);
        }
        for (int i = 0; i < size; i++) {
            builder.transition("t" + i).input("p" + i).output("p" + (i + 1) % size);
        }
        return builder.build();
    }
}
