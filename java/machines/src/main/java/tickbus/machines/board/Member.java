package tickbus.machines.board;

import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import tickbus.machines.demo.PlcProcess;

/** A process of the laboratory, and its output in its current life. */
final class Member implements AutoCloseable {
    /** The processes report no statistics. */
    private static final long NEVER = Long.MAX_VALUE;

    private final String name;
    private final PlcProcess process;
    private final List<String> said = new ArrayList<>();
    private List<String> command = List.of();

    /** A process that is not started yet; {@code what} is its name in messages. */
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

    /** The output since the last call. */
    List<String> listen() {
        List<String> news = process.news();
        said.addAll(news);
        return news;
    }

    /** The text behind these words in an output line; null without such a line. */
    String said(String words) {
        return said.stream().filter(line -> line.startsWith(words)).map(line -> line.substring(words.length()))
                .findFirst().orElse(null);
    }

    /**
     * Fails if the process has ended.
     *
     * @throws tickbus.machines.demo.DemoFailure with the process's name and last output
     */
    void check() {
        process.check();
    }

    /** Ends the process, and takes its last output. */
    @Override
    public void close() {
        process.close();
        listen();
    }
}
