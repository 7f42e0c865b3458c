package tickbus.petri.analysis;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.TimeUnit;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.petri.RandomNets;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.net.Transition;
import tickbus.petri.run.Draws;

/** Compares with SNAKES, a third-party library in Python. */
class SnakesTest {
    private static final int NETS = 120;
    private static final int LIMIT = 120;

    @TempDir
    Path folder;

    @Test
    void seededNetsHaveTheSameStateSpaceInSnakes() throws Exception {
        Path root = Path.of(System.getProperty("tickbus.root", "../.."));
        Path python = root.resolve("target/peers/petri/bin/python");
        assumeTrue(Files.isExecutable(python), "SNAKES is not installed (tools/peers)");
        Draws random = new Draws(1962);
        List<PetriNet> nets = new ArrayList<>();
        StringBuilder text = new StringBuilder();
        for (int drawn = 0; nets.size() < NETS; drawn++) {
            PetriNet net = drawn % 2 == 0 ? withoutCapacities(RandomNets.any(random, 4, 4)) : RandomNets.plain(random, 5, 4);
            Reachability graph = Reachability.explore(net, LIMIT);
            // Most are unbounded or have two markings; only a few of those are compared.
            if (graph.isComplete() && graph.size() > 4 || drawn % 60 == 0) {
                write(nets.size(), net, text);
                nets.add(net);
            }
        }
        Path file = Files.writeString(folder.resolve("nets"), text);
        Path output = folder.resolve("output");
        Process oracle = new ProcessBuilder(python.toString(), root.resolve("tests/peers/petri_oracle.py").toString(),
            file.toString(), Integer.toString(LIMIT)).redirectErrorStream(true).redirectOutput(output.toFile()).start();
        assertTrue(oracle.waitFor(300, TimeUnit.SECONDS), "the oracle does not come to an end");
        String said = Files.readString(output);
        assertEquals(0, oracle.exitValue(), said);
        String[] lines = said.split("\n");
        assertEquals(NETS, lines.length, said);
        int explored = 0;
        for (int i = 0; i < NETS; i++) {
            String ours = i + " " + answer(nets.get(i));
            explored += ours.contains("more") ? 0 : 1;
            assertEquals(lines[i], ours, nets.get(i).arcs().toString());
        }
        assertTrue(explored > NETS / 2, explored + " nets were small enough");
    }

    /** SNAKES has no capacities. */
    private static PetriNet withoutCapacities(PetriNet net) {
        NetBuilder builder = PetriNet.named(net.name());
        net.places().forEach(place -> builder.place(place.name(), place.initial()));
        net.transitions().forEach(transition -> builder.transition(transition.name()));
        net.arcs().forEach(arc -> builder.arc(arc.kind(), net.place(arc.place()).name(),
            net.transition(arc.transition()).name(), arc.weight()));
        return builder.build();
    }

    private static void write(int number, PetriNet net, StringBuilder text) {
        text.append("net ").append(number).append('\n');
        net.places().forEach(place -> text.append("place ").append(place.name()).append(' ').append(place.initial()).append('\n'));
        net.transitions().forEach(transition -> text.append("transition ").append(transition.name()).append('\n'));
        net.arcs().forEach(arc -> text.append("arc ").append(arc.kind()).append(' ').append(net.place(arc.place()).name())
            .append(' ').append(net.transition(arc.transition()).name()).append(' ').append(arc.weight()).append('\n'));
    }

    private static String answer(PetriNet net) {
        Reachability graph = Reachability.explore(net, LIMIT);
        if (!graph.isComplete()) {
            return "more than " + LIMIT;
        }
        List<String> live = new ArrayList<>();
        for (Transition transition : net.transitions()) {
            if (graph.isLive(transition.index()) == Verdict.YES) {
                live.add(transition.name());
            }
        }
        StringBuilder text = new StringBuilder();
        text.append(graph.size()).append(' ').append(graph.edges()).append(' ').append(graph.deadlocks().size()).append(' ')
            .append(graph.homeStates().cardinality()).append(' ').append(live.isEmpty() ? "-" : String.join("+", live));
        for (Place place : net.places()) {
            text.append(' ').append(graph.bound(place.index()));
        }
        return text.toString();
    }
}
