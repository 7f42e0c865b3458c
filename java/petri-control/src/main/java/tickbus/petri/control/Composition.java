package tickbus.petri.control;

import java.util.HashSet;
import java.util.List;
import java.util.Set;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.net.PlaceStep;
import tickbus.petri.net.Transition;
import tickbus.petri.net.TransitionStep;

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
                TransitionStep made = whole.transition(in(one.net, transition.name()))
                    .priority(transition.priority()).delay(transition.delay());
                one.net.arcs().stream().filter(arc -> arc.transition() == transition.index())
                    .forEach(arc -> whole.arc(arc.kind(), in(one.net, one.net.place(arc.place()).name()),
                        in(one.net, transition.name()), arc.weight()));
                Set<String> seen = new HashSet<>();
                for (Term term : one.conditions.getOrDefault(transition.name(), List.of())) {
                    String place = term.name() + "." + term.place();
                    boolean isUnmarked = term.kind() == Term.Kind.UNMARKED;
                    if (term.kind().isOfPlace() && !needs(one.net, transition, term) && seen.add(isUnmarked + place)) {
                        if (isUnmarked) {
                            made.inhibitor(place, 1);
                        } else {
                            made.test(place, 1);
                        }
                    }
                }
            }
        }
        return whole.build();
    }

    /** True if an arc of the net itself needs the place. */
    private static boolean needs(PetriNet net, Transition transition, Term term) {
        return term.name().equals(net.name()) && net.arcs().stream().anyMatch(arc -> arc.transition() == transition.index()
            && arc.place() == net.place(term.place()).index() && (arc.kind() == ArcKind.INPUT || arc.kind() == ArcKind.TEST));
    }

    private static String in(PetriNet net, String node) {
        return net.name() + "." + node;
    }

    private static void places(NetBuilder whole, PetriNet net) {
        for (Place place : net.places()) {
            PlaceStep made = whole.place(in(net, place.name()), place.initial()).delay(place.delay());
            if (place.isLimited()) {
                made.capacity(place.capacity());
            }
        }
    }
}
