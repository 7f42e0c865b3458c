package tickbus.machines.demo;

import java.io.PrintStream;
import tickbus.simulator.ShutdownGuard;

/**
 * The last line of a demo on standard output, {@code NAME: ok …} or {@code NAME: failed reason=…}, and the matching exit
 * code.
 */
public final class Verdict {
    /** The exit code after a wrong command line. */
    public static final int USAGE = 2;

    /** The exit code after a successful demo. */
    public static final int OK = 0;

    private static final int FAILED = 1;
    private static final int INTERRUPTED = 130;

    /** The time in which this process learns of a Ctrl-C. */
    private static final long INTERRUPTION_MILLIS = 500;

    private final String ok;
    private final String failed;

    /**
     * The verdicts of a demo.
     *
     * @param demo the demo's name
     */
    public Verdict(String demo) {
        ok = demo + ": ok ";
        failed = demo + ": failed reason=";
    }

    /**
     * The verdict on a success.
     *
     * @param counts the results, as keys and values
     * @return the line
     */
    public String ok(String counts) {
        return ok + counts;
    }

    /**
     * The verdict on a failure.
     *
     * @param reason the reason, for people
     * @return the line
     */
    public String failed(String reason) {
        String line = reason.strip().replaceAll("\\s*\\R\\s*", "; ").replace('"', '\'');
        return failed + (line.matches("[\\w.-]+") ? line : "\"" + line + "\"");
    }

    /**
     * The verdict on a failure by an exception.
     *
     * @param e a {@link DemoFailure}, or anything unexpected
     * @param err gets the message of an unexpected exception
     * @return the line
     */
    public String failed(Throwable e, PrintStream err) {
        String reason = e instanceof DemoFailure || e.getMessage() != null ? e.getMessage() : e.toString();
        if (!(e instanceof DemoFailure)) {
            err.println(reason);
        }
        return failed(reason);
    }

    /**
     * Returns whether a verdict is a success.
     *
     * @param line the verdict
     * @return true for a success
     */
    public boolean isOk(String line) {
        return line.startsWith(ok);
    }

    /**
     * The reason in the verdict on a failure.
     *
     * @param line the verdict
     * @return the reason without quotation marks
     */
    public String reason(String line) {
        return line.substring(failed.length()).replace("\"", "");
    }

    /**
     * Prints the verdict.
     *
     * @param line the verdict
     * @param guard detects Ctrl-C
     * @param out gets the line
     * @return the exit code
     */
    public int end(String line, ShutdownGuard guard, PrintStream out) {
        out.println(line);
        out.flush();
        return guard.triggered() ? INTERRUPTED : isOk(line) ? OK : FAILED;
    }

    /**
     * Checks other processes of the demo. Ctrl-C in a terminal reaches all of them, and another one can end earlier than
     * this one: then the demo was interrupted.
     *
     * @param guard detects Ctrl-C
     * @param check throws a {@link DemoFailure} if one of them has ended
     */
    public static void unlessInterrupted(ShutdownGuard guard, Runnable check) {
        try {
            check.run();
        } catch (DemoFailure e) {
            if (guard.triggers(INTERRUPTION_MILLIS)) {
                throw new DemoFailure("interrupted");
            }
            throw e;
        }
    }
}
