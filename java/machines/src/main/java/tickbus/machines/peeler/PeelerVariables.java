package tickbus.machines.peeler;

import java.util.ArrayList;
import java.util.List;
import tickbus.simulator.ModelVariable;

/** The variables of the line's model, for observers: those of each axis, and those of the block in the lathe. */
final class PeelerVariables {
    private PeelerVariables() {
    }

    static List<ModelVariable> of(Peeler line) {
        List<ModelVariable> list = new ArrayList<>();
        for (AxisName name : AxisName.values()) {
            Axis axis = line.axes().get(name);
            list.add(new ModelVariable(name.label() + " position", unit(name), axis::position));
            list.add(new ModelVariable(name.label() + " speed", unit(name) + "/s", axis::velocity));
            list.add(new ModelVariable(name.label() + " pressure", "%", axis::pressure));
            list.add(new ModelVariable(name.label() + " commands", "", axis::commands));
        }
        list.add(new ModelVariable("eccentricity", "mm", line::eccentricity));
        list.add(new ModelVariable("block volume", "m3", line::held));
        list.add(new ModelVariable("surface speed", "m/s", line::surfaceSpeed));
        return List.copyOf(list);
    }

    /** The unit of an axis's position, as in its driver.cfg. */
    private static String unit(AxisName name) {
        return switch (name) {
            case PITCH_ANGLE -> "deg";
            case SPINDLE_ROTATION, ROLL_ROTATION -> "rev";
            default -> "mm";
        };
    }
}
