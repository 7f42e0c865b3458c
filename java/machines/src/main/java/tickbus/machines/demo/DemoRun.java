package tickbus.machines.demo;

import java.io.PrintStream;
import java.util.ArrayList;
import java.util.List;
import java.util.function.Function;
import java.util.function.ToIntFunction;
import tickbus.simulator.Arguments;

/**
 * The parts of a run that all demos share: the command line, and further attempts after a failure that proves nothing,
 * because the whole computer stood still meanwhile.
 */
public final class DemoRun {
    private static final int ATTEMPTS = 5;

    private final Verdict verdicts;
    private final List<String> notes = new ArrayList<>();

    /**
     * Begins with the first attempt.
     *
     * @param verdicts of the demo
     */
    public DemoRun(Verdict verdicts) {
        this.verdicts = verdicts;
    }

    /**
     * Reads the command line and plays the demo.
     *
     * @param args the command line; {@code --help} prints the usage only
     * @param usage the help text
     * @param read makes the options
     * @param verdict gives the verdict on a wrong command line
     * @param play plays the demo and returns its exit code
     * @param out gets help and verdict
     * @param err gets errors in the command line
     * @param <O> the demo's options
     * @return the exit code
     */
    public static <O> int start(String[] args, String usage, Function<String[], O> read, Verdict verdict,
            ToIntFunction<O> play, PrintStream out, PrintStream err) {
        if (List.of(args).contains("--help")) {
            out.print(usage);
            return Verdict.OK;
        }
        O options;
        try {
            options = read.apply(args);
        } catch (Arguments.UsageException e) {
            err.println(e.getMessage() + "\n");
            err.print(usage);
            out.println(verdict.failed(e.getMessage()));
            return Verdict.USAGE;
        }
        return play.applyAsInt(options);
    }

    /**
     * The attempts so far that do not count, for the timeline of the next one.
     *
     * @return a line each
     */
    public List<String> notes() {
        return List.copyOf(notes);
    }

    /**
     * Returns whether an attempt does not count, so that another one is due.
     *
     * @param verdict on the attempt
     * @param stalls during the attempt
     * @return false if the verdict holds, or after the last attempt
     */
    public boolean repeats(String verdict, Stalls stalls) {
        long stall = stalls.longestNanos();
        if (verdicts.isOk(verdict) || stall == 0) {
            return false;
        }
        notes.add("attempt " + (notes.size() + 1) + " does not count, because this machine stood still for "
                + stall / 1_000_000 + " ms: " + verdict);
        return notes.size() < ATTEMPTS;
    }

    /**
     * The verdict on all attempts.
     *
     * @param last the verdict on the last one
     * @return {@code last}, or that nothing can be said, if no attempt counts
     */
    public String verdict(String last) {
        return notes.size() < ATTEMPTS
                ? last
                : verdicts.failed("this machine stood still too long in each of " + ATTEMPTS
                        + " attempts, so nothing can be said; the last attempt ended: " + verdicts.reason(last));
    }
}
