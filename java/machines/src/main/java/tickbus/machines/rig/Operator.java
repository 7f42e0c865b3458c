package tickbus.machines.rig;

import java.util.ArrayDeque;
import java.util.Deque;
import java.util.Locale;
import java.util.concurrent.locks.LockSupport;
import java.util.function.BooleanSupplier;
import java.util.function.Supplier;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.demo.Plc;
import tickbus.machines.demo.Stalls;
import tickbus.machines.demo.Timeline;
import tickbus.simulator.Simulator;
import tickbus.simulator.text.Durations;

/**
 * The operator at the panel: a script of stages, each with an action, an awaited condition, and a limit in simulation time.
 * Every mistake is a {@link DemoFailure} that names the stage.
 */
final class Operator {
    private static final long SECOND = 1_000_000_000L;

    /** How many ticks must pass without an edge before counts are compared. */
    private static final int QUIET_TICKS = 50;

    /** How many scans of the PLC must pass as well. */
    private static final int QUIET_SCANS = 3;

    /** How long the counts of both ends may take to agree; after that they are compared anyway. */
    private static final long AGREEMENT_NANOS = 2 * SECOND;

    /** Statistics are slow, so they are read only now and then. */
    private static final int TICKS_PER_LOOK_AT_SCANS = 5;

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
    private final Plc plc;
    private final Stalls stalls;
    private final Supplier<Outage> blackout;
    private Stage stage;
    private Outage outage;
    private long since;
    private long firstScan;
    private int restarts;
    private String disagreement;

    Operator(DemoOptions options, Watcher watcher, Timeline timeline, EdgeAudit audit, Plc plc, Stalls stalls,
            Supplier<Outage> blackout) {
        this.watcher = watcher;
        this.simulator = watcher.simulator();
        this.rig = watcher.rig();
        this.timeline = timeline;
        this.audit = audit;
        this.plc = plc;
        this.stalls = stalls;
        this.blackout = blackout;
        write(options.cycles(), options.jamCycle(), plc.restartable() ? options.killCycle() : 0);
        next();
    }

    private void write(int cycles, int jamCycle, int killCycle) {
        stage("homing", "the Ready lamp", 30, () -> { }, watcher::readyLamp);
        stage("start", "the Running lamp", 3, () -> press(Button.START), watcher::runningLamp);
        for (int cycle = 1; cycle < jamCycle; cycle++) {
            runCycle(cycle);
        }
        fault("jam in cycle " + jamCycle, "Not OK and the Fault lamp", 20, this::jam, this::jamShown);
        fault("looking at the fault", "one second to pass", 2, () -> { }, () -> elapsed() >= SECOND);
        fault("clearing the jam", "half a second to pass", 2, this::clear, () -> elapsed() >= SECOND / 2);
        fault("recovery", "Not OK off and the Running lamp", 30, () -> press(Button.RESET),
                () -> !rig.notOk() && !watcher.faultLamp() && watcher.runningLamp());
        for (int cycle = jamCycle; cycle < killCycle; cycle++) {
            runCycle(cycle);
        }
        if (killCycle > 0) {
            restart(killCycle);
        }
        for (int cycle = Math.max(jamCycle, killCycle); cycle < cycles; cycle++) {
            runCycle(cycle);
        }
        stage("cycle " + cycles, "its step 2", 20, () -> { },
                () -> watcher.cycles() == cycles - 1 && watcher.step() == 2);
        stage("stop in cycle " + cycles, "its end", 20, () -> press(Button.STOP),
                () -> watcher.cycles() >= cycles);
        stage("parking", "the Parked lamp", 20, () -> { }, watcher::parkedLamp);
        stage("settling", "all edges to pass and the PLC to scan", 8, () -> firstScan = plc.counts().scans(),
                this::settled);
    }

    /** The PLC is killed during a cycle, and restarted. */
    private void restart(int cycle) {
        stage("cycle " + cycle, "lift 2 to carry a bottle, and equal counts at both ends", 20,
                () -> { }, () -> momentToKill(cycle));
        stage("PLC killed", "stale data and the rig to stand still", 5, this::kill, () -> outage.standsStill());
        stage("looking at the rig", "1.5 s to pass", 3, () -> { }, () -> elapsed() >= SECOND * 3 / 2);
        stage("PLC started again", "data from it", 20, this::startAgain, () -> outage.over());
        stage("homing after the outage", "the Ready lamp", 40, () -> { }, watcher::readyLamp);
        stage("start after the outage", "the Running lamp", 3, () -> press(Button.START), watcher::runningLamp);
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
        for (String line : plc.news()) {
            timeline.add(simulator.simulationNanos(), "PLC", "says: " + line.replaceFirst("^plc: ", ""));
        }
        if (outage != null) {
            outage.look(watcher.stale());
        }
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

    /** The current stage. */
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

    private boolean quiet() {
        return audit.quietTicks() >= QUIET_TICKS && simulator.ticks() % TICKS_PER_LOOK_AT_SCANS == 0;
    }

    /**
     * The best moment to kill the PLC: lift 2 is moving with a bottle on its cup. The PLC's newest counts must also include
     * every edge, as they do after a while without edges, because a dead PLC cannot report.
     */
    private boolean momentToKill(int cycle) {
        if (watcher.cycles() >= cycle) {
            throw new DemoFailure("cycle " + cycle + " ended before the counts of both ends agreed, so the PLC could not"
                    + " be killed in it" + differing());
        }
        if (!rig.moving() || rig.position(Lift.LA2) <= 1
                || rig.bottles().stream().noneMatch(bottle -> bottle.place() == Bottle.Place.CUP2) || !quiet()) {
            return false;
        }
        return agreed(plc.counts());
    }

    private String differing() {
        return disagreement == null ? "" : ": " + disagreement;
    }

    /** True if the PLC's newest counts include every edge counted at this end. */
    private boolean agreed(Plc.Counts counts) {
        disagreement = audit.isNewer(counts) ? audit.disagreement(counts) : null;
        return audit.isNewer(counts) && disagreement == null;
    }

    private void kill() {
        outage = blackout.get();
        String name = plc.name();
        plc.kill();
        // No tick runs while the PLC dies and the driver notices, so no edge falls into that time.
        Watcher.Link link = awaitLoss();
        stalls.pause();
        audit.cut(plc.counts());
        watcher.plcKilled();
        outage.left(link.toString());
        say("kills the PLC (" + name + ", SIGKILL) in " + outage.place());
    }

    private Watcher.Link awaitLoss() {
        long limit = System.nanoTime() + SECOND;
        Watcher.Link link = watcher.lookAtLink();
        while (link.state().equals("running") && System.nanoTime() - limit < 0) {
            LockSupport.parkNanos(100_000);
            link = watcher.lookAtLink();
        }
        return link;
    }

    private void startAgain() {
        plc.start();
        stalls.pause();
        restarts++;
        say("starts the PLC again (" + plc.name() + ")");
    }

    /** How often the PLC was restarted. */
    int restarts() {
        return restarts;
    }

    /** The time without a PLC, null if the PLC was never killed. */
    Outage outage() {
        return outage;
    }

    private boolean settled() {
        if (!quiet() || elapsed() < QUIET_TICKS * simulator.stepNanos()) {
            return false;
        }
        Plc.Counts counts = plc.counts();
        boolean scanned = firstScan < 0 || counts.scans() >= firstScan + QUIET_SCANS;
        return scanned && (agreed(counts) || elapsed() > AGREEMENT_NANOS);
    }
}
