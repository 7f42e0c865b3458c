package tickbus.petri.format;

import java.io.IOException;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.HashSet;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.Set;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;

/**
 * Reads the text that HPSim exports: names, incidence matrix, marking, arc types and time models.
 *
 * <p>HPSim writes the incidence matrix as input minus output weights, the other way round than the field does. The export
 * lacks the weights of inhibitor and test arcs, which are taken to be 1 with a warning, and the figures of delays, which the
 * caller gives. If a place is both input and output of one transition, the export lacks one of the two arcs. The {@code
 * .hpx} file ({@link Hpx}) has all of that.
 */
public final class HpsimText {
    private enum Section { TRANSITIONS, PLACES, INCIDENCE, MARKING, TYPES, TIMES }

    private final SourceText source;
    private final List<List<Line>> sections = new ArrayList<>();
    private final int[] headings = new int[Section.values().length];
    private final List<String> warnings = new ArrayList<>();

    private record Line(int number, String text) {
    }

    private HpsimText(SourceText source) {
        this.source = source;
    }

    /** Reads a file with immediate transitions only. */
    public static Imported read(Path file) throws IOException {
        return read(file, Map.of());
    }

    /** Reads a file; {@code delays} has the delay of each transition whose time model is not immediate, by its name. */
    public static Imported read(Path file, Map<String, Delay> delays) throws IOException {
        return new HpsimText(SourceText.read(file)).net(delays);
    }

    /** Reads a text; {@code source} is its name in messages. */
    public static Imported parse(String source, String text, Map<String, Delay> delays) {
        return new HpsimText(new SourceText(source, text)).net(delays);
    }

    private Imported net(Map<String, Delay> delays) {
        if (source.text().indexOf('\0') >= 0) {
            throw source.mistake(1, "", "a binary file; if it is a .hps of HPSim, open it there and export it as .hpx");
        }
        split();
        List<String> transitions = names(Section.TRANSITIONS);
        List<String> places = names(Section.PLACES);
        int[][] incidence = matrix(Section.INCIDENCE, places.size(), transitions.size(), Integer.MIN_VALUE + 1);
        int[] marking = vector(Section.MARKING, places.size(), "place", 0, Integer.MAX_VALUE);
        int[][] types = matrix(Section.TYPES, places.size(), transitions.size(), 0);
        int[] times = vector(Section.TIMES, transitions.size(), "transition", 1, 4);
        NetBuilder builder = PetriNet.named(source.source());
        for (int p = 0; p < places.size(); p++) {
            builder.place(places.get(p), marking[p]);
        }
        for (int t = 0; t < transitions.size(); t++) {
            String name = transitions.get(t);
            builder.transition(name).delay(delay(name, times[t], delays));
            for (int p = 0; p < places.size(); p++) {
                arc(builder, places.get(p), name, incidence[p][t], types[p][t]);
            }
        }
        return new Imported(builder.build(), List.copyOf(warnings));
    }

    private void arc(NetBuilder builder, String place, String transition, int incidence, int type) {
        String element = "place " + place + ", transition " + transition;
        int line = headings[Section.TYPES.ordinal()];
        if (type > 3) {
            throw source.mistake(line, element, "arc type " + type
                + "; expected 0 (none), 1 (normal), 2 (inhibitor) or 3 (test)");
        }
        if (type == 1 && incidence == 0) {
            throw source.mistake(line, element, "a normal arc, but incidence 0: a place that is input and output of one "
                + "transition cannot be told from this format; read the .hpx file");
        }
        if (type != 1 && incidence != 0) {
            throw source.mistake(line, element, "arc type " + type + " with incidence " + incidence
                + "; expected type 1; if both arcs are there, read the .hpx file");
        }
        switch (type) {
            case 1 -> builder.arc(incidence > 0 ? ArcKind.INPUT : ArcKind.OUTPUT, place, transition, Math.abs(incidence));
            case 2, 3 -> {
                builder.arc(type == 2 ? ArcKind.INHIBITOR : ArcKind.TEST, place, transition, 1);
                warnings.add(source.source() + ":" + line + ": " + element + ": the format has no weight for "
                    + (type == 2 ? "an inhibitor" : "a test") + " arc; 1 is assumed");
            }
            default -> { }
        }
    }

    private Delay delay(String transition, int model, Map<String, Delay> delays) {
        Delay given = delays.get(transition);
        if (model == 1) {
            return Delay.NONE;
        }
        Delay.Kind expected = Delay.Kind.values()[model - 1];
        if (given == null || given.kind() != expected) {
            throw source.mistake(headings[Section.TIMES.ordinal()], "transition " + transition, "time model " + model
                + (given == null ? ", but the format has no figures" : ", but the delay given is " + given.kind())
                + "; hand in a delay of kind " + expected + " under its name, or read the .hpx file");
        }
        return given;
    }

    /** Finds the sections by a keyword of their comments, because the spelling of the headings varies between versions. */
    private void split() {
        for (int i = 0; i < headings.length; i++) {
            sections.add(new ArrayList<>());
        }
        Section section = null;
        boolean afterCodes = false;
        String[] lines = source.lines();
        for (int i = 0; i < lines.length; i++) {
            String text = lines[i].strip();
            if (text.startsWith("//")) {
                Section found = section(text.toLowerCase(Locale.ROOT));
                afterCodes = found == null;
                if (found == null) {
                    continue;
                }
                if (headings[found.ordinal()] != 0) {
                    throw source.mistake(i + 1, "", "a second section '" + text + "'; the first is in line "
                        + headings[found.ordinal()]);
                }
                section = found;
                headings[found.ordinal()] = i + 1;
            } else if (afterCodes && text.matches("[A-Za-z ]+;?")) {
                afterCodes = false; // the rest of a comment that an editor has wrapped
            } else if (!text.isEmpty()) {
                afterCodes = false;
                if (section == null) {
                    throw source.mistake(i + 1, "", "'" + SourceText.shortened(text)
                        + "' before any section; expected '// Transition Name Vector:'");
                }
                sections.get(section.ordinal()).add(new Line(i + 1, text));
            }
        }
        for (Section one : Section.values()) {
            if (headings[one.ordinal()] == 0) {
                throw source.mistake(lines.length, "", "there is no section of " + one.name().toLowerCase(Locale.ROOT)
                    + "; expected six sections: names of transitions and places, incidence matrix, marking, arc types, "
                    + "time models");
            }
        }
    }

    private static Section section(String comment) {
        if (comment.contains("transition name")) {
            return Section.TRANSITIONS;
        }
        if (comment.contains("position name") || comment.contains("place name")) {
            return Section.PLACES;
        }
        if (comment.contains("inziden") || comment.contains("inciden")) {
            return Section.INCIDENCE;
        }
        if (comment.contains("marking")) {
            return Section.MARKING;
        }
        if (comment.contains("arc type")) {
            return Section.TYPES;
        }
        return comment.contains("time model") ? Section.TIMES : null;
    }

    /** The text without parentheses, and without the {@code _T(} that one version writes for them. */
    private static String bare(String text) {
        return text.replace("_T(", " ").replaceAll("[(){}]", " ");
    }

    private List<String> names(Section section) {
        List<String> names = new ArrayList<>();
        Set<String> seen = new HashSet<>();
        for (Line line : sections.get(section.ordinal())) {
            for (String name : bare(line.text).split(";")) {
                if (name.isBlank()) {
                    continue;
                }
                if (!seen.add(name.strip())) {
                    throw source.mistake(line.number, "name " + name.strip(), "given twice; expected a name of its own");
                }
                names.add(name.strip());
            }
        }
        return names;
    }

    private int[][] matrix(Section section, int rows, int columns, int least) {
        List<int[]> matrix = new ArrayList<>();
        for (Line line : sections.get(section.ordinal())) {
            String[] cells = cells(line);
            if (cells.length == 0) {
                continue;
            }
            String element = "row " + (matrix.size() + 1);
            if (cells.length != columns) {
                throw source.mistake(line.number, element, cells.length + " columns; expected " + columns
                    + ", one for each transition");
            }
            int[] row = new int[columns];
            for (int c = 0; c < columns; c++) {
                row[c] = source.number(line.number, element + ", column " + (c + 1), "entry", cells[c], least);
            }
            matrix.add(row);
        }
        if (columns == 0) {
            return new int[rows][0];
        }
        if (matrix.size() != rows) {
            throw source.mistake(headings[section.ordinal()], "", matrix.size() + " rows; expected " + rows
                + ", one for each place");
        }
        return matrix.toArray(new int[0][]);
    }

    private int[] vector(Section section, int size, String each, int least, int most) {
        List<Integer> values = new ArrayList<>();
        for (Line line : sections.get(section.ordinal())) {
            for (String cell : cells(line)) {
                int value = source.number(line.number, "entry " + (values.size() + 1), "value", cell, least);
                if (value > most) {
                    throw source.mistake(line.number, "entry " + (values.size() + 1), "value " + value + "; expected "
                        + least + " to " + most);
                }
                values.add(value);
            }
        }
        if (values.size() != size) {
            throw source.mistake(headings[section.ordinal()], "", values.size() + " entries; expected " + size
                + ", one for each " + each);
        }
        return values.stream().mapToInt(Integer::intValue).toArray();
    }

    private static String[] cells(Line line) {
        String text = bare(line.text).replaceAll("[;,]", " ").strip();
        return text.isEmpty() ? new String[0] : text.split("\\s+");
    }
}
