package tickbus.petri.control;

import java.util.List;
import java.util.Map;
import java.util.function.Function;
import tickbus.petri.run.Condition;
import tickbus.petri.run.Conjunction;
import tickbus.petri.run.Coordinator;
import tickbus.petri.run.Inputs;

/** The terms of one transition's condition, with their indices looked up; all must hold. */
final class Conditions implements Conjunction {
    private final Latch latch;
    private final Term.Kind[] kinds;
    private final int[] index;
    private final double[] value;
    private final Condition[] code;
    private final Map<String, Coordinator> coordinators;
    private final String[] nets;
    private final Coordinator[] others;
    private final String net;
    private Coordinator own;
    private final List<Part> parts;
    private int failed = -1;

    /**
     * Binds terms.
     *
     * @param net the name of the transition's own net
     * @param nets finds a net whose coordinator is built later
     * @param coordinators has the coordinators from then on
     */
    Conditions(String net, List<Term> terms, Latch latch, Function<String, BoundNet> nets, Map<String, Coordinator> coordinators) {
        this.net = net;
        this.latch = latch;
        this.coordinators = coordinators;
        parts = terms.stream().map(Term::part).toList();
        int count = terms.size();
        kinds = new Term.Kind[count];
        index = new int[count];
        value = new double[count];
        code = new Condition[count];
        this.nets = new String[count];
        others = new Coordinator[count];
        for (int i = 0; i < count; i++) {
            Term term = terms.get(i);
            kinds[i] = term.kind();
            value[i] = term.value();
            code[i] = term.code();
            if (term.kind().isOfPlace()) {
                this.nets[i] = term.name();
                index[i] = nets.apply(term.name()).net.place(term.place()).index();
            } else if (term.kind() != Term.Kind.CODE) {
                index[i] = latch.names.indexOf(term.name());
            }
        }
    }

    /** Called when all coordinators are built. */
    void connect() {
        own = coordinators.get(net);
        for (int i = 0; i < nets.length; i++) {
            others[i] = nets[i] == null ? null : coordinators.get(nets[i]);
        }
    }

    @Override
    public boolean test(Inputs inputs) {
        for (int i = 0; i < kinds.length; i++) {
            if (!holds(i, inputs)) {
                failed = i;
                return false;
            }
        }
        failed = -1;
        return true;
    }

    @Override
    public List<Part> parts() {
        return parts;
    }

    @Override
    public int failed() {
        return failed;
    }

    private boolean holds(int i, Inputs inputs) {
        int at = index[i];
        return switch (kinds[i]) {
            case ON -> latch.now[at] != 0;
            case OFF -> latch.now[at] == 0;
            case RISING -> latch.now[at] != 0 && latch.before[at] == 0;
            case FALLING -> latch.now[at] == 0 && latch.before[at] != 0;
            case AT_LEAST -> latch.now[at] >= value[i];
            case BELOW -> latch.now[at] < value[i];
            case EQUAL -> latch.now[at] == value[i];
            case MARKED -> others[i].tokens(at) > 0;
            case MARKED_FOR -> others[i].tokens(at) > 0 && others[i].scans() > 0
                && own.nanos() - others[i].markedSince(at) >= value[i];
            case UNMARKED -> others[i].tokens(at) == 0;
            case CODE -> code[i].test(inputs);
        };
    }
}
