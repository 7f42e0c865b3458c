package tickbus.petri.sfc;

import java.util.List;
import java.util.Map;

/**
 * An element of an XML document.
 *
 * @param name without the namespace
 * @param attributes by name without the namespace
 * @param children the elements in it
 * @param code the text of an element {@code ST}, with that of the elements in it; empty in others
 * @param line the line at which its tag begins, from 1
 * @param column the column at which its tag begins, from 1
 */
record XmlElement(String name, Map<String, String> attributes, List<XmlElement> children, List<Word.Piece> code, int line, int column) {
    /** An attribute, or an empty text. */
    String attribute(String named) {
        return attributes.getOrDefault(named, "");
    }

    /** True if an attribute of type boolean is set. */
    boolean is(String named) {
        return List.of("true", "1").contains(attribute(named));
    }

    /** The children of this name. */
    List<XmlElement> all(String named) {
        return children.stream().filter(one -> one.name.equals(named)).toList();
    }

    /** The first child of this name; null without one. */
    XmlElement first(String named) {
        return children.stream().filter(one -> one.name.equals(named)).findFirst().orElse(null);
    }

    /** A word at the place of this element. */
    Word word(String written) {
        return Word.of(written, line, column);
    }
}
