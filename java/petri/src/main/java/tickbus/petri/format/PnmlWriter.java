package tickbus.petri.format;

import java.util.List;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.net.Transition;

/** Writes a net as PNML, on one page. */
final class PnmlWriter {
    private final PetriNet net;
    private final Dialect dialect;
    private final boolean isPipe;
    private final StringBuilder out = new StringBuilder();

    PnmlWriter(PetriNet net, Dialect dialect) {
        this.net = net;
        this.dialect = dialect;
        isPipe = dialect == Dialect.PIPE;
    }

    String write() {
        List<Arc> arcs = switch (dialect) {
            case STANDARD, ANY -> net.arcs();
            case TAPAAL -> ForeignArcs.of(net, "TAPAAL", ForeignArcs.Has.INHIBITORS);
            case PROM -> ForeignArcs.of(net, "pm4py", ForeignArcs.Has.INHIBITORS_OF_1);
            case WOPED -> ForeignArcs.of(net, "WoPeD", ForeignArcs.Has.INPUTS_AND_OUTPUTS);
            case PIPE -> ForeignArcs.of(net, "PIPE", ForeignArcs.Has.INHIBITORS_AND_CAPACITIES);
        };
        boolean hasPage = dialect != Dialect.WOPED && !isPipe;
        out.append("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<pnml")
            .append(hasPage ? " xmlns=\"" + Pnml.NAMESPACE + "\"" : "").append(">\n  <net id=\"net\" type=\"").append(switch (dialect) {
                case PROM -> "http://www.pnml.org/version-2009/grammar/pnmlcoremodel";
                case WOPED -> "http://www.informatik.hu-berlin.de/top/pntd/ptNetb";
                case PIPE -> "P/T net";
                default -> Pnml.TYPE;
            }).append("\">\n    ");
        if (isPipe) {
            out.append("<token id=\"Default\" enabled=\"true\" red=\"0\" green=\"0\" blue=\"0\"/>");
        } else {
            label("name", net.name());
        }
        out.append(hasPage ? "\n    <page id=\"page\">\n" : "\n");
        net.places().forEach(this::place);
        net.transitions().forEach(this::transition);
        for (int i = 0; i < arcs.size(); i++) {
            arc(i, arcs.get(i));
        }
        return out.append(hasPage ? "    </page>\n" : "").append("  </net>\n</pnml>\n").toString();
    }

    private void place(Place place) {
        out.append("      <place id=\"p").append(place.index()).append("\">");
        label("name", place.name());
        graphics(place.index());
        if (place.initial() > 0) {
            label("initialMarking", tokens(place.initial()));
        }
        if (isPipe) {
            label("capacity", place.isLimited() ? Integer.toString(place.capacity()) : "0");
        }
        tool((place.isLimited() && dialect.compareTo(Dialect.ANY) <= 0 ? "<capacity>" + place.capacity() + "</capacity>" : "")
            + (place.delay() > 0 ? "<delay>" + place.delay() + "</delay>" : ""));
        out.append("</place>\n");
    }

    private void transition(Transition transition) {
        out.append("      <transition id=\"t").append(transition.index()).append("\">");
        label("name", transition.name());
        graphics(net.places().size() + transition.index());
        if (isPipe) {
            if (transition.priority() < 0) {
                throw new NetException("net " + net.name(), 0, "transition " + transition.name(), "priority " + transition.priority()
                    + "; PIPE's begin at 0");
            }
            label("timed", "false");
            label("priority", Integer.toString(transition.priority()));
        }
        Delay delay = transition.delay();
        tool((transition.priority() != 0 && !isPipe ? "<priority>" + transition.priority() + "</priority>" : "")
            + (delay.kind() != Delay.Kind.NONE ? "<delay>" + delay.kind() + " " + delay.first() + " " + delay.second()
                + "</delay>" : ""));
        out.append("</transition>\n");
    }

    private void arc(int number, Arc arc) {
        boolean output = arc.kind() == ArcKind.OUTPUT;
        String place = "p" + arc.place();
        String transition = "t" + arc.transition();
        out.append("      <arc id=\"a").append(number).append("\" source=\"").append(output ? transition : place)
            .append("\" target=\"").append(output ? place : transition).append('"');
        String type = switch (arc.kind()) {
            case TEST -> "test";
            case INHIBITOR -> "inhibitor";
            default -> "normal";
        };
        boolean isPlain = type.equals("normal");
        boolean standard = dialect == Dialect.STANDARD || dialect == Dialect.ANY;
        out.append(!isPlain && (standard || dialect == Dialect.TAPAAL) ? " type=\"" + type + "\">" : ">");
        net.positions().map(all -> all.bends(arc)).filter(bends -> bends.length > 0).ifPresent(bends -> positions(bends));
        if (arc.weight() > 1 || isPipe || dialect == Dialect.WOPED) {
            label("inscription", tokens(arc.weight()));
        }
        if (standard && !isPlain || isPipe) {
            out.append("<type value=\"").append(type).append("\"/>");
        }
        if (standard && !isPlain || dialect == Dialect.PROM) {
            label("arctype", type);
        }
        out.append("</arc>\n");
    }

    /** PIPE names the colour of its tokens. */
    private String tokens(int count) {
        return isPipe ? "Default," + count : Integer.toString(count);
    }

    private void label(String tag, String text) {
        String inner = isPipe ? "value" : "text";
        out.append('<').append(tag).append("><").append(inner).append('>').append(escaped(text)).append("</").append(inner)
            .append("></").append(tag).append('>');
    }

    private void graphics(int node) {
        net.positions().ifPresent(all -> positions(new double[] {all.x(node), all.y(node)}));
    }

    private void positions(double[]... points) {
        out.append("<graphics>");
        for (double[] point : points) {
            out.append("<position x=\"").append(point[0]).append("\" y=\"").append(point[1]).append("\"/>");
        }
        out.append("</graphics>");
    }

    private void tool(String own) {
        if (!own.isEmpty()) {
            out.append("<toolspecific tool=\"").append(Pnml.TOOL).append("\" version=\"1\">").append(own).append("</toolspecific>");
        }
    }

    private static String escaped(String text) {
        return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;");
    }
}
