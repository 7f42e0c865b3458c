package tickbus.simulator.control;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.Direction;
import controlinterface.HardwareComponent;
import java.util.ArrayList;
import java.util.Collections;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;

/**
 * Everything that a control table can name: {@code <driver id>:<component>} and {@code machine:<variable>}.
 *
 * <p>Sources are numbered driver by driver in component order, followed by the machine's outputs; destinations
 * likewise, followed by the machine's inputs.
 */
public final class Endpoints {
    /** The part before the colon in names of the machine's variables. */
    public static final String MACHINE = "machine";

    private final Map<String, Integer> sources = new LinkedHashMap<>();
    private final Map<String, Integer> destinations = new LinkedHashMap<>();
    private final List<Integer> sourceStarts = new ArrayList<>();
    private final List<Integer> destinationStarts = new ArrayList<>();

    /**
     * The endpoints of some drivers and a machine.
     *
     * @param drivers with different ids
     * @param machineInputs variables that the table can write
     * @param machineOutputs variables that the table can read
     * @throws IllegalArgumentException if two of them have the same name
     */
    public Endpoints(List<? extends ControlInterfaceDeviceDriver> drivers, List<String> machineInputs,
            List<String> machineOutputs) {
        for (ControlInterfaceDeviceDriver driver : drivers) {
            sourceStarts.add(sources.size());
            destinationStarts.add(destinations.size());
            for (HardwareComponent component : driver.components()) {
                boolean read = component.direction() == Direction.READ_BY_SIMULATION;
                add(read ? sources : destinations, driver.id() + ":" + component.name());
            }
        }
        sourceStarts.add(sources.size());
        destinationStarts.add(destinations.size());
        machineOutputs.forEach(name -> add(sources, MACHINE + ":" + name));
        machineInputs.forEach(name -> add(destinations, MACHINE + ":" + name));
    }

    private static void add(Map<String, Integer> points, String name) {
        if (points.put(name, points.size()) != null) {
            throw new IllegalArgumentException("there are two \"" + name + "\"; names must be unique");
        }
    }

    /**
     * Names and numbers of the sources.
     *
     * @return in numerical order
     */
    public Map<String, Integer> sources() {
        return Collections.unmodifiableMap(sources);
    }

    /**
     * Names and numbers of the destinations.
     *
     * @return in numerical order
     */
    public Map<String, Integer> destinations() {
        return Collections.unmodifiableMap(destinations);
    }

    /**
     * The number of a driver's first source.
     *
     * @param driver position among the drivers; their count means the machine
     * @return in {@link #sources}
     */
    public int sourceStart(int driver) {
        return sourceStarts.get(driver);
    }

    /**
     * The number of a driver's first destination.
     *
     * @param driver position among the drivers; their count means the machine
     * @return in {@link #destinations}
     */
    public int destinationStart(int driver) {
        return destinationStarts.get(driver);
    }

    boolean isMachineInput(int destination) {
        return destination >= destinationStarts.get(destinationStarts.size() - 1);
    }
}
