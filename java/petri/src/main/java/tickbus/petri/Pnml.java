package tickbus.petri;

import java.io.BufferedInputStream;
import java.io.IOException;
import java.io.InputStream;
import java.io.StringReader;
import java.nio.file.Files;
import java.nio.file.Path;

/**
 * Reads and writes place/transition nets in PNML (ISO/IEC 15909-2). Pages are flattened and references resolved.
 *
 * <p>The standard's P/T nets have no test or inhibitor arcs. They are written as {@code <type value="test"/>} and
 * {@code <type value="inhibitor"/>}, which several tools read; capacities, priorities and delays are written in
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
        // From bytes, as the document itself says how it is encoded.
        try (InputStream bytes = new BufferedInputStream(Files.newInputStream(file))) {
            return new PnmlReader(file.toString(), factory -> factory.createXMLStreamReader(bytes)).net();
        }
    }

    /** Reads a text with one net; {@code source} is its name in messages. */
    public static PetriNet parse(String source, String text) {
        return new PnmlReader(source, factory -> factory.createXMLStreamReader(new StringReader(text))).net();
    }

    /** The net as a PNML document. */
    public static String write(PetriNet net) {
        return PnmlWriter.write(net);
    }
}
