package tickbus.simulator.demo;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.Direction;
import controlinterface.HardwareComponent;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import java.util.function.DoubleSupplier;
import java.util.stream.Collectors;
import tickbus.simulator.Simulator;

/**
 * Counts the rising edges of every Boolean signal at the simulation's end of the link, and compares them
 * with what the other end counted.
 *
 * <p>Of a signal to the PLC the simulation makes edges: they are counted in the values that were handed to
 * the driver. Of a signal from the PLC the simulation sees edges: the driver reports them by the component
 * {@code <name>.edges}, which also has those that fell between two ticks.
 */
final class EdgeAudit {
    /** A signal with its counts at both ends. */
    record Line(String signal, boolean toPlc, long here, long there) {
        long missed() {
            return Math.abs(here - there);
        }
    }

    private static final class Counter {
        final String signal;
        final boolean toPlc;
        final DoubleSupplier value;
        private boolean high;
        private long count;

        Counter(String signal, boolean toPlc, DoubleSupplier value) {
            this.signal = signal;
            this.toPlc = toPlc;
            this.value = value;
        }

        /** Takes one tick; true if there was an edge. */
        boolean look() {
            long before = count;
            double now = value.getAsDouble();
            if (toPlc) {
                count += now != 0 && !high ? 1 : 0;
                high = now != 0;
            } else {
                count += (long) now;
            }
            return count != before;
        }
    }

    private final List<Counter> counters = new ArrayList<>();
    private long quietTicks;

    EdgeAudit(Simulator simulator, ControlInterfaceDeviceDriver driver) {
        List<HardwareComponent> components = driver.components();
        var names = components.stream().map(HardwareComponent::name).collect(Collectors.toSet());
        for (HardwareComponent component : components) {
            if (!component.type().equals("BOOL")) {
                continue;
            }
            boolean toPlc = component.direction() == Direction.WRITTEN_BY_SIMULATION;
            String name = component.name() + (toPlc ? "" : ".edges");
            if (!names.contains(name)) {
                throw new DemoFailure("\"" + component.name() + "\" has no latch in the driver's .cfg, so its edges"
                        + " are not counted; give it latch = \"rising\"");
            }
            counters.add(new Counter(component.name(), toPlc, simulator.probe(driver.id() + ":" + name)));
        }
    }

    /** Counts one tick. */
    void look() {
        boolean edge = false;
        for (Counter counter : counters) {
            edge |= counter.look();
        }
        quietTicks = edge ? 0 : quietTicks + 1;
    }

    /** Ticks since the last edge at this end. */
    long quietTicks() {
        return quietTicks;
    }

    /** Compares; fails if the other end has no count for a signal. */
    List<Line> compare(PeerCounts peer) {
        Map<String, Long> rises = peer.rises();
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

    /** Sum of the differences over all signals and both directions. */
    static long missed(List<Line> lines) {
        return lines.stream().mapToLong(Line::missed).sum();
    }
}
