package tickbus.petri.format;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.StandardCopyOption;
import java.util.ArrayList;
import java.util.HashMap;
import java.util.List;
import java.util.Map;
import tickbus.petri.net.Marking;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;

/**
 * Markings in a file, for a program that is to continue after a restart. Each write replaces the whole file, so a reader
 * finds the markings of one moment, whenever the program ended.
 */
public final class MarkingFile {
    private static final String FIRST = "tickbus markings 1";
    private static final String LAST = "end";

    private MarkingFile() {
    }

    /** Replaces the file by these markings, of nets with different names. */
    public static void write(Path file, List<Marking> markings) throws IOException {
        StringBuilder text = new StringBuilder(FIRST).append('\n');
        for (Marking one : markings) {
            text.append("net ").append(name(one.net())).append('\n');
            for (Place place : one.net().places()) {
                if (one.get(place.index()) > 0) {
                    text.append(one.get(place.index())).append(' ').append(place.name()).append('\n');
                }
            }
        }
        Path made = file.resolveSibling(file.getFileName() + ".new");
        Files.writeString(made, text.append(LAST).append('\n'));
        Files.move(made, file, StandardCopyOption.ATOMIC_MOVE, StandardCopyOption.REPLACE_EXISTING);
    }

    /**
     * Reads the markings of these nets, in their order.
     *
     * @throws NetException with file and line if the file does not hold a marking of exactly these nets
     */
    public static List<Marking> read(Path file, List<PetriNet> nets) throws IOException {
        SourceText source = SourceText.read(file);
        String[] lines = source.lines();
        int last = lines.length;
        while (last > 0 && lines[last - 1].isEmpty()) {
            last--;
        }
        if (last < 2 || !lines[0].equals(FIRST) || !lines[last - 1].equals(LAST)) {
            throw source.mistake(1, "", "expected the markings that were saved, from '" + FIRST + "' to '" + LAST + "'");
        }
        Map<String, PetriNet> byName = new HashMap<>();
        nets.forEach(net -> byName.put(name(net), net));
        Map<PetriNet, Marking> found = new HashMap<>();
        Marking marking = null;
        for (int i = 1; i < last - 1; i++) {
            int blank = lines[i].indexOf(' ');
            String before = lines[i].substring(0, Math.max(0, blank));
            String name = lines[i].substring(blank + 1);
            if (before.equals("net")) {
                PetriNet net = byName.get(name);
                if (net == null || found.containsKey(net)) {
                    throw source.mistake(i + 1, "net " + name, "expected one of " + byName.keySet().stream().sorted().toList() + ", each once");
                }
                marking = net.marking(new int[net.places().size()]);
                found.put(net, marking);
            } else if (marking == null) {
                throw source.mistake(i + 1, "", "'" + SourceText.shortened(lines[i]) + "'; expected a net");
            } else {
                int tokens = source.number(i + 1, "place " + name, "tokens", before, 1);
                try {
                    marking.set(marking.net().place(name).index(), tokens);
                } catch (IllegalArgumentException wrong) {
                    throw source.mistake(i + 1, "", wrong.getMessage());
                }
            }
        }
        List<Marking> all = new ArrayList<>();
        for (PetriNet net : nets) {
            if (!found.containsKey(net)) {
                throw source.mistake(last, "", "there is no net " + net.name());
            }
            all.add(found.get(net));
        }
        return all;
    }

    /** The name on one line. */
    private static String name(PetriNet net) {
        return net.name().replaceAll("\\p{Cntrl}", " ");
    }
}
