package tickbus.petri.format;

import java.io.BufferedInputStream;
import java.io.IOException;
import java.io.InputStream;
import java.io.StringReader;
import java.nio.file.Files;
import java.nio.file.Path;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;

/**
 * Reads and writes place/transition nets in PNML (ISO/IEC 15909-2). Pages are flattened and references resolved.
 *
 * <p>The standard's P/T nets have no test or inhibitor arcs. Both are written in three ways at once, as no two tools
 * look at the same place: the attribute {@code type}, which TAPAAL reads, {@code <type value="inhibitor"/>}, which PIPE
 * reads, and {@code <arctype>}, which pm4py and ProM read. Capacities, priorities and delays are written in
 * {@code toolspecific} elements of the tool {@code tickbus}.
 */
public final class Pnml {
    static final String NAMESPACE = "http://www.pnml.org/version-2009/grammar/pnml";
    static final String TYPE = "http://www.pnml.org/version-2009/grammar/ptnet";
    static final String TOOL = "tickbus";

    private Pnml() {
    }

    /** Reads a file with one net; a {@link NetException} says what is wrong with it. */
    public static PetriNet read(Path file) throws IOException {
        return read(file, Dialect.STANDARD).net();
    }

    /** Reads a file with one net in a dialect; warnings name omitted parts, a {@link NetException} the mistake. */
    public static Imported read(Path file, Dialect dialect) throws IOException {
        // From bytes, because the document declares its own encoding.
        try (InputStream bytes = new BufferedInputStream(Files.newInputStream(file))) {
            return new PnmlReader(file.toString(), dialect, factory -> factory.createXMLStreamReader(bytes)).net();
        }
    }

    /** Reads a text with one net; {@code source} is its name in messages. */
    public static PetriNet parse(String source, String text) {
        return parse(source, text, Dialect.STANDARD).net();
    }

    /** Reads a text with one net in a dialect; {@code source} is its name in messages. */
    public static Imported parse(String source, String text, Dialect dialect) {
        return new PnmlReader(source, dialect, factory -> factory.createXMLStreamReader(new StringReader(text))).net();
    }

    /** The net as a PNML document. */
    public static String write(PetriNet net) {
        return write(net, Dialect.STANDARD);
    }

    /**
     * The net as a PNML document for a tool, which has the same markings and firings there. Where the tool lacks them, a test
     * arc becomes a loop and a capacity an inhibitor arc; a {@link NetException} names everything that the tool cannot hold.
     * Delays and priorities that it lacks are in {@code toolspecific} elements, which it ignores.
     */
    public static String write(PetriNet net, Dialect dialect) {
        return new PnmlWriter(net, dialect).write();
    }
}
