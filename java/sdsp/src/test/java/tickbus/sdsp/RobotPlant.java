package tickbus.sdsp;

import java.nio.ByteBuffer;
import java.util.List;

/** The plant of examples/robot. */
class RobotPlant implements Participant {
    private static final double CATCH_UP = 0.048770575499285984;

    private final double[] position = new double[2];
    private final double[] speed = new double[2];
    /** The number of steps that ran. */
    int steps;

    @Override
    public Declaration declare() {
        return new Declaration("plant", 1,
            List.of(new Variable("position_x", DataType.LREAL), new Variable("position_z", DataType.LREAL)),
            List.of("speed_x", "speed_z"));
    }

    @Override
    public void initial(long[] writes) {
        write(writes);
    }

    @Override
    public void run(long sequence, long nanos, long[] reads, long[] writes) {
        steps++;
        for (int axis = 0; axis < 2; axis++) {
            speed[axis] += (Double.longBitsToDouble(reads[axis]) - speed[axis]) * CATCH_UP;
            position[axis] += speed[axis] * 1e-3;
        }
        write(writes);
    }

    @Override
    public byte[] save() {
        return ByteBuffer.allocate(4 * Double.BYTES).putDouble(position[0]).putDouble(position[1]).putDouble(speed[0])
            .putDouble(speed[1]).array();
    }

    @Override
    public void restore(byte[] state) {
        ByteBuffer in = ByteBuffer.wrap(state);
        for (double[] pair : new double[][] {position, speed}) {
            pair[0] = in.getDouble();
            pair[1] = in.getDouble();
        }
    }

    private void write(long[] writes) {
        writes[0] = Double.doubleToRawLongBits(position[0]);
        writes[1] = Double.doubleToRawLongBits(position[1]);
    }
}
