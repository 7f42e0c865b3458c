package tickbus.simulator.demo;

import java.util.ArrayList;
import java.util.Collections;
import java.util.List;
import java.util.function.Consumer;
import tickbus.simulator.text.Durations;

/** What happened, and when in simulation time. */
final class Timeline {
    /** One happening; {@code who} is the actor, such as operator, PLC, rig. */
    record Event(long nanos, String who, String text) {
        String line() {
            return String.format("%s s  %-8s  %s", Durations.seconds(nanos), who, text);
        }
    }

    private final List<Event> events = new ArrayList<>();
    private final Consumer<Event> listener;

    Timeline(Consumer<Event> listener) {
        this.listener = listener;
    }

    void add(long nanos, String who, String text) {
        Event event = new Event(nanos, who, text);
        events.add(event);
        listener.accept(event);
    }

    List<Event> events() {
        return Collections.unmodifiableList(events);
    }
}
