package tickbus.simulator.peeler;

import java.util.ArrayList;
import java.util.Collections;
import java.util.List;

/** What must not happen on the line, and did: each at its time. */
final class Mishaps {
    /** More than these say nothing new. */
    private static final int MOST = 100;

    private final List<String> texts = new ArrayList<>();

    void add(String text) {
        if (texts.size() < MOST) {
            texts.add(text);
        }
    }

    List<String> texts() {
        return Collections.unmodifiableList(texts);
    }
}
