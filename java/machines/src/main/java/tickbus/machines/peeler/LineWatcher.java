package tickbus.machines.peeler;

import controlinterface.ControlInterfaceDeviceDriver;
import java.util.ArrayList;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.demo.Timeline;
import tickbus.simulator.Simulator;

/** Follows the blocks, the wood and the links from tick to tick, and records changes. */
final class LineWatcher {
    /** Statistics are slow, so they are read only now and then. */
    private static final int TICKS_PER_LOOK_AT_LINKS = 50;

    private final Simulator simulator;
    private final Peeler line;
    private final Timeline timeline;
    private final String[] links;
    private final boolean[] ran;
    private String broken;
    private long silentNanos;
    private final List<String> shapes = new ArrayList<>();
    private int centred;
    private int clamped;
    private int held;
    private boolean round;
    private int cores;
    private List<AxisName> failed = List.of();
    private double ribbonBefore;

    LineWatcher(Simulator simulator, Peeler line, Timeline timeline) {
        this.simulator = simulator;
        this.line = line;
        this.timeline = timeline;
        this.links = new String[simulator.drivers().size()];
        this.ran = new boolean[links.length];
    }

    Simulator simulator() {
        return simulator;
    }

    Peeler line() {
        return line;
    }

    /** Shapes of the blocks that were peeled to their cores. */
    List<String> peeled() {
        return List.copyOf(shapes);
    }

    /** A driver's line state as last reported. */
    String link(int driver) {
        return links[driver] == null ? "not known yet" : links[driver];
    }

    /** The reason for which a running link broke; null if none has. */
    String broken() {
        return broken;
    }

    /** How long the broken link had been silent. */
    long silentNanos() {
        return silentNanos;
    }

    /** Checks everything once, after a tick. Fails if an event on the line must not happen. */
    void look() {
        long now = simulator.simulationNanos();
        if (simulator.ticks() % TICKS_PER_LOOK_AT_LINKS == 1) {
            lookAtLinks(now);
        }
        centred = moved(now, Place.CENTRING, centred, "charger", "the centring spindles hold block %d, %s");
        clamped = moved(now, Place.CLAMPS, clamped, "charger", "the transfer arm has block %d, %s");
        lookAtWood(now);
        held = moved(now, Place.LATHE, held, "lathe", "the spindles hold block %d, %s");
        lookAtAxes(now);
        if (!line.mishaps().isEmpty()) {
            throw new DemoFailure("on the line: " + line.mishaps().get(0));
        }
    }

    private int moved(long now, Place place, int before, String who, String text) {
        int block = line.blockAt(place);
        if (block != before && block != 0) {
            timeline.add(now, who, String.format(Locale.ROOT, text, block, line.shapeAt(place))
                    + (place == Place.LATHE ? text(", %.1f mm off its axis", line.eccentricity()) : ""));
            if (place == Place.LATHE) {
                shapes.add(line.shapeAt(place));
                ribbonBefore = line.wood().ribbon();
            }
        }
        return block;
    }

    private void lookAtAxes(long now) {
        List<AxisName> before = failed;
        failed = line.failed();
        for (AxisName axis : AxisName.values()) {
            if (failed.contains(axis) != before.contains(axis)) {
                timeline.add(now, axis.ofCharger() ? "charger" : "lathe",
                        "the axis " + axis.label() + (failed.contains(axis) ? " is not healthy" : " is healthy again"));
            }
        }
    }

    private void lookAtWood(long now) {
        if (line.round() != round) {
            round = line.round();
            if (round) {
                timeline.add(now, "lathe", text("block " + held + " is round, the ribbon is whole; knife at %.1f mm",
                        line.position(AxisName.KNIFE_CARRIAGE)));
            }
        }
        if (line.wood().coreCount() != cores) {
            cores = line.wood().coreCount();
            timeline.add(now, "lathe", "block " + held + " is peeled: "
                    + text("%.1f m of ribbon", line.wood().ribbon() - ribbonBefore) + ", the core falls");
        }
        if (line.wood().unpeeledCount() > 0) {
            throw new DemoFailure("block " + held + " fell before it was peeled");
        }
    }

    private static String text(String format, double value) {
        return String.format(Locale.ROOT, format, value);
    }

    private void lookAtLinks(long now) {
        for (int i = 0; i < links.length; i++) {
            ControlInterfaceDeviceDriver driver = simulator.drivers().get(i);
            Map<String, String> statistics = driver.statistics();
            String reason = statistics.getOrDefault("reason", "");
            String state = statistics.getOrDefault("state", "no state") + (reason.isEmpty() ? "" : ": " + reason);
            if (!state.equals(links[i])) {
                links[i] = state;
                timeline.add(now, "link", driver.name() + ": " + state);
            }
            boolean runs = "running".equals(statistics.get("state"));
            if (ran[i] && !runs && broken == null) {
                broken = "the link to the PLC of the " + driver.name().toLowerCase(Locale.ROOT) + " broke: " + state;
                silentNanos = (long) (simulator.probe(driver.id() + ":bus.age").getAsDouble() * 1e9);
            }
            ran[i] |= runs;
        }
    }
}
