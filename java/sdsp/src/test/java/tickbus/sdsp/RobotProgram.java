package tickbus.sdsp;

import java.util.List;

/** The PLC program of examples/robot. */
final class RobotProgram implements Participant {
    private final RobotPath path = new RobotPath();

    @Override
    public Declaration declare() {
        return new Declaration("plc", 10,
            List.of(new Variable("speed_x", DataType.LREAL), new Variable("speed_z", DataType.LREAL)),
            List.of("position_x", "position_z"));
    }

    @Override
    public void initial(long[] writes) {
        // At rest: the slots are 0.
    }

    @Override
    public void run(long sequence, long nanos, long[] reads, long[] writes) {
        for (int axis = 0; axis < 2; axis++) {
            double speed = 20.0 * (path.at(nanos, axis) - Double.longBitsToDouble(reads[axis]));
            writes[axis] = Double.doubleToRawLongBits(Math.min(Math.max(speed, -600.0), 600.0));
        }
    }
}
