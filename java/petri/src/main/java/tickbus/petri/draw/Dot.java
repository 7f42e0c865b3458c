package tickbus.petri.draw;

import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.Marking;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.net.Transition;

/** Writes nets for Graphviz. */
public final class Dot {
    private Dot() {
    }

    /** The net with its initial marking. */
    public static String write(PetriNet net) {
        return write(net, net.initialMarking());
    }

    /** The net with a marking: circles with tokens, bars, and arcs with dots (inhibitor) or dashes (test). */
    public static String write(PetriNet net, Marking marking) {
        StringBuilder out = new StringBuilder("digraph ").append(quoted(net.name())).append(" {\n  rankdir=LR;\n");
        for (Place place : net.places()) {
            int tokens = marking.get(place.index());
            out.append("  p").append(place.index()).append(" [shape=circle, label=")
                .append(quoted(tokens == 0 ? "" : tokens == 1 ? "•" : Integer.toString(tokens)))
                .append(", xlabel=").append(quoted(place.name())).append("];\n");
        }
        for (Transition transition : net.transitions()) {
            out.append("  t").append(transition.index())
                .append(" [shape=box, width=0.1, label=\"\", style=filled, fillcolor=")
                .append(transition.delay().kind() == Delay.Kind.NONE ? "black" : "white")
                .append(", xlabel=").append(quoted(transition.name())).append("];\n");
        }
        for (Arc arc : net.arcs()) {
            String place = "p" + arc.place();
            String transition = "t" + arc.transition();
            boolean output = arc.kind() == ArcKind.OUTPUT;
            out.append("  ").append(output ? transition : place).append(" -> ").append(output ? place : transition);
            String style = switch (arc.kind()) {
                case INHIBITOR -> "arrowhead=odot";
                case TEST -> "style=dashed";
                case INPUT, OUTPUT -> "";
            };
            String weight = arc.weight() > 1 ? "label=" + quoted(Integer.toString(arc.weight())) : "";
            String both = style + (style.isEmpty() || weight.isEmpty() ? "" : ", ") + weight;
            out.append(both.isEmpty() ? "" : " [" + both + "]").append(";\n");
        }
        return out.append("}\n").toString();
    }

    private static String quoted(String text) {
        return '"' + text.replace("\\", "\\\\").replace("\"", "\\\"").replace("\n", " ") + '"';
    }
}
