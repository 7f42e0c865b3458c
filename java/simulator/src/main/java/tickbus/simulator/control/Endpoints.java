package tickbus.simulator.control;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.Direction;
import controlinterface.HardwareComponent;
import java.util.ArrayList;
import java.util.Collections;
import java.util.HashSet;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Set;
import tickbus.simulator.expression.Type;

/**
 * Everything that a control table can name: {@code <driver id>:<component>}, {@code machine:<variable>} and, to read,
 * {@code model:<variable>}.
 *
 * <p>Sources are numbered driver by driver in component order, followed by the machine's outputs and the model's variables;
 * destinations likewise, followed by the machine's inputs.
 */
public final class Endpoints {
    /** The part before the colon in names of the machine's variables. */
    public static final String MACHINE = "machine";
    /** The part before the colon in names of the model's variables. */
    public static final String MODEL = "model";

    private final Map<String, Integer> sources = new LinkedHashMap<>();
    private final Map<String, Integer> destinations = new LinkedHashMap<>();
    /** Sources of drivers that are no signals, such as the age of data. */
    private final Set<Integer> beside = new HashSet<>();
    /** Only of the drivers' values. */
    private final List<Type> sourceTypes = new ArrayList<>();
    private final List<Type> destinationTypes = new ArrayList<>();
    private final int modelStart;
    private final List<Integer> sourceStarts = new ArrayList<>();
    private final List<Integer> destinationStarts = new ArrayList<>();

    /**
     * The endpoints of some drivers and a machine without further variables.
     *
     * @param drivers with different ids
     * @param machineInputs variables that the table can write
     * @param machineOutputs variables that the table can read
     * @throws IllegalArgumentException if two of them have the same name
     */
    public Endpoints(List<? extends ControlInterfaceDeviceDriver> drivers, List<String> machineInputs,
            List<String> machineOutputs) {
        this(drivers, machineInputs, machineOutputs, List.of());
    }

    /**
     * The endpoints of some drivers and a machine.
     *
     * @param drivers with different ids
     * @param machineInputs variables that the table can write
     * @param machineOutputs variables that the table can read
     * @param modelVariables further variables that the table can read
     * @throws IllegalArgumentException if two of them have the same name
     */
    public Endpoints(List<? extends ControlInterfaceDeviceDriver> drivers, List<String> machineInputs,
            List<String> machineOutputs, List<String> modelVariables) {
        for (ControlInterfaceDeviceDriver driver : drivers) {
            sourceStarts.add(sources.size());
            destinationStarts.add(destinations.size());
            for (HardwareComponent component : driver.components()) {
                boolean read = component.direction() == Direction.READ_BY_SIMULATION;
                add(read ? sources : destinations, driver.id() + ":" + component.name());
                if (read && !component.isSignal()) {
                    beside.add(sources.size() - 1);
                }
                // Other values have the type that the hardware sees; the driver scales them.
                (read ? sourceTypes : destinationTypes)
                        .add(component.type().equals("BOOL") ? Type.BOOL : Type.LREAL);
            }
        }
        sourceStarts.add(sources.size());
        destinationStarts.add(destinations.size());
        machineOutputs.forEach(name -> add(sources, MACHINE + ":" + name));
        machineInputs.forEach(name -> add(destinations, MACHINE + ":" + name));
        modelStart = sources.size();
        modelVariables.forEach(name -> add(sources, MODEL + ":" + name));
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

    /**
     * The number of the model's first variable.
     *
     * @return in {@link #sources}
     */
    public int modelStart() {
        return modelStart;
    }

    /** Returns whether a source is a signal or a machine's output, and nothing that only an observer reads. */
    boolean isSignal(int source) {
        return source < modelStart && !beside.contains(source);
    }

    /** BOOL or LREAL; null for the machine's, which can be either. */
    Type sourceType(int source) {
        return source < sourceTypes.size() ? sourceTypes.get(source) : null;
    }

    /** BOOL or LREAL; null for the machine's, which can be either. */
    Type destinationType(int destination) {
        return destination < destinationTypes.size() ? destinationTypes.get(destination) : null;
    }

    boolean isMachineInput(int destination) {
        return destination >= destinationStarts.get(destinationStarts.size() - 1);
    }
}
