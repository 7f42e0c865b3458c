package tickbus.petri.control;

import java.util.ArrayList;
import java.util.HashMap;
import java.util.List;
import java.util.Map;
import java.util.TreeMap;
import java.util.stream.Collectors;
import tickbus.Signal;
import tickbus.Tickbus;

/** Finds mismatches between nets, and between them and a driver. */
final class Check {
    private final Map<String, BoundNet> nets = new HashMap<>();
    private final List<String> mistakes = new ArrayList<>();

    private Check(List<BoundNet> list) {
        if (list.isEmpty()) {
            mistakes.add("there is no net; expected one or more");
        }
        for (BoundNet one : list) {
            if (nets.put(one.net.name(), one) != null) {
                mistakes.add("two nets are named '" + one.net.name() + "'; give each a name of its own");
            }
        }
        for (BoundNet one : list) {
            one.mistakes.forEach(mistake -> add(one, mistake));
            nodes(one);
        }
    }

    /** Throws a {@link BindingException} if the nets do not fit each other. */
    static Map<String, BoundNet> nets(List<BoundNet> list) {
        return new Check(list).end();
    }

    /** Throws a {@link BindingException} if the nets do not fit each other or the driver. */
    static Map<String, BoundNet> nets(Tickbus bus, List<BoundNet> list) {
        Check check = new Check(list);
        check.driver(bus);
        list.forEach(one -> check.signals(bus, one));
        check.owners(list);
        return check.end();
    }

    private Map<String, BoundNet> end() {
        if (!mistakes.isEmpty()) {
            throw new BindingException(mistakes);
        }
        return nets;
    }

    private void add(BoundNet of, String mistake) {
        mistakes.add("net " + of.net.name() + ": " + mistake);
    }

    private void nodes(BoundNet one) {
        one.conditions.forEach((transition, terms) -> {
            find(() -> one.net.transition(transition));
            for (Term term : terms) {
                if (term.kind().isOfPlace()) {
                    BoundNet other = nets.get(term.name());
                    if (other == null) {
                        add(one, "transition " + transition + ": there is no net '" + term.name() + "'; there are "
                            + nets.keySet().stream().sorted().toList());
                    } else if (other == one && term.kind() != Term.Kind.MARKED_FOR) {
                        add(one, "transition " + transition + ": place " + term.place() + " is of this net; draw a test or "
                            + "an inhibitor arc, or say for how long by atLeast(...)");
                    } else {
                        find(() -> other.net.place(term.place()));
                    }
                }
            }
        });
        for (Step step : one.steps) {
            if (step.moment() == Step.Moment.FIRING) {
                find(() -> one.net.transition(step.node()));
            } else {
                find(() -> one.net.place(step.node()));
            }
        }
    }

    private void find(Runnable lookUp) {
        try {
            lookUp.run();
        } catch (IllegalArgumentException e) {
            mistakes.add(e.getMessage());
        }
    }

    private void driver(Tickbus bus) {
        // A controller writes %Q.
        if (bus.signals().stream().anyMatch(signal -> signal.isWritten() == signal.address().startsWith("%I"))) {
            mistakes.add("driver '" + bus.name() + "' is the machine's end; nets need role = \"controller\" in [fieldbus]");
        }
        if (!"0".equals(bus.statistics().getOrDefault("ticks", "0"))) {
            mistakes.add("driver '" + bus.name() + "' has ticked already; bind the nets before, while its outputs still have"
                + " their fail-safe values");
        }
    }

    private void signals(Tickbus bus, BoundNet one) {
        one.conditions.forEach((transition, terms) -> terms.stream()
            .filter(term -> !term.kind().isOfPlace() && term.kind() != Term.Kind.CODE)
            .forEach(term -> signal(bus, one, "transition " + transition, term.name(), false)));
        one.steps.stream().filter(step -> step.output() != null)
            .forEach(step -> signal(bus, one, step.where(), step.output(), true));
        one.declared.forEach(name -> signal(bus, one, "writes", name, true));
        one.steps.stream().filter(step -> step.output() != null && step.moment() == Step.Moment.DURING)
            .filter(step -> one.steps.stream().anyMatch(other -> other.moment() != Step.Moment.DURING
                && step.output().equals(other.output())) || one.declared.contains(step.output()))
            .map(Step::output).distinct()
            .forEach(output -> add(one, "output '" + output + "' is set during a place and also by an entry, an exit, "
                + "a firing or code of your own; do it in one way"));
        one.steps.stream().filter(step -> !Double.isFinite(step.value()))
            .forEach(step -> add(one, step.where() + ": output '" + step.output() + "' is set to " + step.value()
                + "; a finite number is needed"));
    }

    private void signal(Tickbus bus, BoundNet one, String where, String name, boolean output) {
        Signal signal;
        try {
            signal = bus.signal(name);
        } catch (IllegalArgumentException e) {
            add(one, where + ": " + e.getMessage());
            return;
        }
        if (signal.isWritten() != output) {
            add(one, where + ": signal '" + name + "' at " + signal.address() + (output
                ? " is an input; an action sets what this end writes"
                : " is an output; a condition looks at what this end reads"));
        }
    }

    private void owners(List<BoundNet> list) {
        Map<String, List<BoundNet>> owners = list.stream()
            .flatMap(one -> one.outputs().stream().map(output -> Map.entry(output, one)))
            .collect(Collectors.groupingBy(Map.Entry::getKey, TreeMap::new,
                Collectors.mapping(Map.Entry::getValue, Collectors.toList())));
        owners.forEach((output, by) -> {
            if (by.size() > 1) {
                mistakes.add("output '" + output + "' is written by the nets "
                    + by.stream().map(one -> one.net.name()).collect(Collectors.joining(" and "))
                    + "; let one write it, and the other tell that one by a place");
            }
        });
    }
}
