package tickbus.machines.rig;

import controlinterface.ControlInterfaceDeviceDriver;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import java.util.function.DoubleSupplier;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.demo.Timeline;
import tickbus.simulator.Simulator;
import tickbus.simulator.text.Durations;

/** Follows the operator panel, the rig and the link from tick to tick, and records changes. */
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
    private static final long LONGEST_START_NANOS = 10_000_000_000L;

    /** Statistics are slow, so they are read only now and then. */
    private static final int TICKS_PER_LOOK_AT_LINK = 10;

    /** The state of the link as the driver reports it; empty texts if it does not. */
    record Link(String state, String cause, String reason) {
        private static final Link UNKNOWN = new Link("", "", "");

        private static Link of(Map<String, String> statistics) {
            String state = statistics.get("state");
            return state == null ? UNKNOWN : new Link(state, statistics.getOrDefault("cause", ""),
                    statistics.getOrDefault("reason", ""));
        }

        @Override
        public String toString() {
            return state.isEmpty() ? "the driver says nothing about it"
                    : state + (cause.isEmpty() || cause.equals(state) ? "" : ", " + cause)
                    + (reason.isEmpty() ? "" : ": " + reason);
        }
    }

    private final Simulator simulator;
    private final Rig rig;
    private final ControlInterfaceDeviceDriver driver;
    private final Timeline timeline;
    private final DoubleSupplier ready;
    private final DoubleSupplier running;
    private final DoubleSupplier fault;
    private final DoubleSupplier parked;
    private final DoubleSupplier phase;
    private final DoubleSupplier step;
    private final DoubleSupplier cycles;
    private final DoubleSupplier status;
    private final DoubleSupplier age;
    private final List<String> faults = new ArrayList<>();

    private int lastPhase = -1;
    private int lastStep;
    private boolean lastNotOk;
    private boolean lastStale;
    private long stepSince;
    private Link link = Link.UNKNOWN;
    /** Cycles of the PLC's earlier lives, and of the current one as last reported. */
    private int cyclesBefore;
    private int cyclesTold;
    /** A PLC has been there. */
    private boolean begun;
    /** The PLC is dead: from the kill to the first data of the next life. */
    private boolean away;
    private long staleAtStart;
    private long staleInOutage;

    Watcher(Simulator simulator, Rig rig, ControlInterfaceDeviceDriver driver, Timeline timeline) {
        this.simulator = simulator;
        this.rig = rig;
        this.driver = driver;
        this.timeline = timeline;
        ready = simulator.probe("machine:panel.ready");
        running = simulator.probe("machine:panel.running");
        fault = simulator.probe("machine:panel.fault");
        parked = simulator.probe("machine:panel.parked");
        phase = simulator.probe("machine:panel.phase");
        step = simulator.probe("machine:panel.step");
        cycles = simulator.probe("machine:panel.cycles");
        status = simulator.probe(driver.id() + ":bus.status");
        age = simulator.probe(driver.id() + ":bus.age");
    }

    /** Checks everything once, after a tick. Fails if data are stale without a reason. */
    void look() {
        long now = simulator.simulationNanos();
        lookAtData(now);
        if (simulator.ticks() % TICKS_PER_LOOK_AT_LINK == 0) {
            lookAtLink();
        }
        if (!stale() && !away) {
            lookAtPlc(now);
        }
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

    private void lookAtPlc(long now) {
        int told = (int) cycles.getAsDouble();
        if (told != cyclesTold) {
            cyclesTold = told;
            timeline.add(now, "PLC", "cycles completed: " + cycles());
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
    }

    private void lookAtData(long now) {
        boolean stale = stale();
        if (!stale) {
            away &= !lastStale;
            begun = true;
        } else if (away) {
            staleInOutage++;
        } else if (begun) {
            lookAtLink();
            throw new DemoFailure("the data became stale, outside the start-up and the outage; link: " + link);
        } else {
            staleAtStart++;
            if (now > LONGEST_START_NANOS) {
                lookAtLink();
                throw new DemoFailure("no data came from a PLC for " + Durations.text(LONGEST_START_NANOS)
                        + " of simulation time; link: " + link);
            }
        }
        if (stale != lastStale) {
            lastStale = stale;
            timeline.add(now, "link", !stale ? "data are fresh" : (begun ? "data are stale" : "no data yet")
                    + ", fail-safe values are delivered");
        }
    }

    /** Asks the driver for the state of its link. */
    Link lookAtLink() {
        Link now = Link.of(driver.statistics());
        if (!now.state().equals(link.state()) || !now.cause().equals(link.cause())) {
            timeline.add(simulator.simulationNanos(), "link", now.toString());
        }
        link = now;
        return now;
    }

    /** The PLC is dead from now on, until new data arrive. */
    void plcKilled() {
        away = true;
        cyclesBefore += cyclesTold;
        cyclesTold = 0;
        lastPhase = -1;
        lastStep = 0;
    }

    /** True if the data of the last tick were stale. */
    boolean stale() {
        return (int) status.getAsDouble() == STALE;
    }

    /** True if the PLC is dead, according to the data. */
    boolean away() {
        return away;
    }

    Link link() {
        return link;
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
        if (stale() || away) {
            return "no PLC";
        }
        return phase() >= 0 && phase() < PHASES.length ? PHASES[phase()] : "unknown, " + phase();
    }

    /** The drum's step, 0 outside the run phase. */
    int step() {
        return (int) step.getAsDouble();
    }

    String stepName() {
        return step() >= 0 && step() < STEPS.length ? STEPS[step()] : "unknown";
    }

    /** Simulation time in the current step. */
    long stepNanos() {
        return simulator.simulationNanos() - stepSince;
    }

    /** Cycles completed by the PLC in all its lives. */
    int cycles() {
        return cyclesBefore + cyclesTold;
    }

    String statusName() {
        int value = (int) status.getAsDouble();
        return value >= 0 && value < STATUS.length ? STATUS[value] : "status " + value;
    }

    double ageSeconds() {
        return age.getAsDouble();
    }

    /** Stale ticks before the first data arrived. */
    long staleTicksAtStart() {
        return staleAtStart;
    }

    /** Stale ticks while the PLC was dead. */
    long staleTicksInOutage() {
        return staleInOutage;
    }

    /** A line for each time that Not OK rose, with the causes. */
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
