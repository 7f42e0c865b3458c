package tickbus.demo.lab;

import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import tickbus.demo.PlcProcess;

/** A process of the laboratory, and all that it has said in its current life. */
final class Member implements AutoCloseable {
    /** None of them reports statistics. */
    private static final long NEVER = Long.MAX_VALUE;

    private final String name;
    private final PlcProcess process;
    private final List<String> said = new ArrayList<>();
    private List<String> command = List.of();

    /** One that is not started yet; {@code what} it is stands in messages. */
    Member(String name, String what, Path log) {
        this.name = name;
        process = new PlcProcess(what, "build it (make build), or name the tickbus executable by --tickbus", () -> command, NEVER, log);
    }

    String name() {
        return name;
    }

    void start(List<String> line) {
        command = List.copyOf(line);
        said.clear();
        process.start();
    }

    void kill() {
        process.kill();
    }

    /** What it has said since the last call. */
    List<String> listen() {
        List<String> news = process.news();
        said.addAll(news);
        return news;
    }

    /** What stands behind these words in a line that it has said; null if it has not. */
    String said(String words) {
        return said.stream().filter(line -> line.startsWith(words)).map(line -> line.substring(words.length()))
                .findFirst().orElse(null);
    }

    /**
     * Fails if it has ended.
     *
     * @throws tickbus.demo.DemoFailure with its name and last output
     */
    void check() {
        process.check();
    }

    /** Ends it, and hears its last words. */
    @Override
    public void close() {
        process.close();
        listen();
    }
}
