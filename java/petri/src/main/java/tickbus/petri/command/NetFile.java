package tickbus.petri.command;

import java.io.IOException;
import java.io.InputStream;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.NoSuchFileException;
import java.nio.file.Path;
import java.util.HashMap;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import tickbus.petri.format.Dialect;
import tickbus.petri.format.HpsimText;
import tickbus.petri.format.Hpx;
import tickbus.petri.format.Imported;
import tickbus.petri.format.Lola;
import tickbus.petri.format.Pnml;
import tickbus.petri.format.Tina;
import tickbus.petri.net.Delay;
import tickbus.petri.net.PetriNet;
import tickbus.petri.sfc.Sfc;

/** Reads a net from a file of any supported format. */
final class NetFile {
    static final List<String> OPTIONS = List.of("--unit", "--delay");
    private static final int BEGINNING = 2_048;

    private NetFile() {
    }

    /** Reads the net; assumptions go to {@code err}. */
    static PetriNet read(CommandLine line, PrintStream err) throws IOException {
        return read(line, false, err);
    }

    /** The unit of time of the formats that have none. */
    static long unit(CommandLine line) {
        String unit = line.one("--unit", null);
        long nanos = unit == null ? 1_000_000 : time("--unit", unit);
        if (nanos < 1) {
            throw new UsageException("--unit " + unit + ": expected more than 0");
        }
        return nanos;
    }

    /** Reads the net; with {@code unitIsUsed}, {@code --unit} is for the format in which the net will be written. */
    static PetriNet read(CommandLine line, boolean unitIsUsed, PrintStream err) throws IOException {
        Path file = Path.of(line.file());
        String unit = line.one("--unit", null);
        Map<String, Delay> delays = delays(line);
        long nanos = unit(line);
        String format = format(file);
        if (unit != null && !unitIsUsed && !format.equals("hpx") && !format.equals("tina")) {
            throw new UsageException("--unit is for .hpx files and TINA's .net files; " + file + " is not one");
        }
        if (!delays.isEmpty() && !format.equals("text")) {
            throw new UsageException("--delay is for HPSim's text; " + file + " has its delays itself");
        }
        Imported imported = switch (format) {
            case "pnml" -> Pnml.read(file, Dialect.ANY);
            case "hpx" -> Hpx.read(file, nanos);
            case "tina" -> Tina.read(file, nanos);
            case "lola" -> Lola.read(file);
            case "sfc" -> new Imported(Sfc.read(file).net(), List.of("conditions and actions of the chart are left out"));
            default -> HpsimText.read(file, delays);
        };
        imported.warnings().forEach(warning -> err.println("warning: " + warning));
        if ((format.equals("hpx") || format.equals("tina")) && unit == null
                && imported.net().transitions().stream().anyMatch(one -> one.delay().kind() != Delay.Kind.NONE)) {
            err.println("note: the delays of " + file + " have no unit; they are taken as milliseconds, --unit says otherwise");
        }
        for (String name : delays.keySet()) {
            // Throws with a list of all transitions if the name is unknown.
            imported.net().transition(name);
        }
        return imported.net();
    }

    /** The chart of a file, with its conditions and actions; otherwise the net as one. */
    static Sfc chart(CommandLine line, PrintStream err) throws IOException {
        boolean isChart = format(Path.of(line.file())).equals("sfc") && line.one("--unit", null) == null && line.all("--delay").isEmpty();
        return isChart ? Sfc.read(Path.of(line.file())) : Sfc.of(read(line, err));
    }

    private static Map<String, Delay> delays(CommandLine line) {
        Map<String, Delay> delays = new HashMap<>();
        for (String one : line.all("--delay")) {
            int equals = one.lastIndexOf('=');
            if (equals < 1) {
                throw new UsageException("--delay " + one + ": expected NAME=TIME, NAME=exp TIME or NAME=TIME..TIME");
            }
            try {
                delays.put(one.substring(0, equals), Times.delay(one.substring(equals + 1)));
            } catch (IllegalArgumentException wrong) {
                throw new UsageException("--delay " + one + ": " + wrong.getMessage());
            }
        }
        return delays;
    }

    private static long time(String option, String text) {
        try {
            return Times.nanos(text);
        } catch (IllegalArgumentException wrong) {
            throw new UsageException(option + ": " + wrong.getMessage());
        }
    }

    /** The format by the file's name, or else by its beginning. */
    private static String format(Path file) throws IOException {
        String name = file.toString().toLowerCase(Locale.ROOT);
        if (!Files.exists(file)) {
            throw new NoSuchFileException(file.toString());
        }
        if (name.endsWith(".pnml")) {
            return "pnml";
        }
        if (name.endsWith(".st") || name.endsWith(".sfc")) {
            return "sfc";
        }
        if (name.endsWith(".hpx")) {
            return "hpx";
        }
        String text;
        try (InputStream bytes = Files.newInputStream(file)) {
            text = new String(bytes.readNBytes(BEGINNING), StandardCharsets.UTF_8).replaceFirst("^\\uFEFF?\\s*", "");
        }
        if (name.endsWith(".xml")) {
            return xml(text);
        }
        if (name.endsWith(".lola") || text.startsWith("PLACE")) {
            return "lola";
        }
        return name.endsWith(".net") ? "tina" : text.startsWith("<") ? xml(text) : text.startsWith("[") ? "hpx" : "text";
    }

    /** PLCopen XML and PNML have one ending. */
    private static String xml(String beginning) {
        return beginning.contains("<project") ? "sfc" : "pnml";
    }
}
