package tickbus.petri.command;

import java.io.IOException;
import java.io.InputStream;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.InvalidPathException;
import java.nio.file.NoSuchFileException;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Locale;
import tickbus.petri.draw.Dot;
import tickbus.petri.draw.NetSvg;
import tickbus.petri.format.Dialect;
import tickbus.petri.format.Lola;
import tickbus.petri.format.Pnml;
import tickbus.petri.format.Tina;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;

/** The command of this jar; see {@code --help}. Exit codes: 0 done, 1 the input was wrong, 2 the command line was wrong. */
public final class Main {
    private static final int OK = 0;
    private static final int WRONG = 1;
    private static final int USAGE = 2;
    private static final List<String> FORMATS = List.of("svg", "dot", "pnml", "tapaal", "prom", "woped", "pipe", "lola", "tina", "sfc",
        "plcopen");
    private static final String HELP = """
        usage: java -jar tickbus-petri.jar step NET [options]      go through a net step by step
               java -jar tickbus-petri.jar analyse NET [options]   what can be proven about it
               java -jar tickbus-petri.jar draw NET [options]      as a drawing, or in another format

        NET is a file in PNML (also that of TAPAAL, ProM, pm4py, WoPeD and PIPE), a .lola file of LoLA, a .net file
        of TINA, a .hpx file of HPSim, the text that HPSim exports, or a sequential function chart in the text of
        IEC 61131-3 (.st, .sfc) or in PLCopen XML (.xml), of which these commands see steps and transitions alone.

        step:
          --seed N           of chance and of random delays (default 0)
          --page [HOST:PORT] shows the net live in a browser (default 127.0.0.1, any port)
          Says what can fire, and reads what shall be done from its input: 'help' lists that. Where the input
          is no terminal, the first mistake in it ends everything with exit code 1.
        analyse:
          --limit N          the most markings to explore (default 1000000)
          --require LIST     exit code 1 unless all of these are proven: bounded, safe, live, deadlock-free, reversible
        draw:
          --as FORMAT        svg (default), dot, pnml, or for a tool: tapaal, prom, woped, pipe, lola, tina;
                             as a sequential function chart: sfc (text), plcopen (XML)
          --out FILE         into this file (default: standard output)
        all:
          --unit TIME        the unit of time in a .hpx or .net file, read or written (default 1ms)
          --delay NAME=TIME  a delay for HPSim's text, which has none: NAME=2s, NAME=exp 2s, NAME=1s..3s

        Times are numbers with a unit: 500us, 2ms, 1.5s. Exit codes: 0 done, 1 the input was wrong, 2 the
        command line was wrong.
        """;

    private Main() {
    }

    /**
     * Runs the command and ends the JVM with its exit code.
     *
     * @param args the command line
     */
    public static void main(String[] args) {
        PrintStream out = new PrintStream(System.out, true, StandardCharsets.UTF_8);
        PrintStream err = new PrintStream(System.err, true, StandardCharsets.UTF_8);
        System.exit(run(args, System.in, out, err));
    }

    /**
     * Runs the command.
     *
     * @param args the command line
     * @param in the input of {@code step}
     * @param out gets results
     * @param err gets error messages
     * @return the exit code
     */
    public static int run(String[] args, InputStream in, PrintStream out, PrintStream err) {
        List<String> words = List.of(args);
        if (words.contains("--help") || words.contains("-h")) {
            out.print(HELP);
            return OK;
        }
        try {
            if (words.isEmpty()) {
                throw new UsageException("there is no command; expected step, analyse or draw");
            }
            List<String> rest = words.subList(1, words.size());
            return switch (words.get(0)) {
                case "step" -> step(line(rest, "--seed", "--page"), in, out, err);
                case "analyse", "analyze" -> analyse(line(rest, "--limit", "--require"), out, err);
                case "draw" -> draw(line(rest, "--as", "--out"), out, err);
                default -> throw new UsageException("there is no command '" + words.get(0) + "'; there are step, analyse and draw");
            };
        } catch (UsageException e) {
            err.println(e.getMessage() + "\n");
            err.print(HELP);
            return USAGE;
        } catch (NoSuchFileException e) {
            err.println(e.getFile() + ": there is no such file");
        } catch (IOException e) {
            err.println(e.getMessage() == null ? e.toString() : e.getMessage());
        } catch (NetException | IllegalArgumentException | IllegalStateException e) {
            err.println(e.getMessage());
        }
        return WRONG;
    }

    private static CommandLine line(List<String> words, String... own) {
        List<String> known = new ArrayList<>(List.of(own));
        known.addAll(NetFile.OPTIONS);
        return new CommandLine(words, known);
    }

    private static int step(CommandLine line, InputStream in, PrintStream out, PrintStream err) throws IOException {
        long seed = line.number("--seed", 0, Long.MIN_VALUE, Long.MAX_VALUE);
        String page = line.has("--page") ? line.one("--page", "") : null;
        PetriNet net = NetFile.read(line, err);
        return new StepDialog(net, seed, out, err).run(in, page) ? OK : WRONG;
    }

    private static int analyse(CommandLine line, PrintStream out, PrintStream err) throws IOException {
        int limit = (int) line.number("--limit", 1_000_000, 1, Integer.MAX_VALUE);
        List<String> required = Analysis.required(line.one("--require", ""));
        Analysis analysis = new Analysis(NetFile.read(line, err), limit, out);
        List<String> unproven = analysis.run(required);
        unproven.forEach(what -> err.println(line.file() + ": not proven to be " + what));
        return unproven.isEmpty() ? OK : WRONG;
    }

    private static int draw(CommandLine line, PrintStream out, PrintStream err) throws IOException {
        String as = line.one("--as", "svg");
        if (!FORMATS.contains(as)) {
            throw new UsageException("--as " + as + ": expected one of " + String.join(", ", FORMATS));
        }
        String text = switch (as) {
            case "sfc" -> NetFile.chart(line, err).text();
            case "plcopen" -> NetFile.chart(line, err).plcopen();
            default -> text(as, NetFile.read(line, as.equals("tina"), err), line);
        };
        String file = line.one("--out", null);
        if (file == null) {
            out.print(text);
        } else {
            write(file, text);
            out.println("wrote " + file);
        }
        return OK;
    }

    private static String text(String as, PetriNet net, CommandLine line) {
        return switch (as) {
            case "svg" -> NetSvg.write(net);
            case "dot" -> Dot.write(net);
            case "pnml" -> Pnml.write(net);
            case "lola" -> Lola.write(net);
            case "tina" -> Tina.write(net, NetFile.unit(line));
            default -> Pnml.write(net, Dialect.valueOf(as.toUpperCase(Locale.ROOT)));
        };
    }

    /** Writes a text to a file; an exception names the file. */
    static void write(String file, String text) throws IOException {
        try {
            Files.writeString(Path.of(file), text);
        } catch (InvalidPathException e) {
            throw new IOException("'" + file + "' is no name of a file: " + e.getMessage(), e);
        } catch (NoSuchFileException e) {
            throw new IOException(file + " cannot be written: there is no such folder", e);
        } catch (IOException e) {
            throw new IOException(file + " cannot be written: " + e, e);
        }
    }
}
