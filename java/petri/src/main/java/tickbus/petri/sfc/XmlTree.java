package tickbus.petri.sfc;

import java.io.ByteArrayInputStream;
import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.Deque;
import java.util.HashMap;
import java.util.List;
import java.util.Map;
import java.util.Set;
import javax.xml.stream.Location;
import javax.xml.stream.XMLInputFactory;
import javax.xml.stream.XMLStreamConstants;
import javax.xml.stream.XMLStreamException;
import javax.xml.stream.XMLStreamReader;
import tickbus.petri.net.NetException;

/** Reads an XML document into a tree of bounded depth and size. Document types, and so all entities, are refused. */
final class XmlTree {
    private static final int MOST_DEPTH = 100;
    private static final int MOST_ELEMENTS = 500_000;
    /** Elements without a meaning for a chart; they would be most of the tree. */
    private static final Set<String> LEFT_OUT = Set.of("relPosition", "addData", "documentation", "connectionPointOut",
        "connectionPointOutAction");

    private final String file;
    private final Deque<XmlElement> open = new ArrayDeque<>();
    private XmlElement root;
    private int elements;
    /** The end of the last event, at which the next one begins. */
    private int line = 1;
    private int column = 1;

    private XmlTree(String file) {
        this.file = file;
    }

    /** The root of a document. */
    static XmlElement read(String file, byte[] bytes) {
        return new XmlTree(file).tree(bytes);
    }

    private XmlElement tree(byte[] bytes) {
        XMLInputFactory factory = XMLInputFactory.newDefaultFactory();
        factory.setProperty(XMLInputFactory.SUPPORT_DTD, false);
        factory.setProperty(XMLInputFactory.IS_SUPPORTING_EXTERNAL_ENTITIES, false);
        // The place of a text in CDATA is behind its mark.
        factory.setProperty("http://java.sun.com/xml/stream/properties/report-cdata-event", true);
        try {
            XMLStreamReader xml = factory.createXMLStreamReader(new ByteArrayInputStream(bytes));
            while (xml.hasNext()) {
                int event = xml.next();
                event(xml, event);
                moveTo(event, xml.getLocation(), event == XMLStreamConstants.CHARACTERS ? xml.getText() : "");
            }
        } catch (XMLStreamException broken) {
            Location at = broken.getLocation();
            String message = broken.getMessage() == null ? "" : broken.getMessage();
            throw new NetException(file, at == null ? line : at.getLineNumber(), "", "not well-formed XML: "
                + message.substring(message.lastIndexOf('\n') + 1).replaceFirst("^Message: ", ""));
        }
        return root;
    }

    /** Goes to the end of an event. The JDK's place behind a text is one or two columns too far, behind an entity it is right. */
    private void moveTo(int event, Location end, String text) {
        boolean isEntity = text.length() == 1 && "<>&'\"".contains(text) && end.getLineNumber() == line && end.getColumnNumber() > column + 3;
        if (event != XMLStreamConstants.CHARACTERS || isEntity) {
            line = end.getLineNumber();
            column = end.getColumnNumber();
            return;
        }
        int lastBreak = text.lastIndexOf('\n');
        line += (int) text.chars().filter(one -> one == '\n').count();
        column = lastBreak < 0 ? column + text.length() : text.length() - lastBreak;
    }

    private void event(XMLStreamReader xml, int event) throws XMLStreamException {
        switch (event) {
            case XMLStreamConstants.DTD -> throw mistake("a document type declaration; expected none, as PLCopen XML has none");
            case XMLStreamConstants.ENTITY_REFERENCE -> throw mistake("entity &" + xml.getLocalName() + ";; expected none");
            case XMLStreamConstants.START_ELEMENT -> start(xml);
            case XMLStreamConstants.END_ELEMENT -> {
                XmlElement ended = open.pop();
                XmlElement code = code();
                if (code != null && code != ended) {
                    // Two paragraphs are two lines.
                    code.code().add(new Word.Piece("\n", line, column));
                }
            }
            case XMLStreamConstants.CHARACTERS, XMLStreamConstants.CDATA -> {
                XmlElement code = code();
                if (code != null) {
                    int mark = event == XMLStreamConstants.CDATA ? "<![CDATA[".length() : 0;
                    code.code().add(new Word.Piece(xml.getText(), line, column + mark));
                }
            }
            default -> { }
        }
    }

    /** The outermost open element with code; null without one. */
    private XmlElement code() {
        XmlElement found = null;
        for (XmlElement one : open) {
            found = one.name().equals("ST") ? one : found;
        }
        return found;
    }

    private void start(XMLStreamReader xml) {
        if (open.size() == MOST_DEPTH) {
            throw mistake("elements within elements, more than " + MOST_DEPTH + " deep; expected fewer");
        }
        if (++elements > MOST_ELEMENTS) {
            throw mistake("more than " + MOST_ELEMENTS + " elements; expected fewer");
        }
        Map<String, String> attributes = new HashMap<>();
        for (int i = 0; i < xml.getAttributeCount(); i++) {
            attributes.put(xml.getAttributeLocalName(i), xml.getAttributeValue(i));
        }
        XmlElement made = new XmlElement(xml.getLocalName(), attributes, new ArrayList<>(1), new ArrayList<>(0), line, column);
        if (open.isEmpty()) {
            root = made;
        } else if (!LEFT_OUT.contains(made.name())) {
            open.peek().children().add(made);
        }
        open.push(made);
    }

    private NetException mistake(String message) {
        return new NetException(file, line, "", "column " + column + ": " + message);
    }
}
