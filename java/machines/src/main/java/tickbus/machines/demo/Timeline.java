package tickbus.machines.demo;

import java.util.ArrayList;
import java.util.Collections;
import java.util.List;
import java.util.function.Consumer;
import tickbus.simulator.text.Durations;

/** The events, and when they happened in simulation time. */
public final class Timeline {
    /**
     * One event.
     *
     * @param nanos simulation time
     * @param who the actor, such as operator, PLC, rig
     * @param text the event
     */
    public record Event(long nanos, String who, String text) {
        /**
         * The event for people.
         *
         * @return one line
         */
        public String line() {
            return String.format("%s s  %-8s  %s", Durations.seconds(nanos), who, text);
        }
    }

    private final List<Event> events = new ArrayList<>();
    private final Consumer<Event> listener;

    /**
     * An empty timeline.
     *
     * @param listener called at once for each event
     */
    public Timeline(Consumer<Event> listener) {
        this.listener = listener;
    }

    /**
     * Adds an event.
     *
     * @param nanos simulation time
     * @param who the actor
     * @param text the event
     */
    public void add(long nanos, String who, String text) {
        Event event = new Event(nanos, who, text);
        events.add(event);
        listener.accept(event);
    }

    /**
     * All events.
     *
     * @return in the order in which they were added
     */
    public List<Event> events() {
        return Collections.unmodifiableList(events);
    }
}
