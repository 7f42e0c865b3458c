package tickbus.petri.format;

import java.io.IOException;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.HashMap;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Optional;
import java.util.TreeMap;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;

/**
 * Reads the interchange files of HPSim 0.9, {@code .hpx}: weights, capacities, arcs of all kinds and delays.
 *
 * <p>A delay in HPSim is a number without a unit; the caller gives the unit.
 */
public final class Hpx {
    /** HPSim's arc types, by number. */
    private static final ArcKind[] TYPES = {ArcKind.INPUT, ArcKind.INHIBITOR, ArcKind.TEST};
    /** Left, top, right and bottom. */
    private static final Pattern RECTANGLE =
        Pattern.compile("[^-\\d]*(-?\\d+)[^-\\d]+(-?\\d+)[^-\\d]+(-?\\d+)[^-\\d]+(-?\\d+)[^-\\d]*");

    private final SourceText source;
    private final long unit;
    private final TreeMap<Integer, Section> places = new TreeMap<>();
    private final TreeMap<Integer, Section> transitions = new TreeMap<>();
    private final TreeMap<Integer, Section> connectors = new TreeMap<>();
    private final Map<Integer, String> labels = new HashMap<>();
    private final List<String> warnings = new ArrayList<>();

    private final class Section {
        final String name;
        final int line;
        final Map<String, String> values = new HashMap<>();
        final Map<String, Integer> lines = new HashMap<>();

        Section(String name, int line) {
            this.name = name;
            this.line = line;
        }

        String text(String key) {
            String value = values.get(key);
            if (value == null) {
                throw source.mistake(line, name, "there is no " + key + "; is the file cut off?");
            }
            return value;
        }

        int number(String key, int least) {
            return source.number(lines.getOrDefault(key, line), name, key, text(key), least);
        }

        NetException mistake(String key, String message) {
            return source.mistake(lines.getOrDefault(key, line), name, message);
        }
    }

    private Hpx(SourceText source, long unit) {
        if (unit < 1) {
            throw new IllegalArgumentException("a unit of " + unit + " ns; expected 1 or more");
        }
        this.source = source;
        this.unit = unit;
    }

    /** Reads a file; {@code unit} is the length of HPSim's unit of time in nanoseconds, 1 or more. */
    public static Imported read(Path file, long unit) throws IOException {
        return new Hpx(SourceText.read(file), unit).net();
    }

    /** Reads a text; {@code source} is its name in messages. */
    public static Imported parse(String source, String text, long unit) {
        return new Hpx(new SourceText(source, text), unit).net();
    }

    private Imported net() {
        Section document = null;
        for (Section section : sections()) {
            if (section.name.equals("DOCUMENT")) {
                document = section;
            } else if (section.name.startsWith("OBJECT")) {
                object(section);
            }
        }
        if (document == null) {
            throw source.mistake(1, "", "there is no section [DOCUMENT]; expected a file that HPSim has exported");
        }
        expect(document, "APPLICATION", "HPSim");
        expect(document, "VERSION", "0.9");
        complete(document, "LAST_POSI_ID", places, 1_000_000, "places");
        complete(document, "LAST_TRAN_ID", transitions, 0, "transitions");
        complete(document, "LAST_CONN_ID", connectors, 2_000_000, "arcs");
        Map<Integer, String> placeNames = names(places, "P");
        Map<Integer, String> transitionNames = names(transitions, "T");
        NetBuilder builder = PetriNet.named(source.source());
        places.forEach((id, section) -> builder.place(placeNames.get(id), section.number("TOKENS_START", 0))
            .capacity(section.number("TOKENS_CAPAZITY", 1)));
        transitions.forEach((id, section) -> builder.transition(transitionNames.get(id)).delay(delay(section)));
        arcs(builder, placeNames, transitionNames);
        places.forEach((id, section) -> centre(section).ifPresent(at -> builder.placeAt(placeNames.get(id), at[0], at[1])));
        transitions.forEach((id, section) -> centre(section).ifPresent(at -> builder.transitionAt(transitionNames.get(id), at[0], at[1])));
        return new Imported(builder.build(), List.copyOf(warnings));
    }

    private static void expect(Section document, String key, String value) {
        if (!document.text(key).equals(value)) {
            throw document.mistake(key, key + " " + SourceText.shortened(document.text(key)) + "; expected " + value);
        }
    }

    /** HPSim does not reuse the ids of deleted objects, so a gap at the end can mean that the file is cut off. */
    private void complete(Section document, String key, TreeMap<Integer, Section> found, int first, String what) {
        int next = document.number(key, 0);
        int after = found.isEmpty() ? first : found.lastKey() + 1;
        if (after < next) {
            warnings.add(source.source() + ":" + document.line + ": " + key + " is " + next + ", but the ids of "
                + what + " end before " + after + ": the others were deleted, or the file is cut off");
        }
    }

    private List<Section> sections() {
        if (!source.text().endsWith("\n")) {
            throw source.mistake(source.lines().length, "", "the last line has no end: the file is cut off");
        }
        List<Section> sections = new ArrayList<>();
        String[] lines = source.lines();
        for (int i = 0; i < lines.length; i++) {
            String text = lines[i].strip();
            int equals = text.indexOf('=');
            if (text.startsWith("[") && text.endsWith("]")) {
                sections.add(new Section(text.substring(1, text.length() - 1), i + 1));
            } else if (!text.isEmpty()) {
                if (equals < 1 || sections.isEmpty()) {
                    throw source.mistake(i + 1, "", "'" + SourceText.shortened(text)
                        + "'; expected [SECTION], then lines of KEY=value");
                }
                Section section = sections.get(sections.size() - 1);
                String key = text.substring(0, equals).strip();
                if (section.values.put(key, text.substring(equals + 1).strip()) != null) {
                    throw source.mistake(i + 1, section.name, key + " is given twice");
                }
                section.lines.put(key, i + 1);
            }
        }
        return sections;
    }

    private void object(Section section) {
        switch (section.text("RUNTIME_CLASS")) {
            case "CHPosition" -> add(section, "POSITION_ID", places);
            case "CHTransition" -> add(section, "TRANSITION_ID", transitions);
            case "CHConnector" -> add(section, "ARC_ID", connectors);
            case "CHLabel" -> {
                // Sub-label 0 of a place or transition is its name; the others are figures in the drawing.
                int owner = section.number("OWNER_IDENT", 0);
                String text = section.text("TEXT");
                if (section.number("SUB_IDENT", 0) == 0 && !text.isEmpty()) {
                    labels.put(owner, text);
                }
            }
            case "CHText", "CHRect", "CHLine", "CHPoly" -> { }
            default -> throw section.mistake("RUNTIME_CLASS", "RUNTIME_CLASS "
                + SourceText.shortened(section.text("RUNTIME_CLASS"))
                + "; expected CHPosition, CHTransition, CHConnector, CHLabel or a drawing");
        }
    }

    private void add(Section section, String key, Map<Integer, Section> to) {
        int id = section.number(key, 0);
        if (places.containsKey(id) || transitions.containsKey(id) || connectors.containsKey(id)) {
            throw section.mistake(key, key + " " + id + " is given twice; expected an id of its own");
        }
        to.put(id, section);
    }

    /** The labels, if every node has a label and all differ; otherwise a letter and the id. */
    private Map<Integer, String> names(Map<Integer, Section> nodes, String letter) {
        Map<Integer, String> names = new LinkedHashMap<>();
        nodes.forEach((id, section) -> names.put(id, labels.getOrDefault(id, "")));
        if (names.containsValue("") || names.values().stream().distinct().count() < names.size()) {
            warnings.add(source.source() + ": not every one of " + letter + names.keySet()
                + " has a label of its own; they are named by letter and id");
            names.replaceAll((id, label) -> letter + id);
        }
        return names;
    }

    /**
     * The middle of the rectangle in which HPSim draws a node. Unreadable positions are left out: the net does not need
     * them.
     */
    private static Optional<double[]> centre(Section section) {
        Matcher sides = RECTANGLE.matcher(section.values.getOrDefault("BOUNDING_RECT", ""));
        if (!sides.matches()) {
            return Optional.empty();
        }
        double[] side = new double[4];
        for (int i = 0; i < 4; i++) {
            side[i] = Double.parseDouble(sides.group(i + 1));
        }
        return Optional.of(new double[] {(side[0] + side[2]) / 2, (side[1] + side[3]) / 2});
    }

    private Delay delay(Section section) {
        int mode = section.number("TRANSITION_TIME_MODE", 0);
        if (mode > 3) {
            throw section.mistake("TRANSITION_TIME_MODE", "TRANSITION_TIME_MODE " + mode
                + "; expected 0 (immediate), 1 (delay), 2 (exponential) or 3 (equal distribution)");
        }
        int first = section.number("FIRE_DELAY", 0);
        int second = section.number("FIRE_DELAY_RANGE", 0);
        if (mode == 3 && second < first) {
            throw section.mistake("FIRE_DELAY_RANGE", "FIRE_DELAY_RANGE " + second + "; expected at least FIRE_DELAY, "
                + first);
        }
        try {
            return switch (mode) {
                case 0 -> Delay.NONE;
                case 1 -> Delay.fixed(Math.multiplyExact(first, unit));
                case 2 -> Delay.exponential(Math.multiplyExact(first, unit));
                default -> Delay.uniform(Math.multiplyExact(first, unit), Math.multiplyExact(second, unit));
            };
        } catch (ArithmeticException overflow) {
            throw section.mistake("FIRE_DELAY", "a delay of more than " + Long.MAX_VALUE + " ns");
        }
    }

    private record Ends(ArcKind kind, int place, int transition) {
    }

    private void arcs(NetBuilder builder, Map<Integer, String> placeNames, Map<Integer, String> transitionNames) {
        Map<Ends, Integer> weights = new LinkedHashMap<>();
        for (Section section : connectors.values()) {
            int from = section.number("SOURCE_ID", 0);
            int to = section.number("TARGET_ID", 0);
            int type = section.number("ARC_TYP", 0);
            int weight = section.number("ARC_WEIGHT", 1);
            if (type >= TYPES.length) {
                throw section.mistake("ARC_TYP", "ARC_TYP " + type + "; expected 0 (normal), 1 (inhibitor) or 2 (test)");
            }
            Ends ends;
            if (places.containsKey(from) && transitions.containsKey(to)) {
                ends = new Ends(TYPES[type], from, to);
            } else if (transitions.containsKey(from) && places.containsKey(to)) {
                if (type != 0) {
                    throw section.mistake("ARC_TYP", "ARC_TYP " + type + " on an arc to a place; expected 0 (normal)");
                }
                ends = new Ends(ArcKind.OUTPUT, to, from);
            } else {
                throw section.mistake("SOURCE_ID", "an arc from " + from + " to " + to
                    + "; expected the ids of a place and a transition of this file");
            }
            if (weights.containsKey(ends) && ends.kind != ArcKind.INPUT && ends.kind != ArcKind.OUTPUT) {
                throw section.mistake("SOURCE_ID", "a second " + ends.kind + " arc from " + from + " to " + to);
            }
            try {
                weights.merge(ends, weight, Math::addExact);
            } catch (ArithmeticException overflow) {
                throw section.mistake("ARC_WEIGHT", "together the arcs from " + from + " to " + to + " weigh more than "
                    + Integer.MAX_VALUE);
            }
        }
        weights.forEach((ends, weight) -> builder.arc(ends.kind, placeNames.get(ends.place),
            transitionNames.get(ends.transition), weight));
    }
}
