package tickbus.simulator.demo;

import java.util.ArrayList;
import java.util.List;
import java.util.function.DoubleSupplier;
import tickbus.simulator.Simulator;
import tickbus.simulator.rig.Rig;
import tickbus.simulator.text.Durations;

/** Follows the operator panel, the rig and the link from tick to tick, and writes down what changes. */
final class Watcher {
    private static final String[] PHASES = {
        "initialise", "home", "ready", "run", "abort", "recover", "finalise", "parked"
    };
    private static final String[] STEPS = {
        "none",
        "IM1 +90 degrees",
        "LA1 + big, SC1 on",
        "LA1 - small, SC1 off",
        "IM2 180 degrees",
        "LA1 + small with SC1; LA2 up with SC2, lamp on",
        "LA1 - big with SC1; LA2 down with SC2, lamp on"
    };
    private static final String[] STATUS = {"fresh", "unchanged", "stale"};
    private static final int STALE = 2;
    private static final int RUN = 3;
    private static final long LONGEST_STALE_NANOS = 1_000_000_000L;

    private final Simulator simulator;
    private final Rig rig;
    private final Timeline timeline;
    private final DoubleSupplier ready;
    private final DoubleSupplier running;
    private final DoubleSupplier fault;
    private final DoubleSupplier parked;
    private final DoubleSupplier phase;
    private final DoubleSupplier step;
    private final DoubleSupplier cycles;
    private final DoubleSupplier lastStepComplete;
    private final DoubleSupplier status;
    private final DoubleSupplier age;
    private final List<String> faults = new ArrayList<>();

    private int lastPhase = -1;
    private int lastStep;
    private int lastCycles;
    private boolean lastNotOk;
    private boolean lastComplete;
    private int rigCycles;
    private long lastLampErrors;
    private long lampErrors;
    private boolean lastStale;
    private long stepSince;
    private long staleTicks;
    private long staleInARow;

    Watcher(Simulator simulator, Rig rig, int driver, Timeline timeline) {
        this.simulator = simulator;
        this.rig = rig;
        this.timeline = timeline;
        ready = simulator.probe("machine:panel.ready");
        running = simulator.probe("machine:panel.running");
        fault = simulator.probe("machine:panel.fault");
        parked = simulator.probe("machine:panel.parked");
        phase = simulator.probe("machine:panel.phase");
        step = simulator.probe("machine:panel.step");
        cycles = simulator.probe("machine:panel.cycles");
        lastStepComplete = simulator.probe("machine:step6.complete");
        status = simulator.probe(driver + ":bus.status");
        age = simulator.probe(driver + ":bus.age");
    }

    /** Looks at everything once, after a tick. Fails if the link was stale for too long. */
    void look() {
        long now = simulator.simulationNanos();
        lookAtLink(now);
        if (cycles() != lastCycles) {
            lastCycles = cycles();
            timeline.add(now, "PLC", "cycles completed: " + lastCycles);
        }
        if (phase() != lastPhase) {
            lastPhase = phase();
            timeline.add(now, "PLC", "phase " + phaseName());
        }
        if (step() != lastStep) {
            lastStep = step();
            stepSince = now;
            if (lastStep != 0) {
                timeline.add(now, "PLC", "cycle " + (cycles() + 1) + ", step " + lastStep + ": " + stepName());
            }
        }
        lookAtSteps();
        if (rig.notOk() != lastNotOk) {
            lastNotOk = rig.notOk();
            if (lastNotOk) {
                String causes = String.join("; ", rig.faults());
                faults.add(Durations.seconds(now) + " s  " + causes);
                timeline.add(now, "rig", "Not OK: " + causes);
            } else {
                timeline.add(now, "rig", "Not OK is off");
            }
        }
    }

    /**
     * Counts what the rig says about steps, but only in the run phase: lowering both lifts with bottles on
     * their cups while homing has the motion and suction of step 6, so the rig alone cannot tell.
     */
    private void lookAtSteps() {
        boolean complete = lastStepComplete.getAsDouble() != 0;
        long errors = rig.counters().lampErrors();
        if (phase() == RUN) {
            rigCycles += complete && !lastComplete ? 1 : 0;
            lampErrors += errors - lastLampErrors;
        }
        lastComplete = complete;
        lastLampErrors = errors;
    }

    private void lookAtLink(long now) {
        boolean stale = (int) status.getAsDouble() == STALE;
        if (stale != lastStale) {
            lastStale = stale;
            timeline.add(now, "link", stale ? "stale: nothing from the PLC" : "alive again");
        }
        if (!stale) {
            staleInARow = 0;
            return;
        }
        staleTicks++;
        staleInARow++;
        if (staleInARow * simulator.stepNanos() > LONGEST_STALE_NANOS) {
            throw new DemoFailure("the link was stale for more than "
                    + Durations.text(LONGEST_STALE_NANOS) + " of simulation time");
        }
    }

    boolean readyLamp() {
        return ready.getAsDouble() != 0;
    }

    boolean runningLamp() {
        return running.getAsDouble() != 0;
    }

    boolean faultLamp() {
        return fault.getAsDouble() != 0;
    }

    boolean parkedLamp() {
        return parked.getAsDouble() != 0;
    }

    int phase() {
        return (int) phase.getAsDouble();
    }

    String phaseName() {
        return phase() >= 0 && phase() < PHASES.length ? PHASES[phase()] : "unknown, " + phase();
    }

    /** The drum's step, 0 outside the run phase. */
    int step() {
        return (int) step.getAsDouble();
    }

    String stepName() {
        return step() >= 0 && step() < STEPS.length ? STEPS[step()] : "unknown";
    }

    /** Simulation time in the present step. */
    long stepNanos() {
        return simulator.simulationNanos() - stepSince;
    }

    int cycles() {
        return (int) cycles.getAsDouble();
    }

    /** Cycles as the machine sees them: how often step 6 was completed in the run phase. */
    int rigCycles() {
        return rigCycles;
    }

    /** How often the lamp differed from the commanded motion of lift 2 in the run phase. */
    long lampErrors() {
        return lampErrors;
    }

    String statusName() {
        int value = (int) status.getAsDouble();
        return value >= 0 && value < STATUS.length ? STATUS[value] : "status " + value;
    }

    double ageSeconds() {
        return age.getAsDouble();
    }

    long staleTicks() {
        return staleTicks;
    }

    /** A line per time that Not OK rose, with its causes. */
    List<String> faults() {
        return List.copyOf(faults);
    }

    Rig rig() {
        return rig;
    }

    Simulator simulator() {
        return simulator;
    }
}
