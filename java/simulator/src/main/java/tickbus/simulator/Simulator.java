package tickbus.simulator;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.Direction;
import java.nio.file.Path;
import java.util.List;
import java.util.function.BooleanSupplier;
import java.util.function.DoubleSupplier;
import java.util.stream.IntStream;
import tickbus.simulator.control.ControlTable;
import tickbus.simulator.control.ControlTableException;
import tickbus.simulator.control.Endpoints;
import tickbus.simulator.text.Durations;

/**
 * Ticks a machine and its drivers.
 *
 * <p>One tick: each driver delivers the current hardware values, which go through the control table to the machine;
 * the machine takes one step; its outputs go through the control table to the drivers, which send them. So the
 * machine answers the hardware within the tick. The values of a driver that delivers only after sending, like those
 * of 2003, reach the machine one tick later. A tick allocates nothing.
 *
 * <p>One thread ticks and closes; any thread can call {@link #stop}.
 */
public final class Simulator implements AutoCloseable {
    /** One driver's part of the tick. */
    private static final class Seat {
        final ControlInterfaceDeviceDriver driver;
        final int firstDestination;
        final double[] written;

        Seat(ControlInterfaceDeviceDriver driver, int firstDestination, int written) {
            this.driver = driver;
            this.firstDestination = firstDestination;
            this.written = new double[written];
        }
    }

    /** A variable of the model that the control table reads. */
    private record Observed(int source, DoubleSupplier value) {
    }

    private final DriverSet drivers;
    private final Machine machine;
    private final ControlTable table;
    private final long stepNanos;
    private final Seat[] seats;
    private final Observed[] observed;
    private final int machineInputs;
    private final int machineOutputs;
    private final int firstMachineInput;
    private final int firstMachineOutput;
    private final Pacer pacer;
    private long ticks;
    private volatile boolean stopped;

    /**
     * Connects drivers and machine. The simulator owns the drivers from now on, and closes them if this constructor fails.
     *
     * @param drivers open drivers
     * @param machine the machine
     * @param controlTable file that connects them
     * @param stepNanos step size in nanoseconds, above 0
     * @param time the clock for real-time mode
     * @throws ControlTableException if the control table has mistakes
     * @throws WrongInput if two names are equal, or a driver is to inject a fault that the machine does not have
     * @throws IllegalArgumentException if the step size is not above 0
     */
    public Simulator(DriverSet drivers, Machine machine, Path controlTable, long stepNanos, TimeSource time) {
        this.drivers = drivers;
        this.machine = machine;
        this.stepNanos = stepNanos;
        pacer = new Pacer(time, stepNanos);
        List<ControlInterfaceDeviceDriver> list = drivers.drivers();
        try {
            if (stepNanos <= 0) {
                throw new IllegalArgumentException(
                        "the step size is " + Durations.text(stepNanos) + "; it must be above 0");
            }
            Endpoints endpoints = endpoints(list, machine);
            table = ControlTable.load(controlTable, endpoints, stepNanos);
            machineInputs = machine.inputs().size();
            machineOutputs = machine.outputs().size();
            firstMachineInput = endpoints.destinationStart(list.size());
            firstMachineOutput = endpoints.sourceStart(list.size());
            int modelStart = endpoints.modelStart();
            List<ModelVariable> model = machine.variables();
            observed = IntStream.range(0, model.size()).filter(i -> table.reads(modelStart + i))
                    .mapToObj(i -> new Observed(modelStart + i, model.get(i).value())).toArray(Observed[]::new);
            seats = new Seat[list.size()];
            for (int i = 0; i < seats.length; i++) {
                seats[i] = seat(list.get(i), endpoints.sourceStart(i), endpoints.destinationStart(i));
            }
        } catch (RuntimeException e) {
            try {
                drivers.close();
            } catch (DriverFailure second) {
                e.addSuppressed(second);
            }
            throw e;
        }
    }

    /** The names that a control table of the machine can use. */
    static Endpoints endpoints(List<ControlInterfaceDeviceDriver> drivers, Machine machine) {
        try {
            return new Endpoints(drivers, machine.inputs(), machine.outputs(),
                    machine.variables().stream().map(ModelVariable::name).toList());
        } catch (IllegalArgumentException e) {
            throw new WrongInput("drivers and machine " + machine.name() + ": " + e.getMessage(), e);
        }
    }

    private Seat seat(ControlInterfaceDeviceDriver driver, int firstSource, int firstDestination) {
        int written = 0;
        for (var component : driver.components()) {
            written += component.direction() == Direction.WRITTEN_BY_SIMULATION ? 1 : 0;
        }
        int read = driver.components().size() - written;
        connectFaults(driver);
        driver.connect(inputs -> {
            if (inputs.length != read) {
                throw new IllegalStateException("driver " + driver.id() + " delivered " + inputs.length
                        + " values; it has " + read + " components that the simulation reads");
            }
            table.setSources(firstSource, inputs);
        });
        return new Seat(driver, firstDestination, written);
    }

    /** Passes the machine's faults to a driver, whose configuration may name one that the machine does not have. */
    private void connectFaults(ControlInterfaceDeviceDriver driver) {
        List<String> names = machine.modelFaults().stream().map(ModelFault::name).toList();
        if (names.isEmpty()) {
            return;
        }
        try {
            driver.connectFaults(names, machine::fault);
        } catch (RuntimeException e) {
            throw new WrongInput("driver " + driver.id() + ", machine " + machine.name() + ": " + e.getMessage(), e);
        }
    }

    /**
     * One tick.
     *
     * @throws DriverFailure if a driver failed; the simulation cannot continue
     */
    public void tick() {
        for (Seat seat : seats) {
            try {
                seat.driver.simulationTime(ticks * stepNanos);
                seat.driver.updateHardwareInputs();
            } catch (RuntimeException | LinkageError e) {
                throw failure(seat, e);
            }
        }
        table.computeBeforeStep();
        for (int i = 0; i < machineInputs; i++) {
            machine.input(i, table.destination(firstMachineInput + i));
        }
        machine.step(stepNanos);
        ticks++;
        for (int i = 0; i < machineOutputs; i++) {
            table.setSource(firstMachineOutput + i, machine.output(i));
        }
        for (Observed variable : observed) {
            table.setSource(variable.source, variable.value.getAsDouble());
        }
        table.computeAfterStep();
        for (Seat seat : seats) {
            table.getDestinations(seat.firstDestination, seat.written);
            try {
                seat.driver.simulationTime(ticks * stepNanos);
                seat.driver.updateComponentValues(seat.written);
            } catch (RuntimeException | LinkageError e) {
                throw failure(seat, e);
            }
        }
    }

    private DriverFailure failure(Seat seat, Throwable cause) {
        return new DriverFailure("driver " + seat.driver.id() + " failed in tick " + ticks, cause);
    }

    /**
     * Ticks until {@code more} returns false, {@link #stop} is called, or the thread is interrupted.
     *
     * @param mode how ticks follow one another
     * @param more asked before every tick
     * @throws DriverFailure if a driver failed
     */
    public void run(TickMode mode, BooleanSupplier more) {
        pacer.restart();
        while (!stopped && !Thread.currentThread().isInterrupted() && more.getAsBoolean()) {
            if (mode == TickMode.REAL_TIME) {
                pacer.awaitTick();
            }
            tick();
        }
    }

    /** Makes {@link #run} return after the current tick; from any thread. */
    public void stop() {
        stopped = true;
    }

    /**
     * Returns whether {@link #stop} was called.
     *
     * @return true from then on
     */
    public boolean stopped() {
        return stopped;
    }

    /**
     * A window on a value.
     *
     * @param name {@code <driver id>:<component>}, {@code machine:<variable>}, {@code model:<variable>} or a variable of the
     * table
     * @return gives the value as of the last tick
     * @throws IllegalArgumentException if nothing has this name
     */
    public DoubleSupplier probe(String name) {
        // The table has only those that a row reads.
        for (ModelVariable variable : machine.variables()) {
            if (name.equals(Endpoints.MODEL + ":" + variable.name())) {
                return variable.value();
            }
        }
        return table.probe(name);
    }

    /**
     * Destinations that the control table leaves out.
     *
     * @return their names; they stay 0
     */
    public List<String> unconnected() {
        return table.unconnected();
    }

    /**
     * Sources that the control table leaves out.
     *
     * @return the names of signals and machine variables that no row reads
     */
    public List<String> unread() {
        return table.unread();
    }

    /**
     * The drivers.
     *
     * @return in the order of their files' names
     */
    public List<ControlInterfaceDeviceDriver> drivers() {
        return drivers.drivers();
    }

    /**
     * The machine.
     *
     * @return as passed to the constructor
     */
    public Machine machine() {
        return machine;
    }

    /**
     * Ticks so far.
     *
     * @return 0 or more
     */
    public long ticks() {
        return ticks;
    }

    /**
     * Time in the simulation.
     *
     * @return nanoseconds at the end of the last tick: ticks times step size
     */
    public long simulationNanos() {
        return ticks * stepNanos;
    }

    /**
     * The step size.
     *
     * @return nanoseconds
     */
    public long stepNanos() {
        return stepNanos;
    }

    /**
     * Ticks that started, in real-time mode, a step or more after their time.
     *
     * @return 0 or more
     */
    public long lateTicks() {
        return pacer.lateTicks();
    }

    /**
     * Ticks that real-time mode dropped because their time had passed in a stall.
     *
     * @return 0 or more
     */
    public long droppedTicks() {
        return pacer.droppedTicks();
    }

    /**
     * Closes every driver. Further calls do nothing.
     *
     * @throws DriverFailure if a driver failed to close; the others are closed anyway
     */
    @Override
    public void close() {
        drivers.close();
    }
}
