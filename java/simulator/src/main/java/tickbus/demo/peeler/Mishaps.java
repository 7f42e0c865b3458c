package tickbus.demo.peeler;

import java.util.ArrayList;
import java.util.Collections;
import java.util.List;

/** Things that happened on the line and must not, each with its time. */
final class Mishaps {
    /** Further ones say nothing new. */
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
