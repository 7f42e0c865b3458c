package tickbus.machines.board;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Locale;
import java.util.concurrent.locks.LockSupport;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.demo.Timeline;

/** The processes of the laboratory: the dispatcher and the two controllers. */
final class Laboratory implements AutoCloseable {
    /** After this time a process ends on its own, in case nothing else ends it. */
    private static final String LONGEST = "30min";

    /** The same where somebody looks at the page. */
    private static final String LONGEST_WITH_PAGE = "24h";

    private static final long LISTENING_NANOS = 10_000_000_000L;
    private static final Pattern ADDRESS = Pattern.compile("(?m)^(address\\s*=\\s*)\"[^\"]*\"");
    private static final Pattern ENDED = Pattern.compile(".* overtaken=(\\d+) .*");

    private final LabOptions options;
    private final Timeline timeline;
    private final Member dispatcher;
    private final Member tanks;
    private final Member panel;
    private String address;
    private String page;

    Laboratory(LabOptions options, Timeline timeline) {
        this.options = options;
        this.timeline = timeline;
        dispatcher = new Member("dispatcher", "the dispatcher", log("dispatcher.log"));
        tanks = new Member("TANKS", "TANKS", log("tanks.log"));
        panel = new Member("PANEL", "PANEL", log("panel.log"));
    }

    private String longest() {
        return options.page() ? LONGEST_WITH_PAGE : LONGEST;
    }

    /** The address of the patch bay; null without it. */
    String page() {
        return page;
    }

    private Path log(String name) {
        return options.report().resolveSibling(name);
    }

    private List<Member> members() {
        return List.of(tanks, panel, dispatcher);
    }

    /** Starts the dispatcher with an empty patch on a free port, and writes its address into the driver's file. */
    void open() {
        Path patch = log("patch.toml");
        Path cfg = options.drivers().resolve("board.cfg");
        try {
            Files.deleteIfExists(patch);
            List<String> command = new ArrayList<>(List.of(options.tickbus().toString(), "dispatch", "--listen",
                    "127.0.0.1:0", "--patch", patch.toString(), "--duration", longest()));
            if (options.page()) {
                command.addAll(List.of("--page", "127.0.0.1:0"));
            }
            dispatcher.start(command);
            long limit = System.nanoTime() + LISTENING_NANOS;
            while (address == null || (options.page() && page == null)) {
                dispatcher.check();
                dispatcher.listen();
                address = dispatcher.said("dispatch: listening on ");
                page = dispatcher.said("dispatch: page at ");
                if (System.nanoTime() - limit > 0) {
                    throw new DemoFailure("the dispatcher does not listen at any address");
                }
                LockSupport.parkNanos(2_000_000);
            }
            Matcher line = ADDRESS.matcher(Files.readString(cfg));
            if (!line.find()) {
                throw new DemoFailure(cfg + " has no line with an address");
            }
            Files.writeString(cfg, line.replaceFirst("$1\"" + address + "\""));
        } catch (IOException e) {
            throw new DemoFailure("the laboratory cannot be set up: " + e);
        }
        timeline.add(0, "operator", "the dispatcher listens on " + address);
    }

    Member tanks() {
        return tanks;
    }

    Member panel() {
        return panel;
    }

    /**
     * Starts a controller.
     *
     * @param member the controller
     * @param patched true if it requests its connections; otherwise it has those that the dispatcher remembers
     */
    void start(Member member, boolean patched) {
        String file = member.name().toLowerCase(Locale.ROOT);
        List<String> command = new ArrayList<>(List.of(options.tickbus().toString(), "logo",
                options.programs().resolve(file + ".toml").toString(), "--name", member.name(), "--dispatcher", address,
                "--duration", longest()));
        if (patched) {
            command.addAll(List.of("--patch", options.programs().resolve(file + ".patch").toString()));
        }
        member.start(command);
    }

    /** Adds to the timeline the output of all processes since the last call. */
    void listen(long now) {
        for (Member member : members()) {
            member.listen().forEach(line -> timeline.add(now, member.name(), line.substring(line.indexOf(": ") + 2)));
        }
    }

    void check() {
        members().forEach(Member::check);
    }

    /**
     * Ends all processes, the dispatcher last.
     *
     * @return the number of values replaced by newer ones because their client did not read
     * @throws DemoFailure if a process did not end properly
     */
    int end() {
        close();
        for (Member member : List.of(tanks, panel)) {
            if (member.said("logo: ok ") == null) {
                throw new DemoFailure(member.name() + " did not end with an ok line");
            }
        }
        String last = dispatcher.said("dispatch: ok ");
        Matcher ended = ENDED.matcher(last == null ? "" : last);
        if (!ended.matches()) {
            throw new DemoFailure("the dispatcher did not end with an ok line");
        }
        return Integer.parseInt(ended.group(1));
    }

    @Override
    public void close() {
        members().forEach(Member::close);
    }
}
