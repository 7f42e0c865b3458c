package tickbus.machines.demo;

import java.io.BufferedReader;
import java.io.File;
import java.io.IOException;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Optional;
import java.util.Queue;
import java.util.concurrent.ConcurrentLinkedQueue;
import java.util.concurrent.TimeUnit;
import java.util.function.Supplier;
import java.util.regex.Pattern;

/**
 * A PLC as a separate process, such as {@code tickbus plc}: started, killed, restarted, and reliably ended.
 *
 * <p>The process regularly prints its statistics as lines {@code key=value}, followed by an empty line; a thread reads
 * these, so that the tick never waits for the process. Every other line is output for people. Standard error goes to a file.
 *
 * <p>{@link #close} ends the process; so does the end of the JVM by whatever signal; and if the JVM itself is killed, the
 * process ends after the time given on its own command line.
 */
public final class PlcProcess implements Plc {
    private static final long SECONDS_TO_DIE = 5;
    private static final int LAST_WORDS = 5;

    /** The exit code of a process that a signal ended is above this. */
    private static final int SIGNALS = 128;

    /** The beginning of lines for people: the name of the command. */
    private static final Pattern WORDS = Pattern.compile("[a-z]+: ");

    private final String what;
    private final String hint;
    private final Supplier<List<String>> command;
    private final Path log;
    private final Thread hook = new Thread(this::destroy, "end of the PLC process");
    private final Queue<String> news = new ConcurrentLinkedQueue<>();
    private final long intervalNanos;
    private volatile Life life;
    private volatile long longestSilence;

    /** One run of the process, and its output. */
    private final class Life {
        final Process process;
        final Thread reader;
        volatile boolean killed;
        private volatile Map<String, String> block = Map.of();
        private volatile long blockTime;

        Life(Process process) {
            this.process = process;
            reader = new Thread(this::read, "output of PLC process " + process.pid());
            reader.setDaemon(true);
            reader.start();
        }

        private void read() {
            Map<String, String> lines = new LinkedHashMap<>();
            try (BufferedReader out = process.inputReader(StandardCharsets.UTF_8)) {
                for (String line = out.readLine(); line != null; line = out.readLine()) {
                    Optional<Map.Entry<String, String>> entry = StatisticsLines.read(line);
                    if (line.isEmpty() && !lines.isEmpty()) {
                        long now = System.nanoTime();
                        if (!block.isEmpty()) {
                            longestSilence = Math.max(longestSilence, now - blockTime - intervalNanos);
                        }
                        blockTime = now;
                        block = Map.copyOf(lines);
                        lines.clear();
                    } else if (!WORDS.matcher(line).lookingAt() && entry.isPresent()) {
                        lines.put(entry.get().getKey(), entry.get().getValue());
                    } else if (!line.isEmpty()) {
                        news.add(line);
                    }
                }
            } catch (IOException e) {
                // The process was killed while writing.
            }
        }

        Counts counts() {
            Map<String, String> now = block;
            return now.isEmpty() ? Counts.NONE : Counts.of(now, blockTime);
        }

        void await(String complaint) {
            try {
                if (!process.waitFor(SECONDS_TO_DIE, TimeUnit.SECONDS)) {
                    throw new DemoFailure(name() + " of " + what + " " + complaint);
                }
                reader.join(TimeUnit.SECONDS.toMillis(SECONDS_TO_DIE));
            } catch (InterruptedException e) {
                Thread.currentThread().interrupt();
                throw new DemoFailure("interrupted");
            }
        }
    }

    /**
     * A PLC's process, {@code tickbus plc}, that is not started yet.
     *
     * @param command gives the executable and its arguments for the next life
     * @param intervalNanos the interval of its statistics
     * @param log gets the process's standard error; truncated now, appended to by each life
     */
    public PlcProcess(Supplier<List<String>> command, long intervalNanos, Path log) {
        this("the PLC", "build it (make build), or name the tickbus executable by --plc", command, intervalNanos, log);
    }

    /**
     * A process that is not started yet.
     *
     * @param what the name in messages, such as {@code the PLC}
     * @param hint the remedy if the process cannot be started
     * @param command gives the executable and its arguments for the next life
     * @param intervalNanos the interval of its statistics
     * @param log gets the process's standard error; truncated now, appended to by each life
     */
    public PlcProcess(String what, String hint, Supplier<List<String>> command, long intervalNanos, Path log) {
        this.what = what;
        this.hint = hint;
        this.command = command;
        this.intervalNanos = intervalNanos;
        this.log = log;
        try {
            Files.createDirectories(log.toAbsolutePath().getParent());
            Files.writeString(log, "");
        } catch (IOException e) {
            throw new DemoFailure("the log of " + what + " cannot be written: " + e);
        }
        Runtime.getRuntime().addShutdownHook(hook);
    }

    @Override
    public boolean restartable() {
        return true;
    }

    @Override
    public void start() {
        ProcessBuilder builder = new ProcessBuilder(command.get())
                .redirectInput(ProcessBuilder.Redirect.from(nothing()))
                .redirectError(ProcessBuilder.Redirect.appendTo(log.toFile()));
        // The log goes to a file, so it can contain more than errors.
        builder.environment().put("TICKBUS_LOG", "info");
        Process process;
        try {
            process = builder.start();
        } catch (IOException e) {
            throw new DemoFailure(what + " cannot be started: " + e.getMessage() + "; " + hint);
        }
        life = new Life(process);
    }

    private static File nothing() {
        return new File(System.getProperty("os.name").startsWith("Windows") ? "NUL" : "/dev/null");
    }

    @Override
    public void kill() {
        Life now = life;
        now.killed = true;
        // Process.destroyForcibly would also close the process's output, whose last part may not be read yet.
        now.process.toHandle().destroyForcibly();
        now.await("was not dead " + SECONDS_TO_DIE + " s after it was killed");
    }

    @Override
    public Counts counts() {
        Life now = life;
        return now == null ? Counts.NONE : now.counts();
    }

    /**
     * The last statistics that the process printed in its current life.
     *
     * @return keys and values; empty if the process has printed none yet
     */
    public Map<String, String> statistics() {
        Life now = life;
        return now == null ? Map.of() : now.block;
    }

    @Override
    public List<String> news() {
        if (news.isEmpty()) {
            return List.of();
        }
        List<String> taken = new ArrayList<>();
        for (String line = news.poll(); line != null; line = news.poll()) {
            taken.add(line);
        }
        return taken;
    }

    @Override
    public long longestSilenceNanos() {
        return longestSilence;
    }

    @Override
    public String name() {
        Life now = life;
        return now == null ? "no process" : "process " + now.process.pid();
    }

    @Override
    public void check() {
        Life now = life;
        if (now == null || now.killed || now.process.isAlive()) {
            return;
        }
        now.await("hangs at its end");
        throw new DemoFailure(name() + " of " + what + " ended by itself with exit code " + now.process.exitValue()
                + lastWords());
    }

    /** True if a foreign signal has ended the current life, which a stall of the machine does not do. */
    public boolean endedBySignal() {
        Life now = life;
        return now != null && !now.killed && !now.process.isAlive() && now.process.exitValue() > SIGNALS;
    }

    private String lastWords() {
        try {
            List<String> lines = Files.readAllLines(log);
            if (!lines.isEmpty()) {
                List<String> last = lines.subList(Math.max(0, lines.size() - LAST_WORDS), lines.size());
                return "; its last words: " + String.join("; ", last);
            }
        } catch (IOException e) {
            // The exception is about the process, not about its log.
        }
        return "; it said nothing on standard error";
    }

    @Override
    public void close() {
        Life now = life;
        if (now != null && now.process.isAlive()) {
            now.killed = true;
            // Terminated first, so that the last lines get into the log. Process.destroy would close the output before.
            now.process.toHandle().destroy();
            try {
                if (!now.process.waitFor(SECONDS_TO_DIE, TimeUnit.SECONDS)) {
                    destroy();
                    // Killing takes effect only after a moment.
                    now.process.waitFor(SECONDS_TO_DIE, TimeUnit.SECONDS);
                }
                now.reader.join(TimeUnit.SECONDS.toMillis(SECONDS_TO_DIE));
            } catch (InterruptedException e) {
                destroy();
                Thread.currentThread().interrupt();
            }
        }
        try {
            Runtime.getRuntime().removeShutdownHook(hook);
        } catch (IllegalStateException e) {
            // The JVM is ending, and the hook runs already.
        }
    }

    private void destroy() {
        Life now = life;
        if (now != null) {
            now.process.destroyForcibly();
        }
    }
}
