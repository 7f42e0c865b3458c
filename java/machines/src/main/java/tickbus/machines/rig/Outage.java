package tickbus.machines.rig;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.Direction;
import controlinterface.HardwareComponent;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.Locale;
import java.util.Set;
import java.util.function.DoubleSupplier;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.demo.Timeline;
import tickbus.simulator.Simulator;
import tickbus.simulator.text.Columns;
import tickbus.simulator.text.Durations;

/**
 * The time without a PLC, from the tick of the kill to the first tick with data of the next life: the checks of every tick,
 * and the measurements.
 */
final class Outage {
    /** Outputs that are on while no data arrive: the rig's cups. See the rig's driver.cfg. */
    private static final Set<String> FAIL_SAFE_ON = Set.of("SC1", "SC2");

    /** The tolerated delay beyond max_age until the data are stale: some bus cycles and ticks. */
    private static final long SLACK_NANOS = 50_000_000L;

    /** The time in which a drive must brake from full speed. */
    private static final long BRAKING_NANOS = 300_000_000L;

    private static final long NEVER = Long.MIN_VALUE;

    private final Simulator simulator;
    private final Rig rig;
    private final Timeline timeline;
    private final long maxAgeNanos;
    private final List<String> commands = new ArrayList<>();
    private final List<DoubleSupplier> values = new ArrayList<>();
    private final Counters before;
    private final String place;
    private final String plc;
    private final int bottlesBefore;
    private final long killed;
    private long stale = NEVER;
    private long still = NEVER;
    private long back = NEVER;
    private double[] stand;
    private String standing;
    private String left = "";

    Outage(Watcher watcher, ControlInterfaceDeviceDriver driver, Timeline timeline, String plc, long maxAgeNanos) {
        this.simulator = watcher.simulator();
        this.rig = watcher.rig();
        this.timeline = timeline;
        this.plc = plc;
        this.maxAgeNanos = maxAgeNanos;
        for (HardwareComponent component : driver.components()) {
            if (component.type().equals("BOOL") && component.direction() == Direction.READ_BY_SIMULATION) {
                commands.add(component.name());
                values.add(simulator.probe(driver.id() + ":" + component.name()));
            }
        }
        before = rig.counters();
        bottlesBefore = rig.bottles().size();
        killed = simulator.simulationNanos();
        place = "step " + watcher.step() + ", " + scene();
    }

    /** Checks everything once, after a tick. Fails if the rig is not safe. */
    void look(boolean staleNow) {
        if (over()) {
            return;
        }
        long now = simulator.simulationNanos();
        nothingHappened();
        if (!staleNow) {
            if (stale != NEVER) {
                back = now;
                timeline.add(now, "link", "back after " + seconds(back - killed) + " s without a PLC");
            } else if (now - killed > maxAgeNanos + SLACK_NANOS) {
                throw new DemoFailure("the PLC has been dead for " + Durations.text(now - killed)
                        + ", but its data are not stale, although max_age is " + Durations.text(maxAgeNanos));
            }
            return;
        }
        if (stale == NEVER) {
            stale = now;
        }
        failSafe();
        if (stand == null) {
            if (!rig.moving()) {
                still = now;
                stand = where();
                standing = scene();
                timeline.add(now, "rig", "stands still " + seconds(still - killed) + " s after the kill: " + standing);
            } else if (now - stale > BRAKING_NANOS) {
                throw new DemoFailure("without a PLC the rig still moves " + Durations.text(now - killed)
                        + " after the kill: " + scene());
            }
        } else if (rig.moving() || !Arrays.equals(stand, where())) {
            throw new DemoFailure("without a PLC the rig moved again: it stood with " + standing + ", now "
                    + scene());
        }
    }

    private void nothingHappened() {
        Counters now = rig.counters();
        if (now.fallen() != before.fallen() || now.collisions() != before.collisions()
                || now.faults() != before.faults()) {
            throw new DemoFailure("without a PLC the rig was not safe: " + String.join("; ", rig.faults()));
        }
    }

    private void failSafe() {
        for (int i = 0; i < commands.size(); i++) {
            boolean on = values.get(i).getAsDouble() != 0;
            if (on != FAIL_SAFE_ON.contains(commands.get(i))) {
                throw new DemoFailure("\"" + commands.get(i) + "\" is " + (on ? "on" : "off")
                        + " while the data are stale; that is not its fail-safe value");
            }
        }
    }

    /** Every position that can change, as numbers. */
    private double[] where() {
        List<Bottle> bottles = rig.bottles();
        double[] where = new double[4 + 2 * bottles.size()];
        where[0] = rig.position(Lift.LA1);
        where[1] = rig.position(Lift.LA2);
        where[2] = rig.wheel1Angle();
        where[3] = rig.wheel2Angle();
        for (int i = 0; i < bottles.size(); i++) {
            where[4 + 2 * i] = bottles.get(i).id() + bottles.get(i).place().ordinal() / 100.0;
            where[5 + 2 * i] = bottles.get(i).height();
        }
        return where;
    }

    /** The positions of the lifts and what they hold, for people. */
    private String scene() {
        return String.format(Locale.ROOT, "LA1 at %.0f mm with %s, LA2 at %.0f mm with %s",
                rig.position(Lift.LA1), held(Bottle.Place.CUP1), rig.position(Lift.LA2), held(Bottle.Place.CUP2));
    }

    private String held(Bottle.Place cup) {
        return rig.bottles().stream().filter(bottle -> bottle.place() == cup)
                .map(bottle -> "bottle " + bottle.id()).findFirst().orElse("no bottle");
    }

    /** The point in the cycle at which the PLC was killed, for people. */
    String place() {
        return place;
    }

    /** The driver's reason for the lost link after the kill. */
    void left(String reason) {
        left = reason;
    }

    /** The data are stale, fail-safe values are delivered, and nothing moves. */
    boolean standsStill() {
        return stand != null;
    }

    boolean over() {
        return back != NEVER;
    }

    /** Simulation time since the kill. */
    long lastedNanos() {
        return (over() ? back : simulator.simulationNanos()) - killed;
    }

    /** For the report. */
    String text(String indent) {
        Columns table = new Columns("what", "value");
        table.row("killed", plc + ", at " + seconds(killed) + " s in " + place);
        table.row("link", left);
        table.row("data stale after", after(stale) + " s, max_age is " + Durations.text(maxAgeNanos));
        table.row("rig stood still after", after(still) + " s: " + standing);
        table.row("bottles in the rig", bottlesBefore + " before, " + rig.bottles().size() + " at the end");
        table.row("fallen, collisions", rig.counters().fallen() + ", " + rig.counters().collisions());
        table.row("lasted", after(back) + " s");
        return table.text(indent);
    }

    private String after(long point) {
        return point == NEVER ? "never" : seconds(point - killed);
    }

    private static String seconds(long nanos) {
        return Durations.seconds(nanos).strip();
    }
}
