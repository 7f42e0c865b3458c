package tickbus.petri.control;

import java.util.List;

/** Nets that do not fit the driver, or each other. The message has every mistake on a separate line. */
public final class BindingException extends IllegalArgumentException {
    private static final long serialVersionUID = 1L;

    private final transient List<String> mistakes;

    BindingException(List<String> mistakes) {
        super(String.join("\n", mistakes));
        this.mistakes = List.copyOf(mistakes);
    }

    /** The mistakes: what is wrong, what was expected, what to do. */
    public List<String> mistakes() {
        return mistakes;
    }
}
