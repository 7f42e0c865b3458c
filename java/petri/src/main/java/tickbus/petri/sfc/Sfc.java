package tickbus.petri.sfc;

import java.io.IOException;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;

/**
 * A sequential function chart as a Petri net: a step is a place, a transition a transition. The conditions and actions are
 * those of the program; {@link #start} runs them as a PLC does.
 */
public final class Sfc {
    private static final long MOST_BYTES = 16L << 20;

    private final PetriNet net;
    final List<Variable> variables;
    final List<Value> conditions;
    final List<Association> associations;
    final List<Action> actions;
    final Source source;

    /**
     * An action.
     *
     * @param variable the index of the variable that it sets; -1 for an action with statements
     * @param body the statements; null for a variable
     */
    record Action(int variable, Statement body) {
    }

    /**
     * The parts of the text that a run does not need, for writing.
     *
     * @param kind {@code PROGRAM} or {@code FUNCTION_BLOCK}
     * @param blocks the words before each variable's block, such as {@code VAR RETAIN}
     * @param conditions the expression of each transition
     * @param names the name of each action
     * @param bodies the statements of each action; empty for a variable
     */
    record Source(String kind, List<String> blocks, List<String> conditions, List<String> names, List<String> bodies) {
    }

    Sfc(PetriNet net, List<Variable> variables, List<Value> conditions, List<Association> associations, List<Action> actions,
            Source source) {
        this.net = net;
        this.variables = List.copyOf(variables);
        this.conditions = List.copyOf(conditions);
        this.associations = List.copyOf(associations);
        this.actions = List.copyOf(actions);
        this.source = source;
    }

    /**
     * Reads the first program or function block of a file in IEC 61131-3 text, which must be a chart, or the first chart of a
     * file in PLCopen XML.
     *
     * @throws NetException with file, line and column for what cannot be read
     */
    public static Sfc read(Path file) throws IOException {
        long size = Files.size(file);
        if (size > MOST_BYTES) {
            throw new NetException(file.toString(), 0, "", size + " bytes; expected at most " + MOST_BYTES);
        }
        byte[] bytes = Files.readAllBytes(file);
        if (isXml(bytes)) {
            return new SfcReader(PlcopenReader.read(file.toString(), bytes)).read();
        }
        return parse(file.toString(), new String(bytes, StandardCharsets.UTF_8));
    }

    /** True if the first sign behind the marks and blanks is that of XML, in any encoding. */
    private static boolean isXml(byte[] bytes) {
        for (byte one : bytes) {
            if (one == '<') {
                return true;
            }
            // Marks of the byte order are negative, and the other half of a sign in UTF-16 is 0.
            if (one > ' ') {
                return false;
            }
        }
        return false;
    }

    /** Reads a text, as {@link #read}; {@code name} is for messages. */
    public static Sfc parse(String name, String text) {
        return text.strip().startsWith("<") ? new SfcReader(PlcopenReader.read(name, text.getBytes(StandardCharsets.UTF_8))).read()
            : new SfcReader(new Words(name, text)).read();
    }

    /**
     * A net as a chart, whose transitions have no condition but the net's: a delay becomes a condition on the time of the steps
     * before the transition, a test or inhibitor arc one on the step's flag. Of conflicting transitions with one priority, the
     * first one wins. In a scan each transition fires at most once.
     *
     * @throws NetException with each part of the net that a chart does not have; the chart must also be proven to be safe
     */
    public static Sfc of(PetriNet net) {
        return new NetChart(net).chart();
    }

    /** The chart as IEC 61131-3 text, without comments; a program has a configuration with a task of 20 ms. */
    public String text() {
        return new SfcWriter(this).text();
    }

    /** The chart as a project in PLCopen XML, drawn from top to bottom, as Beremiz and OpenPLC Editor open it. */
    public String plcopen() {
        return new PlcopenWriter(this).text();
    }

    /** The net. Of two transitions that can fire, the one with the smaller {@code PRIORITY}, or else the first one, has the greater priority. */
    public PetriNet net() {
        return net;
    }

    /** The variables, in the order of the program. */
    public List<Variable> variables() {
        return variables;
    }

    /** A run from the initial steps and values. */
    public SfcController start() {
        return new SfcController(this);
    }
}
