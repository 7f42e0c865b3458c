package tickbus.sdsp;

/** The commanded path of the robot in examples/robot, computed in the same order to the last bit. */
final class RobotPath {
    private static final double[][] CORNERS = {{0, 0}, {0, 200}, {150, 300}, {350, 300}, {500, 200}, {500, 0}};
    private static final double SPEED = 300;
    private static final double ACCELERATION = 1500;
    private static final double RAMP = SPEED / ACCELERATION;

    private final double[] begin = new double[CORNERS.length - 1];
    private final double[] length = new double[CORNERS.length - 1];

    RobotPath() {
        double time = 0;
        for (int leg = 0; leg < length.length; leg++) {
            double dx = CORNERS[leg + 1][0] - CORNERS[leg][0];
            double dz = CORNERS[leg + 1][1] - CORNERS[leg][1];
            begin[leg] = time;
            length[leg] = Math.sqrt(dx * dx + dz * dz);
            time += duration(leg);
        }
    }

    private double duration(int leg) {
        return 2.0 * RAMP + (length[leg] - SPEED * RAMP) / SPEED;
    }

    private double travelled(int leg, double time) {
        double duration = duration(leg);
        if (time <= 0.0) {
            return 0.0;
        } else if (time < RAMP) {
            return ACCELERATION * time * time / 2.0;
        } else if (time <= duration - RAMP) {
            return SPEED * RAMP / 2.0 + SPEED * (time - RAMP);
        } else if (time < duration) {
            double left = duration - time;
            return length[leg] - ACCELERATION * left * left / 2.0;
        }
        return length[leg];
    }

    /** The commanded position of an axis, 0 for x and 1 for z, in mm. */
    double at(long nanos, int axis) {
        double time = nanos / 1e9;
        int leg = length.length - 1;
        while (leg > 0 && time < begin[leg]) {
            leg--;
        }
        double share = travelled(leg, time - begin[leg]) / length[leg];
        return CORNERS[leg][axis] + share * (CORNERS[leg + 1][axis] - CORNERS[leg][axis]);
    }
}
