package tickbus.machines.peeler;

import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import tickbus.simulator.ModelFaults;

/** All axes of the line, and the variables by which their PLCs command and observe them. */
final class Axes {
    /** The names of an axis's outputs, after its name and a dot. */
    private static final List<String> SHOWN =
            List.of("Healthy", "InPosition", "ActualPosition", "ActualSpeed", "Status", "Error");

    /** The most that wear can take of a drive's speed and acceleration. */
    private static final double MOST_WEAR = 0.9;

    private final Axis[] axes = new Axis[AxisName.values().length];

    Axes() {
        for (AxisName name : AxisName.values()) {
            axes[name.ordinal()] = new Axis(name);
        }
    }

    /** The faults that the axes can have, by name. */
    void declare(ModelFaults list) {
        for (AxisName name : AxisName.values()) {
            Axis axis = get(name);
            list.add("failure of " + name.label(), "the axis is not healthy, and does not move", axis::fail);
            if (name.kind() == AxisKind.TORQUE) {
                list.add("leak of " + name.label(), 1, "", "this part of its pressure and of its speed is lost", axis::leak);
            } else if (name.kind() == AxisKind.POSITION) {
                list.add("wear of " + name.label(), MOST_WEAR, "",
                        "its next commands have this part less of their speed and acceleration", axis::wear);
            }
        }
    }

    Axis get(AxisName name) {
        return axes[name.ordinal()];
    }

    static List<String> inputs() {
        return variables(AxisCommand.NAMES);
    }

    static List<String> outputs() {
        return variables(SHOWN);
    }

    private static List<String> variables(List<String> parts) {
        List<String> names = new ArrayList<>();
        for (AxisName name : AxisName.values()) {
            Map<String, String> others = name.kind() == AxisKind.TORQUE ? AxisCommand.NAMES_OF_TORQUE : Map.of();
            for (String part : parts) {
                names.add(name.label() + "." + others.getOrDefault(part, part));
            }
        }
        return names;
    }

    /** Sets one of the {@link #inputs}. */
    void input(int index, double value) {
        int size = AxisCommand.NAMES.size();
        axes[index / size].command().write(index % size, value);
    }

    /** One of the {@link #outputs}. */
    double output(int index) {
        Axis axis = axes[index / SHOWN.size()];
        return switch (index % SHOWN.size()) {
            case 0 -> axis.healthy() ? 1 : 0;
            case 1 -> axis.inPosition() ? 1 : 0;
            case 2 -> axis.position();
            case 3 -> axis.velocity();
            case 4 -> axis.status();
            default -> axis.error();
        };
    }

    void step(long nanos) {
        for (Axis axis : axes) {
            axis.step(nanos);
        }
    }
}
