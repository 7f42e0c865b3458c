package tickbus.machines.rig;

import java.util.ArrayList;
import java.util.List;
import java.util.function.BooleanSupplier;
import java.util.function.LongSupplier;
import tickbus.simulator.ModelVariable;

/** The variables of the rig's model, for observers: places and speeds of its parts, and counts. */
final class RigVariables {
    private final List<ModelVariable> list = new ArrayList<>();

    private RigVariables() {
    }

    static List<ModelVariable> of(Cell cell, StepMonitor monitor) {
        RigVariables made = new RigVariables();
        made.wheel("index wheel 1", cell.wheel(1));
        made.wheel("chamber wheel", cell.wheel(2));
        made.lift(cell.path(Lift.LA1));
        made.lift(cell.path(Lift.LA2));
        made.count("cycles", monitor::cycles);
        made.count("bottles fed", cell.conveyor()::fed);
        made.count("bottles treated", cell::treated);
        made.count("bottles delivered", cell.conveyor()::delivered);
        made.count("bottles removed", cell::removed);
        made.count("bottles fallen", cell::fallen);
        made.count("collisions", cell.faults()::collisions);
        made.count("faults", cell.faults()::risen);
        made.count("lamp errors", monitor::lampErrors);
        return List.copyOf(made.list);
    }

    private void wheel(String name, Wheel wheel) {
        list.add(new ModelVariable(name + " angle", "deg", wheel::angle));
        list.add(new ModelVariable(name + " speed", "deg/s", wheel::velocity));
        count(name + " retriggers", wheel::retriggers);
    }

    private void lift(LiftPath path) {
        LiftDrive drive = path.drive();
        list.add(new ModelVariable(drive.name() + " position", "mm", drive::position));
        list.add(new ModelVariable(drive.name() + " motor position", "mm", drive::measured));
        list.add(new ModelVariable(drive.name() + " motor speed", "mm/s", drive::velocity));
        list.add(new ModelVariable(drive.name() + " cup height", "mm", path::cupHeight));
        is(drive.name() + " vacuum", path.cup()::vacuum);
        is(drive.name() + " referenced", drive::referenced);
        count(drive.name() + " jams", path::jams);
    }

    private void is(String name, BooleanSupplier value) {
        list.add(new ModelVariable(name, "", () -> value.getAsBoolean() ? 1 : 0));
    }

    private void count(String name, LongSupplier value) {
        list.add(new ModelVariable(name, "", value::getAsLong));
    }
}
