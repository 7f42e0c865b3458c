package tickbus.machines.peeler;

import java.util.ArrayList;
import java.util.List;
import java.util.Map;

/** All axes of the line, and the variables by which their PLCs command and observe them. */
final class Axes {
    /** The names of an axis's outputs, after its name and a dot. */
    private static final List<String> SHOWN =
            List.of("Healthy", "InPosition", "ActualPosition", "ActualSpeed", "Status", "Error");

    private final Axis[] axes = new Axis[AxisName.values().length];

    Axes() {
        for (AxisName name : AxisName.values()) {
            axes[name.ordinal()] = new Axis(name);
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
