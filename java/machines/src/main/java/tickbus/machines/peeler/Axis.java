package tickbus.machines.peeler;

import tickbus.machines.motion.Drive;

/**
 * One axis: carries out the commands of its PLC, and gives feedback.
 *
 * <p>A command starts with the rising edge of Execute while Enable is on, with the bits and values at that time, and clears
 * InPosition. The next one can only start after Execute has fallen. Without Enable nothing moves, and the current command is
 * discarded.
 *
 * <ul>
 * <li><b>Position</b>, no other bit: to the target, in a trapezoid or triangle of speed. A target beyond an end position
 * leads to that position.
 *   <li><b>Speed</b>, SpeedControl: towards the target for as long as the bit is on; brakes when it falls, and before an
 *       end position. A new command meanwhile changes the speed without a stop.
 * <li><b>Torque</b>, for axes of that kind: Tracking closes, TorqueControl opens, with nominal speed, until an obstacle
 * stops the axis; neither bit means no power, and stops the axis.
 * <li><b>Tracking</b>: follows other axes as the machine requires, for as long as the bit is on.
 * </ul>
 */
final class Axis {
    private enum Mode { IDLE, POSITION, SPEED, STOPPING, TORQUE, TRACKING }

    /** The speed of axes that open and close, in millimetres per second. */
    private static final double CLAMP_SPEED = 400;

    private static final double GATE_SPEED = 200;

    /** Axes that open and close with at most this stroke, in millimetres, are gates. */
    private static final double LONGEST_GATE = 100;

    /** How close a tracking axis must be to its required position, in its unit, to be in position. */
    private static final double TOLERANCE = 0.05;

    private final AxisName name;
    private final AxisCommand command = new AxisCommand();
    private final Drive drive;
    private Mode mode = Mode.IDLE;
    private boolean executed;
    private boolean inPosition;
    private boolean healthy = true;
    private double leak;
    private double wear;
    private AxisError error = AxisError.NONE;
    private int commands;
    /** Values of the active command that are needed later. */
    private double offset;
    private double limit;
    private double torque;
    private double deceleration = 1;
    private int direction;
    /** The position of an obstacle below; the lower end if the way is clear. */
    private double obstacle;
    private boolean met;
    /** The speed of a motion that the drive does not make itself. */
    private double pushed;

    Axis(AxisName name) {
        this.name = name;
        this.drive = new Drive(name.home());
        this.obstacle = name.low();
    }

    AxisCommand command() {
        return command;
    }

    double position() {
        return drive.position();
    }

    /** Signed speed. */
    double velocity() {
        return mode == Mode.TORQUE || mode == Mode.TRACKING ? pushed : drive.velocity();
    }

    boolean inPosition() {
        return inPosition;
    }

    boolean healthy() {
        return healthy;
    }

    /** The status word: see {@link AxisStatus}. */
    int status() {
        return AxisStatus.READY.when(command.enable() && healthy) | AxisStatus.MOVING.when(velocity() != 0)
                | AxisStatus.IN_POSITION.when(inPosition) | AxisStatus.LOW_END.when(position() <= name.low())
                | AxisStatus.HIGH_END.when(position() >= name.high())
                | AxisStatus.JOGGING.when(mode == Mode.SPEED || mode == Mode.STOPPING)
                | AxisStatus.TRACKING.when(mode == Mode.TRACKING) | AxisStatus.PRESSURE.when(pressed())
                | AxisStatus.MET.when(met) | AxisStatus.REFUSED.when(error != AxisError.NONE);
    }

    private boolean pressed() {
        return mode == Mode.TORQUE && direction != 0 && pressing() > 0;
    }

    /** The error word: the error of the axis or of its last command. */
    int error() {
        return (healthy ? error : AxisError.FAILED).ordinal();
    }

    /** Sets an error of the axis, which its next command clears. */
    void blame(AxisError what) {
        error = what;
    }

    /** The number of commands started so far. */
    int commands() {
        return commands;
    }

    /** True if the axis presses against an obstacle. */
    boolean presses() {
        return met && (name.kind() != AxisKind.TORQUE || mode == Mode.TORQUE && direction < 0 && pressing() > 0);
    }

    /** The pressure in percent, while the axis presses. */
    double pressure() {
        return presses() ? pressing() : 0;
    }

    /** The torque of the last command that is left behind a leaking hose. */
    private double pressing() {
        return torque * (1 - leak);
    }

    boolean tracks() {
        return mode == Mode.TRACKING;
    }

    /** Offset of the tracking command. */
    double offset() {
        return offset;
    }

    /** Torque of the last command; of the knife, the thickness in millimetres. */
    double torque() {
        return torque;
    }

    boolean standsAt(double place) {
        return Math.abs(position() - place) <= 1;
    }

    /** Sets or clears a fault of the axis; with a fault it does not move. */
    void fail(boolean failed) {
        healthy = !failed;
    }

    /** A leaking hose takes this part of the pressure and of the speed of an axis that opens and closes; 0 for no leak. */
    void leak(double part) {
        leak = part;
    }

    /** A worn drive has this part less of the speed and the acceleration of its next command; 0 is a new one. */
    void wear(double part) {
        wear = part;
    }

    /** Sets the position below which the axis cannot go, until the next call; the lower end for none. */
    void meets(double place) {
        obstacle = Math.max(place, name.low());
        if (position() > obstacle + TOLERANCE) {
            met = false;
        }
    }

    void step(long nanos) {
        boolean edge = command.execute() && !executed;
        executed = command.execute();
        if (!command.enable() || !healthy) {
            error = edge ? AxisError.NOT_ENABLED : error;
            stop();
            return;
        }
        if (edge) {
            begin();
        } else {
            holdOn();
        }
        if (mode == Mode.TORQUE) {
            push(nanos);
        } else if (mode != Mode.TRACKING) {
            move(nanos, edge);
        }
    }

    private void stop() {
        if (mode == Mode.POSITION && drive.moving()) {
            inPosition = false;
        }
        drive.halt();
        pushed = 0;
        mode = Mode.IDLE;
    }

    private void begin() {
        commands++;
        inPosition = false;
        drive.jerk(command.jerk());
        error = AxisError.NONE;
        if (name.kind() == AxisKind.TORQUE) {
            torque = command.torque();
            direction = command.tracking() == command.torqueControl() ? 0 : command.tracking() ? -1 : 1;
            mode = Mode.TORQUE;
        } else if (command.speedControl()) {
            turn();
        } else if (command.tracking() || command.torqueControl()) {
            track();
        } else if (!command.movable()) {
            refuse(AxisError.NO_SPEED);
        } else {
            double target = Math.max(name.low(), Math.min(name.high(), command.target()));
            error = target == command.target() ? AxisError.NONE : AxisError.BEYOND_END;
            drive.moveTo(target, command.speed() * (1 - wear), command.acceleration() * (1 - wear),
                    command.deceleration());
            mode = Mode.POSITION;
        }
    }

    private void turn() {
        if (!command.movable()) {
            refuse(AxisError.NO_SPEED);
            return;
        }
        deceleration = command.deceleration();
        boolean up = command.target() >= position();
        double end = up ? name.high() : name.low();
        if (Double.isInfinite(end)) {
            drive.runAt(up ? command.speed() : -command.speed(), command.acceleration(), deceleration);
        } else {
            drive.moveTo(end, command.speed(), command.acceleration(), deceleration);
        }
        mode = Mode.SPEED;
    }

    private void track() {
        if (name.kind() != AxisKind.TRACKING || command.torqueControl()) {
            refuse(AxisError.NO_SUCH_COMMAND);
            return;
        }
        drive.halt();
        offset = command.target();
        limit = command.speed();
        torque = command.torque();
        mode = Mode.TRACKING;
    }

    private void refuse(AxisError why) {
        error = why;
        stop();
    }

    /** Continues commands that last as long as their bit is on. */
    private void holdOn() {
        if (mode == Mode.SPEED && !command.speedControl()) {
            drive.runAt(0, deceleration, deceleration);
            mode = Mode.STOPPING;
        } else if (mode == Mode.TRACKING && !command.tracking()) {
            stop();
        } else if (mode == Mode.TORQUE && !command.tracking() && !command.torqueControl()) {
            direction = 0;
        }
    }

    /** InPosition is off for at least one step, even if the axis is at its target already. */
    private void move(long nanos, boolean begun) {
        drive.advance(nanos);
        if (drive.position() <= obstacle && drive.velocity() <= 0 && obstacle > name.low()) {
            drive.haltAt(obstacle);
            met = true;
        }
        if (mode != Mode.IDLE && !drive.moving() && !begun) {
            inPosition = true;
            mode = Mode.IDLE;
        }
    }

    private void push(long nanos) {
        double speed = (name.high() > LONGEST_GATE ? CLAMP_SPEED : GATE_SPEED) * (1 - leak);
        double before = position();
        double way = pressing() > 0 ? direction * speed * nanos * 1e-9 : 0;
        double place = Math.max(obstacle, Math.min(name.high(), before + way));
        if (way == 0) {
            place = before;
        }
        drive.haltAt(place);
        pushed = place == before ? 0 : direction * speed;
        met = place == obstacle && obstacle > name.low();
    }

    /** Moves a tracking axis to its required position, at most at the speed of its command; 0 is no limit. */
    void trackTo(double place, long nanos) {
        double seconds = nanos * 1e-9;
        double before = position();
        double target = Math.max(name.low(), Math.min(name.high(), place));
        double most = limit > 0 ? limit * seconds : Double.POSITIVE_INFINITY;
        double way = Math.max(-most, Math.min(most, target - before));
        drive.haltAt(before + way);
        pushed = seconds > 0 ? way / seconds : 0;
        inPosition = Math.abs(position() - target) <= TOLERANCE;
    }

    /** Turns a tracking axis at a speed for a time. */
    void trackAt(double velocity, long nanos) {
        drive.haltAt(position() + velocity * nanos * 1e-9);
        pushed = velocity;
        inPosition = true;
    }
}
