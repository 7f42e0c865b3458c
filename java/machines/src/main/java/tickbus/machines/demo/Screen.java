package tickbus.machines.demo;

import java.io.PrintStream;
import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.Deque;
import java.util.List;
import tickbus.simulator.TimeSource;

/** A few lines on a terminal, redrawn in place some times a second, with the latest events below them. */
public final class Screen {
    private static final long REDRAW_NANOS = 200_000_000L;
    private static final int SHOWN_EVENTS = 6;
    private static final int BAR = 24;
    private static final int WIDTH = 79;

    private final PrintStream out;
    private final TimeSource time;
    private final Deque<String> events = new ArrayDeque<>();
    private long nextDraw;
    private int drawn;

    /**
     * An empty screen.
     *
     * @param out the terminal
     * @param time the clock
     */
    public Screen(PrintStream out, TimeSource time) {
        this.out = out;
        this.time = time;
        nextDraw = time.nanoTime();
    }

    /**
     * Returns whether standard output is a terminal that can be redrawn.
     *
     * @return false for pipes, files and terminals without a cursor
     */
    public static boolean fits() {
        String term = System.getenv("TERM");
        if (System.console() == null || term == null || term.equals("dumb") || System.getenv("CI") != null) {
            return false;
        }
        try {
            // From JDK 22 on, a console exists even without a terminal, and this method tells the difference.
            return (Boolean) java.io.Console.class.getMethod("isTerminal").invoke(System.console());
        } catch (ReflectiveOperationException e) {
            return true;
        }
    }

    /**
     * Adds an event.
     *
     * @param line the event
     */
    public void event(String line) {
        events.add(line);
        if (events.size() > SHOWN_EVENTS) {
            events.remove();
        }
    }

    /**
     * Returns whether to draw now; call it at every tick.
     *
     * @return true some times a second
     */
    public boolean due() {
        long now = time.nanoTime();
        if (now - nextDraw < 0) {
            return false;
        }
        nextDraw = now + REDRAW_NANOS;
        return true;
    }

    /**
     * Draws the state.
     *
     * @param state lines above the events
     */
    public void draw(List<String> state) {
        List<String> lines = new ArrayList<>(state);
        lines.add("");
        lines.addAll(events);
        while (lines.size() < drawn) {
            lines.add("");
        }
        StringBuilder text = new StringBuilder();
        if (drawn > 0) {
            text.append("\u001b[").append(drawn).append('A');
        }
        for (String line : lines) {
            text.append(line, 0, Math.min(line.length(), WIDTH)).append("\u001b[K\n");
        }
        drawn = lines.size();
        out.print(text);
        out.flush();
    }

    /** Writes out what was drawn. */
    public void flush() {
        out.flush();
    }

    /**
     * A bar.
     *
     * @param part the filled part, 0 to 1
     * @return characters
     */
    public static String bar(double part) {
        int full = (int) Math.round(Math.max(0, Math.min(1, part)) * BAR);
        return "[" + "#".repeat(full) + ".".repeat(BAR - full) + "]";
    }
}
