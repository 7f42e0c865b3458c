package controlinterface;

/** Gives the machine model a fault, and takes it back; implemented by the simulator. */
@FunctionalInterface
public interface MachineFaultListener {
    /**
     * A fault of the machine begins, changes its value, or ends.
     *
     * @param name one of the names that were passed to {@link ControlInterfaceDeviceDriver#connectFaults}
     * @param value the fault's value; 0 when it has ended
     */
    void machineFault(String name, double value);
}
