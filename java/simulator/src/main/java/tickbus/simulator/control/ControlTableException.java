package tickbus.simulator.control;

import java.util.List;
import java.util.stream.Collectors;

/** A control table that cannot be used, with all its mistakes. */
public final class ControlTableException extends RuntimeException {
    private static final long serialVersionUID = 1L;

    private final transient List<Mistake> mistakes;

    ControlTableException(List<Mistake> mistakes) {
        super(mistakes.stream().map(Mistake::toString).collect(Collectors.joining("\n")));
        this.mistakes = List.copyOf(mistakes);
    }

    /**
     * All mistakes in the order of their lines.
     *
     * @return at least one
     */
    public List<Mistake> mistakes() {
        return mistakes;
    }
}
