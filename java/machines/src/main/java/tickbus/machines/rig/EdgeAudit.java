package tickbus.machines.rig;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.Direction;
import controlinterface.HardwareComponent;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import java.util.function.DoubleSupplier;
import java.util.stream.Collectors;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.demo.Plc;
import tickbus.simulator.Simulator;

/**
 * Counts the rising edges of every Boolean signal at the simulation's end of the link, and compares them exactly with the
 * counts of the PLC's end, for each life of the PLC.
 *
 * <p><b>While the PLC is there.</b> The simulation makes the edges of signals to the PLC: they are counted in the values
 * passed to the driver. The driver reports the edges of signals from the PLC in the component {@code <name>.edges}, which
 * includes edges between two ticks.
 *
 * <p><b>When the PLC comes.</b> A life begins with the first tick whose data are not stale. The PLC's image starts with all
 * bits off, so a signal that is on counts once at the PLC, whatever happened before. This end counts that tick as follows:
 * <ul>
 *   <li>a signal to the PLC counts once if it is on, or if it rose while there was no PLC, because the driver
 *       keeps a latched pulse for the next exchange, and however many such pulses merge into one;
 *   <li>a signal from the PLC counts the edges that the driver reports; if it reports none, because the signal was
 *       on when the driver saw it last, or by its fail-safe value, it counts once if it is on.
 * </ul>
 *
 * <p><b>When the PLC goes.</b> A killed PLC cannot report any more, so it must be killed while its last reported counts are
 * {@linkplain #disagreement the same as here}. After that the other end does not count any more. If an edge from the PLC
 * still arrives, it was made after the last report: the audit fails, because it cannot be exact. It also fails if a signal
 * to the PLC rises twice while the link comes up, because the pulses may have merged.
 */
final class EdgeAudit {
    private static final int STALE = 2;

    /** A pulse less than this before the link came up may or may not have merged with an earlier one. */
    private static final long COMING_UP_NANOS = 100_000_000L;

    /** A signal with its counts at both ends. */
    record Line(String signal, boolean toPlc, long here, long there) {
        long missed() {
            return Math.abs(here - there);
        }

        private String text() {
            return "\"" + signal + "\": " + here + " here, " + there + " at the PLC";
        }
    }

    /** One life of the PLC. */
    record Life(int number, String end, List<Line> lines) {
    }

    private enum State {
        /** No PLC has been there yet, or its data are stale. */
        AWAY,
        PRESENT,
        /** The PLC is dead, but its last data are not stale yet. */
        CUT
    }

    private static final class Counter {
        final String signal;
        final boolean toPlc;
        final DoubleSupplier value;
        final DoubleSupplier edges;
        private boolean high;
        private long count;
        /** Rises of a signal to the PLC while the PLC is down, and when the last one was. */
        private int pending;
        private long pendingAt;

        Counter(String signal, DoubleSupplier value, DoubleSupplier edges) {
            this.signal = signal;
            this.toPlc = edges == null;
            this.value = value;
            this.edges = edges;
        }

        /** The edges of one tick. */
        long rises() {
            boolean before = high;
            high = value.getAsDouble() != 0;
            return toPlc ? high && !before ? 1 : 0 : (long) edges.getAsDouble();
        }

        void pend(long now) {
            pending++;
            pendingAt = now;
        }

        /** The first tick of a life. */
        void begin(long rises, long now) {
            if (toPlc && pending > 1 && now - pendingAt < COMING_UP_NANOS) {
                throw new DemoFailure("\"" + signal + "\" rose " + pending + " times while there was no PLC, the last"
                        + " time just as the link came up, so its edges cannot be compared");
            }
            boolean once = high || toPlc && pending > 0;
            count = rises > 0 && !toPlc ? rises : once ? 1 : 0;
            pending = 0;
        }
    }

    private final Simulator simulator;
    private final DoubleSupplier status;
    private final List<Counter> counters = new ArrayList<>();
    private final List<Life> lives = new ArrayList<>();
    private State state = State.AWAY;
    private long quietTicks;
    private long lastEdgeNanoTime;

    EdgeAudit(Simulator simulator, ControlInterfaceDeviceDriver driver) {
        this.simulator = simulator;
        status = simulator.probe(driver.id() + ":bus.status");
        List<HardwareComponent> components = driver.components();
        var names = components.stream().map(HardwareComponent::name).collect(Collectors.toSet());
        for (HardwareComponent component : components) {
            if (!component.type().equals("BOOL")) {
                continue;
            }
            boolean toPlc = component.direction() == Direction.WRITTEN_BY_SIMULATION;
            String edges = component.name() + ".edges";
            if (!toPlc && !names.contains(edges)) {
                throw new DemoFailure("\"" + component.name() + "\" has no latch in the driver's .cfg, so its edges"
                        + " are not counted; give it latch = \"rising\"");
            }
            String prefix = driver.id() + ":";
            counters.add(new Counter(component.name(), simulator.probe(prefix + component.name()),
                    toPlc ? null : simulator.probe(prefix + edges)));
        }
    }

    /** Counts one tick. */
    void look() {
        boolean stale = (int) status.getAsDouble() == STALE;
        boolean begins = state == State.AWAY && !stale;
        if (state == State.CUT && stale) {
            state = State.AWAY;
        } else if (begins) {
            state = State.PRESENT;
        }
        boolean edge = begins;
        for (Counter counter : counters) {
            long rises = counter.rises();
            edge |= rises != 0;
            if (begins) {
                counter.begin(rises, simulator.simulationNanos());
            } else if (state == State.PRESENT) {
                counter.count += rises;
            } else if (counter.toPlc && rises != 0) {
                counter.pend(simulator.simulationNanos());
            } else if (rises != 0) {
                throw new DemoFailure("an edge of \"" + counter.signal + "\" came from the PLC after the last counts"
                        + " that it gave before it was killed, so its edges cannot be compared");
            }
        }
        quietTicks = edge ? 0 : quietTicks + 1;
        if (edge) {
            lastEdgeNanoTime = System.nanoTime();
        }
    }

    /** Ticks since the last edge at this end. */
    long quietTicks() {
        return quietTicks;
    }

    /** True if these counts were reported after the last edge at this end. */
    boolean isNewer(Plc.Counts counts) {
        return counts.scans() >= 0 && counts.nanoTime() - lastEdgeNanoTime > 0;
    }

    /**
     * How the PLC's counts differ from this end's.
     *
     * @return null if they agree
     * @throws DemoFailure if the PLC has no count for a signal
     */
    String disagreement(Plc.Counts counts) {
        String differing = compare(counts).stream().filter(line -> line.missed() != 0).map(Line::text)
                .collect(Collectors.joining("; "));
        return differing.isEmpty() ? null : differing;
    }

    /** The PLC was killed: its life ends with its last reported counts. */
    void cut(Plc.Counts last) {
        close("killed", last);
        state = State.CUT;
    }

    /** The demo has ended, and with it the PLC's last life. */
    void end(Plc.Counts last) {
        close("end of the demo", last);
    }

    private void close(String end, Plc.Counts last) {
        lives.add(new Life(lives.size() + 1, end, compare(last)));
    }

    private List<Line> compare(Plc.Counts counts) {
        Map<String, Long> rises = counts.rises();
        if (rises.isEmpty()) {
            throw new DemoFailure("the PLC end gives no edge counts to compare with");
        }
        List<Line> lines = new ArrayList<>();
        for (Counter counter : counters) {
            Long there = rises.get(counter.signal);
            if (there == null) {
                throw new DemoFailure("the PLC end gives no edge count for \"" + counter.signal + "\"");
            }
            lines.add(new Line(counter.signal, counter.toPlc, counter.count, there));
        }
        return lines;
    }

    /** The lives that have ended. */
    List<Life> lives() {
        return List.copyOf(lives);
    }

    /** Sum of the differences over all lives, all signals and both directions. */
    long missed() {
        return lives.stream().flatMap(life -> life.lines().stream()).mapToLong(Line::missed).sum();
    }
}
