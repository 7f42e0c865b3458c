package tickbus.petri.control;

import java.util.HashSet;
import java.util.List;
import java.util.Set;
import tickbus.petri.net.Arc;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.net.Transition;

/**
 * Makes one net of several, for analysis: nodes are named {@code net.node}, and each {@link BoundNet#marked} and {@link
 * BoundNet#unmarked} is a test or an inhibitor arc. A behaviour that the composition cannot have, the nets of one controller
 * cannot have together. Conditions on signals are left out, as in analysis.
 */
public final class Composition {
    private Composition() {
    }

    /**
     * The nets as one.
     *
     * @param name of the whole
     * @param nets as given to a controller
     * @throws BindingException if the nets refer to missing nets or nodes
     */
    public static PetriNet of(String name, BoundNet... nets) {
        Check.nets(List.of(nets));
        NetBuilder whole = PetriNet.named(name);
        for (BoundNet one : nets) {
            places(whole, one.net);
        }
        for (BoundNet one : nets) {
            for (Transition transition : one.net.transitions()) {
                whole.transition(in(one.net, transition.name())).priority(transition.priority()).delay(transition.delay());
                one.net.arcs().stream().filter(arc -> arc.transition() == transition.index())
                    .forEach(arc -> arc(whole, one.net, arc));
                Set<String> seen = new HashSet<>();
                for (Term term : one.conditions.getOrDefault(transition.name(), List.of())) {
                    String place = term.name() + "." + term.place();
                    if (term.kind().isOfPlace() && seen.add(term.kind() + place)) {
                        if (term.kind() == Term.Kind.MARKED) {
                            whole.test(place, 1);
                        } else {
                            whole.inhibitor(place, 1);
                        }
                    }
                }
            }
        }
        return whole.build();
    }

    private static String in(PetriNet net, String node) {
        return net.name() + "." + node;
    }

    private static void places(NetBuilder whole, PetriNet net) {
        for (Place place : net.places()) {
            whole.place(in(net, place.name()), place.initial()).delay(place.delay());
            if (place.isLimited()) {
                whole.capacity(place.capacity());
            }
        }
    }

    private static void arc(NetBuilder whole, PetriNet net, Arc arc) {
        String place = in(net, net.place(arc.place()).name());
        switch (arc.kind()) {
            case INPUT -> whole.input(place, arc.weight());
            case OUTPUT -> whole.output(place, arc.weight());
            case TEST -> whole.test(place, arc.weight());
            case INHIBITOR -> whole.inhibitor(place, arc.weight());
        }
    }
}
