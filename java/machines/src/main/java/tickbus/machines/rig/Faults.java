package tickbus.machines.rig;

import java.util.ArrayList;
import java.util.List;

/** The causes of Not OK, latched until acknowledged. */
final class Faults {
    /** The kinds of fault that the counters distinguish. */
    enum Kind {
        JAM(false),
        COLLISION(true),
        OCCUPIED(true),
        DOUBLE_GRIP(true),
        PUSHED(true),
        FELL(false),
        END_STOP(false),
        UNREFERENCED(false);

        private final boolean collision;

        Kind(boolean collision) {
            this.collision = collision;
        }
    }

    private final List<String> texts = new ArrayList<>();
    private boolean latched;
    private long risen;
    private long collisions;

    void raise(Kind kind, String text) {
        if (!latched) {
            latched = true;
            risen++;
        }
        if (!texts.contains(text)) {
            texts.add(text);
            if (kind.collision) {
                collisions++;
            }
        }
    }

    void acknowledge() {
        latched = false;
        texts.clear();
    }

    boolean latched() {
        return latched;
    }

    List<String> texts() {
        return List.copyOf(texts);
    }

    long risen() {
        return risen;
    }

    long collisions() {
        return collisions;
    }
}
