package tickbus.petri.run;

import java.util.Optional;

/**
 * The state of a running net at one moment, for views. The object is refilled again and again, which allocates nothing.
 */
public final class NetState {
    /** The readiness of a transition. */
    public enum Phase {
        /** The marking does not enable the transition. */
        DISABLED,
        /** The transition is enabled, and its delay is not over. */
        DELAYED,
        /** The transition is enabled, its delay is over, and its condition does not hold. */
        HELD,
        /** The transition may fire. */
        READY
    }

    final int[] tokens;
    final int[] available;
    final Phase[] phases;
    final long[] due;
    final long[] fired;
    final long[] lastFired;
    final int[] failed;
    final double[] inputs;
    final double[] outputs;
    long scans;
    long nanos;
    Stop stop;

    /** Room for the state of a net. */
    public NetState(RunningNet of) {
        int places = of.net().places().size();
        int transitions = of.net().transitions().size();
        tokens = new int[places];
        available = new int[places];
        phases = new Phase[transitions];
        due = new long[transitions];
        fired = new long[transitions];
        lastFired = new long[transitions];
        failed = new int[transitions];
        inputs = new double[of.inputNames().size()];
        outputs = new double[of.outputNames().size()];
    }

    /** The tokens in a place. */
    public int tokens(int place) {
        return tokens[place];
    }

    /** The tokens in a place that are old enough to be used; fewer than all only in a timed place. */
    public int available(int place) {
        return available[place];
    }

    /** The readiness of a transition. */
    public Phase phase(int transition) {
        return phases[transition];
    }

    /** When the delay of a transition is over, in nanoseconds; {@link Long#MAX_VALUE} unless it is delayed. */
    public long due(int transition) {
        return due[transition];
    }

    /** How often a transition has fired. */
    public long fired(int transition) {
        return fired[transition];
    }

    /** When a transition fired last, in nanoseconds; only if it has {@link #fired}. */
    public long lastFired(int transition) {
        return lastFired[transition];
    }

    /** The {@link Conjunction#failed} part of the condition of a held transition; -1 if it is not known. */
    public int failed(int transition) {
        return failed[transition];
    }

    /** The value of an input. */
    public double input(int index) {
        return inputs[index];
    }

    /** The value of an output. */
    public double output(int index) {
        return outputs[index];
    }

    /** The number of scans. */
    public long scans() {
        return scans;
    }

    /** The time of the last scan in nanoseconds; only if there were {@link #scans}. */
    public long nanos() {
        return nanos;
    }

    /** Why the net stopped; empty while it runs. */
    public Optional<Stop> stop() {
        return Optional.ofNullable(stop);
    }
}
