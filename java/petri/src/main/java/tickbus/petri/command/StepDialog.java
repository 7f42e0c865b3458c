package tickbus.petri.command;

import java.io.BufferedReader;
import java.io.Console;
import java.io.IOException;
import java.io.InputStream;
import java.io.InputStreamReader;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.util.List;
import java.util.concurrent.locks.LockSupport;
import java.util.stream.Collectors;
import java.util.stream.Stream;
import tickbus.petri.draw.NetSvg;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Transition;
import tickbus.petri.page.NetPage;
import tickbus.petri.run.NetWatch;
import tickbus.petri.run.Stepper;

/** Steps through a net by the user's commands, line by line. */
final class StepDialog {
    private static final int MOST_LISTED = 20;
    private static final long OFFER_NANOS = 20_000_000;
    private static final String HELP = """
        NUMBER, NAME      fires this transition; 'fire NAME' if the name is also a word below
        run N             fires N transitions as chance has it; lets time pass where nothing else can happen
        run N every TIME  the same, slowly enough to be watched
        undo [N]          takes back the last step, or the last N
        wait [TIME]       lets time pass, as much as given, or until something is due
        marking           the places that have tokens
        why NAME          why this transition cannot fire
        list              all transitions that can fire, or that wait for their delay
        log [FILE]        the firings so far: their number, nanoseconds, transition
        draw FILE         the net with its marking, as SVG
        help              this text
        quit              ends, as the end of the input does
        """;

    private final PetriNet net;
    private final Stepper stepper;
    private final PrintStream out;
    private final PrintStream err;
    private boolean over;

    /** A request that is not possible. */
    private static final class Refusal extends RuntimeException {
        private static final long serialVersionUID = 1L;

        Refusal(String message) {
            super(message);
        }
    }

    StepDialog(PetriNet net, long seed, PrintStream out, PrintStream err) {
        this.net = net;
        this.out = out;
        this.err = err;
        stepper = new Stepper(net, seed);
    }

    /** Runs until the input ends; false if a line was wrong and no person was there to correct it. */
    boolean run(InputStream in, String page) throws IOException {
        if (page == null) {
            return converse(in);
        }
        NetWatch watch = NetWatch.of(List.of(stepper));
        try (NetPage shown = NetPage.open(page, "Net " + net.name() + ", step by step", watch)) {
            out.println("page at " + shown.address());
            Thread offering = new Thread(() -> {
                while (!Thread.currentThread().isInterrupted()) {
                    synchronized (stepper) {
                        watch.offer();
                    }
                    LockSupport.parkNanos(OFFER_NANOS);
                }
            }, "steps for the page");
            offering.setDaemon(true);
            offering.start();
            try {
                return converse(in);
            } finally {
                offering.interrupt();
            }
        }
    }

    private boolean converse(InputStream in) throws IOException {
        boolean person = in == System.in && isTerminal();
        out.println(net.toString().replaceFirst(", \\[.*", "") + (person ? "; 'help' lists what can be said" : ""));
        situation();
        BufferedReader lines = new BufferedReader(new InputStreamReader(in, StandardCharsets.UTF_8));
        for (int number = 1; !over; number++) {
            if (person) {
                out.print("> ");
                out.flush();
            }
            String line = lines.readLine();
            if (line == null) {
                if (person) {
                    out.println();
                }
                return true;
            }
            try {
                obey(line.strip());
            } catch (Refusal | IllegalArgumentException | IllegalStateException e) {
                err.println((person ? "" : "input:" + number + ": ") + e.getMessage());
                if (!person) {
                    return false;
                }
            }
        }
        return true;
    }

    /** From JDK 22 on, a console can exist although the input is a pipe, and says so. */
    private static boolean isTerminal() {
        Console console = System.console();
        try {
            return console != null && (boolean) Console.class.getMethod("isTerminal").invoke(console);
        } catch (NoSuchMethodException older) {
            return true;
        } catch (ReflectiveOperationException e) {
            return false;
        }
    }

    private void obey(String line) throws IOException {
        String word = line.split("\\s+", 2)[0];
        String rest = line.substring(word.length()).strip();
        switch (word) {
            case "" -> { }
            case "#" -> { }
            case "fire" -> fire(transition(rest));
            case "run" -> run(rest);
            case "undo" -> undo(rest);
            case "wait" -> pass(rest);
            case "marking" -> alone(rest, word, () -> out.println(stepper.marking()));
            case "why" -> why(transition(rest));
            case "list" -> alone(rest, word, () -> list(Integer.MAX_VALUE));
            case "log" -> write(rest, stepper.log());
            case "draw" -> {
                if (rest.isEmpty()) {
                    throw new Refusal("draw needs a file behind it, such as: draw net.svg");
                }
                write(rest, NetSvg.write(net, stepper.marking()));
            }
            case "help" -> alone(rest, word, () -> out.print(HELP));
            case "quit" -> alone(rest, word, () -> over = true);
            default -> fire(chosen(line));
        }
    }

    private static void alone(String rest, String word, Runnable what) {
        if (!rest.isEmpty()) {
            throw new Refusal("'" + word + "' stands alone; '" + rest + "' behind it was not expected");
        }
        what.run();
    }

    /** The transition by its number in the list, or else by its name. */
    private Transition chosen(String text) {
        List<Transition> ready = stepper.ready();
        if (text.matches("\\d{1,9}")) {
            int number = Integer.parseInt(text);
            if (number >= 1 && number <= ready.size()) {
                return ready.get(number - 1);
            }
            if (net.transitions().stream().noneMatch(one -> one.name().equals(text))) {
                throw new Refusal("there is no number " + text + "; " + (ready.isEmpty() ? "nothing can fire now"
                    : "expected 1 to " + ready.size()));
            }
        }
        if (net.transitions().stream().noneMatch(one -> one.name().equals(text))) {
            throw new Refusal("'" + text + "' is neither a transition nor a word of 'help'; the transitions are "
                + net.transitions().stream().limit(MOST_LISTED).map(Transition::name).collect(Collectors.joining(", "))
                + (net.transitions().size() > MOST_LISTED ? ", …" : ""));
        }
        return net.transition(text);
    }

    private Transition transition(String name) {
        if (name.isEmpty()) {
            throw new Refusal("the name of a transition is missing");
        }
        return net.transition(name);
    }

    private void fire(Transition transition) {
        synchronized (stepper) {
            stepper.fire(transition.index());
        }
        out.println("fired " + transition.name());
        situation();
    }

    private void run(String text) {
        String[] words = text.split("\\s+every\\s+", 2);
        int times = count(words[0], "run");
        long pause = words.length == 2 ? Times.nanos(words[1]) : 0;
        int done = 0;
        while (done < times) {
            int next;
            synchronized (stepper) {
                while ((next = stepper.choose()) < 0 && stepper.nextDue() != Long.MAX_VALUE) {
                    stepper.advance(stepper.nextDue() - stepper.time());
                }
                if (next < 0) {
                    break;
                }
                stepper.fire(next);
            }
            done++;
            if (pause > 0) {
                out.println("fired " + net.transition(next).name());
                LockSupport.parkNanos(pause);
            }
        }
        out.println(done + " fired" + (done < times ? "; then nothing could, and nothing waited for the time" : ""));
        situation();
    }

    private void undo(String text) {
        int times = text.isEmpty() ? 1 : count(text, "undo");
        int done;
        synchronized (stepper) {
            done = stepper.undo(times);
        }
        if (done == 0) {
            throw new Refusal("there is no step to take back");
        }
        out.println("took back " + done);
        situation();
    }

    private static int count(String text, String word) {
        if (!text.matches("[1-9]\\d{0,8}")) {
            throw new Refusal("'" + word + " " + text + "': expected a number from 1 on, such as: " + word + " 10");
        }
        return Integer.parseInt(text);
    }

    private void pass(String text) {
        synchronized (stepper) {
            if (text.isEmpty() && stepper.nextDue() == Long.MAX_VALUE) {
                throw new Refusal("nothing waits for the time; 'wait 2s' lets it pass anyway");
            }
            stepper.advance(text.isEmpty() ? stepper.nextDue() - stepper.time() : Times.nanos(text));
        }
        situation();
    }

    private void why(Transition transition) {
        List<String> obstacles = stepper.obstacles(transition.index());
        if (obstacles.isEmpty()) {
            out.println(transition.name() + " can fire");
        } else {
            obstacles.forEach(one -> out.println(transition.name() + ": " + one));
        }
    }

    private void write(String file, String text) throws IOException {
        if (file.isEmpty()) {
            out.print(text);
            return;
        }
        try {
            Main.write(file, text);
        } catch (IOException e) {
            throw new Refusal(e.getMessage());
        }
        out.println("wrote " + file);
    }

    private void situation() {
        out.println("time " + Delay.seconds(stepper.time()) + ", " + stepper.marking());
        list(MOST_LISTED);
    }

    private void list(int most) {
        List<Transition> ready = stepper.ready();
        int width = ready.stream().limit(most).mapToInt(one -> one.name().length()).max().orElse(0);
        for (int i = 0; i < Math.min(most, ready.size()); i++) {
            Transition one = ready.get(i);
            out.printf("%3d  %-" + Math.max(1, width) + "s  %s%n", i + 1, one.name(), effect(one));
        }
        List<Transition> waiting = net.transitions().stream().filter(one -> stepper.due(one.index()) != Long.MAX_VALUE).toList();
        waiting.stream().limit(most).forEach(one -> out.println("     " + one.name() + " in "
            + Delay.seconds(stepper.due(one.index()) - stepper.time())));
        int more = Math.max(0, ready.size() - most) + Math.max(0, waiting.size() - most);
        if (more > 0) {
            out.println("     … and " + more + " more, see 'list'");
        }
        if (ready.isEmpty() && waiting.isEmpty()) {
            out.println(stepper.nextDue() == Long.MAX_VALUE ? "     nothing can fire: this is a deadlock"
                : "     nothing can fire before tokens are available in " + Delay.seconds(stepper.nextDue() - stepper.time()));
        }
    }

    private String effect(Transition transition) {
        String from = ends(transition, ArcKind.INPUT);
        String to = ends(transition, ArcKind.OUTPUT);
        String priority = transition.priority() == 0 ? "" : ", priority " + transition.priority();
        return (from + " → " + to).strip() + priority;
    }

    private String ends(Transition transition, ArcKind kind) {
        Stream<Arc> arcs = net.arcs().stream().filter(arc -> arc.transition() == transition.index() && arc.kind() == kind);
        return arcs.map(arc -> (arc.weight() == 1 ? "" : arc.weight() + " × ") + net.place(arc.place()).name())
            .collect(Collectors.joining(" + "));
    }
}
