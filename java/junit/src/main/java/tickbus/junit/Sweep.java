package tickbus.junit;

import java.io.IOException;
import java.io.UncheckedIOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Arrays;
import java.util.List;
import java.util.stream.IntStream;
import java.util.stream.Stream;
import org.junit.jupiter.api.extension.Extension;
import org.junit.jupiter.api.extension.ExtensionConfigurationException;
import org.junit.jupiter.api.extension.ExtensionContext;
import org.junit.jupiter.api.extension.TestTemplateInvocationContext;
import org.junit.platform.commons.support.AnnotationSupport;
import tickbus.FieldbusException;
import tickbus.SweepSession;

/** The runs of one {@link FaultSweep}. */
final class Sweep implements AutoCloseable {
    private static final String ACCEPT = "tickbus.accept";
    private static final String ONLY = "tickbus.only";

    private final String name;
    private final String keys;
    private final boolean accepting;
    private final String only;
    private final ExtensionContext context;
    /** The test as build tools name it. */
    private final String selector;
    private final Path matrix;
    private final Path page;
    private boolean begun;
    private SweepSession session;
    /** The names of the runs, once that without a fault is over. */
    private List<String> names = List.of();
    /** The pages about their recordings, where there are any. */
    private Path[] reports = new Path[0];

    Sweep(ExtensionContext context) {
        String type = context.getRequiredTestClass().getName();
        this.name = type.substring(type.lastIndexOf('.') + 1).replace('$', '.') + "."
            + context.getRequiredTestMethod().getName();
        this.keys = AnnotationSupport.findAnnotation(context.getTestMethod(), FaultSweep.class).orElseThrow().value();
        this.accepting = context.getConfigurationParameter(ACCEPT).map(Boolean::parseBoolean).orElse(false);
        this.only = context.getConfigurationParameter(ONLY).orElse("");
        this.context = context;
        this.selector = type + "#" + context.getRequiredTestMethod().getName();
        Path folder = Keep.folder(context);
        this.matrix = folder.resolve(name + ".txt");
        this.page = folder.resolve(name + ".html");
    }

    TestTemplateInvocationContext withoutFault() {
        return context("without a fault", SweepRun.WITHOUT_FAULT);
    }

    /** The runs with a fault; none if the one without has failed. After the last one, the sweep is concluded. */
    Stream<TestTemplateInvocationContext> runs() {
        if (!begun) {
            throw new ExtensionConfigurationException("@FaultSweep: the runs of " + name + " need the run without a fault,"
                + " which was not chosen; run the method as a whole, or choose runs with -D" + ONLY + "=TEXT");
        }
        if (names.isEmpty()) {
            return Stream.empty();
        }
        boolean exact = names.contains(only);
        List<TestTemplateInvocationContext> chosen = IntStream.range(0, names.size())
            .filter(run -> exact ? names.get(run).equals(only) : names.get(run).contains(only))
            .mapToObj(run -> context(names.get(run), run)).toList();
        if (chosen.isEmpty()) {
            throw new ExtensionConfigurationException("-D" + ONLY + "=" + only + ": no run of the sweep " + name
                + " has this in its name; the first one is \"" + names.get(0) + "\"");
        }
        return Stream.concat(chosen.stream(), Stream.of(this).flatMap(Sweep::conclude));
    }

    private TestTemplateInvocationContext context(String display, int run) {
        Extension extension = new SweepRun(this, run);
        return new TestTemplateInvocationContext() {
            @Override
            public String getDisplayName(int invocation) {
                return display;
            }

            @Override
            public List<Extension> getAdditionalExtensions() {
                return List.of(extension);
            }
        };
    }

    /** After the last run: accepts the verdicts if that is wanted, and writes the matrix and the page. */
    private Stream<TestTemplateInvocationContext> conclude() {
        if (accepting) {
            context.publishReportEntry("tickbus.accepted", session.accept().toString());
        }
        try {
            Files.createDirectories(matrix.getParent());
            Files.writeString(matrix, session.summary());
        } catch (IOException e) {
            throw new UncheckedIOException(matrix + ": the matrix cannot be written", e);
        }
        String again = "mvn test '-Dtest=" + selector + "' '-D" + ONLY + "={}'";
        session.page(page, again, Arrays.asList(reports));
        context.publishReportEntry("tickbus.sweep", page.toString());
        return Stream.empty();
    }

    /** Begins a run on a PLC that has just been made. */
    void begin(Bench bench, int run) {
        if (run != SweepRun.WITHOUT_FAULT) {
            session.begin(bench.bus(), run);
            return;
        }
        begun = true;
        clear();
        try {
            session = new SweepSession(bench.bus(), name, Path.of("").toAbsolutePath(), keys, bench.plc().stepNanos());
        } catch (FieldbusException e) {
            throw new ExtensionConfigurationException("@FaultSweep: " + e.getMessage(), e);
        }
        session.beginWithoutFault(bench.bus());
    }

    /** Removes the results of an earlier run, which would be taken for those of this run if it is interrupted. */
    private void clear() {
        try {
            Files.deleteIfExists(matrix);
            Files.deleteIfExists(page);
        } catch (IOException e) {
            throw new UncheckedIOException("the results of an earlier sweep cannot be removed", e);
        }
    }

    /** The page about the recording of a run that has failed. */
    void kept(int run, Path page) {
        reports[run] = page;
    }

    SweepSession session() {
        return session;
    }

    /** The run without a fault is over: makes the list of the others. */
    void plan() {
        try {
            names = session.plan(accepting);
            reports = new Path[names.size()];
        } catch (FieldbusException e) {
            throw new ExtensionConfigurationException("@FaultSweep: " + e.getMessage(), e);
        }
    }

    /** True if all verdicts pass, because they are about to be accepted. */
    boolean isAccepting() {
        return accepting;
    }

    @Override
    public void close() {
        if (session != null) {
            session.close();
        }
    }
}
