package tickbus.simulator.demo;

import java.util.ArrayDeque;
import java.util.Deque;
import java.util.Locale;
import java.util.function.BooleanSupplier;
import tickbus.simulator.Simulator;
import tickbus.simulator.rig.Button;
import tickbus.simulator.rig.Lift;
import tickbus.simulator.rig.Rig;
import tickbus.simulator.text.Durations;

/**
 * The person at the panel: a script of stages, each with something to do, something to wait for, and a limit
 * in simulation time. Whatever goes wrong on the way is a {@link DemoFailure} that names the stage.
 */
final class Operator {
    private static final long SECOND = 1_000_000_000L;

    /** How many ticks must pass without an edge before counts are compared. */
    private static final int QUIET_TICKS = 50;

    /** And how many scans of the PLC. */
    private static final int QUIET_SCANS = 3;

    /** Statistics are slow, so they are asked for only now and then. */
    private static final int TICKS_PER_LOOK_AT_SCANS = 25;

    /** A part of the script; {@code faultExpected} while the jam and its recovery are under way. */
    private record Stage(String name, String awaited, long limitNanos, boolean faultExpected, Runnable begin,
            BooleanSupplier over) {
    }

    private final Deque<Stage> script = new ArrayDeque<>();
    private final Watcher watcher;
    private final Simulator simulator;
    private final Rig rig;
    private final Timeline timeline;
    private final EdgeAudit audit;
    private final StatisticsPeer peer;
    private Stage stage;
    private long since;
    private long firstScan;
    private boolean scansPassed;

    Operator(DemoOptions options, Watcher watcher, Timeline timeline, EdgeAudit audit, StatisticsPeer peer) {
        this.watcher = watcher;
        this.simulator = watcher.simulator();
        this.rig = watcher.rig();
        this.timeline = timeline;
        this.audit = audit;
        this.peer = peer;
        write(options.cycles(), options.jamCycle());
        next();
    }

    private void write(int cycles, int jamCycle) {
        stage("homing", "the Ready lamp", 25, () -> { }, watcher::readyLamp);
        stage("start", "the Running lamp", 3, () -> press(Button.START), watcher::runningLamp);
        for (int cycle = 1; cycle < jamCycle; cycle++) {
            runCycle(cycle);
        }
        fault("jam in cycle " + jamCycle, "Not OK and the Fault lamp", 20, this::jam, this::jamShown);
        fault("looking at the fault", "one second to pass", 2, () -> { }, () -> elapsed() >= SECOND);
        fault("clearing the jam", "half a second to pass", 2, this::clear, () -> elapsed() >= SECOND / 2);
        fault("recovery", "Not OK off and the Running lamp", 30, () -> press(Button.RESET),
                () -> !rig.notOk() && !watcher.faultLamp() && watcher.runningLamp());
        for (int cycle = jamCycle; cycle < cycles; cycle++) {
            runCycle(cycle);
        }
        stage("cycle " + cycles, "its step 2", 20, () -> { },
                () -> watcher.cycles() == cycles - 1 && watcher.step() == 2);
        stage("stop in cycle " + cycles, "its end", 20, () -> press(Button.STOP),
                () -> watcher.cycles() >= cycles);
        stage("parking", "the Parked lamp", 20, () -> { }, watcher::parkedLamp);
        stage("settling", "all edges to pass and the PLC to scan", 5, () -> firstScan = peer.scans(), this::settled);
    }

    private void runCycle(int cycle) {
        stage("cycle " + cycle, "its end", 20, () -> { }, () -> watcher.cycles() >= cycle);
    }

    private void stage(String name, String awaited, int limitSeconds, Runnable begin, BooleanSupplier over) {
        script.add(new Stage(name, awaited, limitSeconds * SECOND, false, begin, over));
    }

    private void fault(String name, String awaited, int limitSeconds, Runnable begin, BooleanSupplier over) {
        script.add(new Stage(name, awaited, limitSeconds * SECOND, true, begin, over));
    }

    /** Acts once, after a tick. */
    void act() {
        if (done()) {
            return;
        }
        if (!stage.faultExpected && (rig.notOk() || watcher.faultLamp())) {
            throw unexpectedFault();
        }
        if (stage.over.getAsBoolean()) {
            next();
        } else if (elapsed() > stage.limitNanos) {
            throw new DemoFailure("stage " + stage.name + ": waited " + Durations.text(stage.limitNanos)
                    + " of simulation time for " + stage.awaited + "; the PLC is in phase " + watcher.phaseName()
                    + ", step " + watcher.step());
        }
    }

    boolean done() {
        return stage == null;
    }

    /** What is being done and awaited. */
    String stage() {
        return done() ? "done" : stage.name + ", waiting for " + stage.awaited;
    }

    private void next() {
        stage = script.poll();
        since = simulator.simulationNanos();
        if (stage != null) {
            stage.begin.run();
        }
    }

    private long elapsed() {
        return simulator.simulationNanos() - since;
    }

    private void press(Button button) {
        rig.press(button);
        String name = button.name();
        say("presses " + name.charAt(0) + name.substring(1).toLowerCase(Locale.ROOT));
    }

    private void jam() {
        rig.jamNext(Lift.LA2);
        say("makes the next bottle at lift 2 stick");
    }

    private boolean jamShown() {
        boolean fault = rig.notOk() || watcher.faultLamp();
        if (fault && !rig.jammed()) {
            throw unexpectedFault();
        }
        return rig.notOk() && watcher.faultLamp();
    }

    private DemoFailure unexpectedFault() {
        String cause = rig.notOk() ? String.join("; ", rig.faults()) : "the PLC's Fault lamp is on, the rig is well";
        return new DemoFailure("unexpected fault in stage " + stage.name + ": " + cause);
    }

    private void clear() {
        rig.clearJam();
        say("takes the stuck bottle away");
    }

    private void say(String text) {
        timeline.add(simulator.simulationNanos(), "operator", text);
    }

    private boolean settled() {
        if (simulator.ticks() % TICKS_PER_LOOK_AT_SCANS == 0) {
            scansPassed = firstScan < 0 || peer.scans() >= firstScan + QUIET_SCANS;
        }
        return scansPassed && audit.quietTicks() >= QUIET_TICKS
                && elapsed() >= QUIET_TICKS * simulator.stepNanos();
    }
}
