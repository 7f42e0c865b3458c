package tickbus.petri;

import java.util.Optional;

/**
 * What a running net was like at one moment, for views. It is filled in again and again, which allocates nothing.
 */
public final class NetState {
    /** Whether a transition can fire. */
    public enum Phase {
        /** The marking does not enable it. */
        DISABLED,
        /** It is enabled, and its delay is not over. */
        DELAYED,
        /** It is enabled, its delay is over, and its condition does not hold. */
        HELD,
        /** It may fire. */
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

    /** Those of them that are old enough to be used; fewer than all only in a timed place. */
    public int available(int place) {
        return available[place];
    }

    /** Whether a transition can fire. */
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

    /** The {@link Conjunction#failed} part of the condition of a held transition; -1 if that is not known. */
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

    /** How many scans there had been. */
    public long scans() {
        return scans;
    }

    /** The time of the last scan in nanoseconds; only if there were {@link #scans}. */
    public long nanos() {
        return nanos;
    }

    /** Why it stopped; empty while it runs. */
    public Optional<Stop> stop() {
        return Optional.ofNullable(stop);
    }
}
