package tickbus.machines.peeler;

import java.util.ArrayList;
import java.util.Collections;
import java.util.List;

/** Events on the line that must not happen, each with its time. */
final class Mishaps {
    /** Further mishaps add no information. */
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
