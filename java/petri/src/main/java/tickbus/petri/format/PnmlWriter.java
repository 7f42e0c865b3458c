package tickbus.petri.format;

import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.net.Transition;

/** Writes a net as PNML, on one page. */
final class PnmlWriter {
    private PnmlWriter() {
    }

    static String write(PetriNet net) {
        StringBuilder out = new StringBuilder();
        out.append("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<pnml xmlns=\"").append(Pnml.NAMESPACE)
            .append("\">\n  <net id=\"net\" type=\"").append(Pnml.TYPE).append("\">\n    ");
        name(out, net.name());
        out.append("\n    <page id=\"page\">\n");
        for (Place place : net.places()) {
            out.append("      <place id=\"p").append(place.index()).append("\">");
            name(out, place.name());
            graphics(out, net, place.index());
            if (place.initial() > 0) {
                out.append("<initialMarking><text>").append(place.initial()).append("</text></initialMarking>");
            }
            String own = (place.isLimited() ? "<capacity>" + place.capacity() + "</capacity>" : "")
                + (place.delay() > 0 ? "<delay>" + place.delay() + "</delay>" : "");
            tool(out, own);
            out.append("</place>\n");
        }
        for (Transition transition : net.transitions()) {
            out.append("      <transition id=\"t").append(transition.index()).append("\">");
            name(out, transition.name());
            graphics(out, net, net.places().size() + transition.index());
            Delay delay = transition.delay();
            String own = (transition.priority() != 0 ? "<priority>" + transition.priority() + "</priority>" : "")
                + (delay.kind() != Delay.Kind.NONE ? "<delay>" + delay.kind() + " " + delay.first() + " "
                    + delay.second() + "</delay>" : "");
            tool(out, own);
            out.append("</transition>\n");
        }
        int number = 0;
        for (Arc arc : net.arcs()) {
            boolean output = arc.kind() == ArcKind.OUTPUT;
            String place = "p" + arc.place();
            String transition = "t" + arc.transition();
            out.append("      <arc id=\"a").append(number++).append("\" source=\"").append(output ? transition : place)
                .append("\" target=\"").append(output ? place : transition);
            String type = switch (arc.kind()) {
                case TEST -> "test";
                case INHIBITOR -> "inhibitor";
                default -> null;
            };
            out.append(type == null ? "\">" : "\" type=\"" + type + "\">");
            net.positions().map(all -> all.bends(arc)).filter(bends -> bends.length > 0)
                .ifPresent(bends -> positions(out, bends));
            if (arc.weight() > 1) {
                out.append("<inscription><text>").append(arc.weight()).append("</text></inscription>");
            }
            if (type != null) {
                out.append("<type value=\"").append(type).append("\"/><arctype><text>").append(type).append("</text></arctype>");
            }
            out.append("</arc>\n");
        }
        return out.append("    </page>\n  </net>\n</pnml>\n").toString();
    }

    private static void name(StringBuilder out, String name) {
        out.append("<name><text>").append(escaped(name)).append("</text></name>");
    }

    private static void graphics(StringBuilder out, PetriNet net, int node) {
        net.positions().ifPresent(all -> positions(out, new double[] {all.x(node), all.y(node)}));
    }

    private static void positions(StringBuilder out, double[]... points) {
        out.append("<graphics>");
        for (double[] point : points) {
            out.append("<position x=\"").append(point[0]).append("\" y=\"").append(point[1]).append("\"/>");
        }
        out.append("</graphics>");
    }

    private static void tool(StringBuilder out, String own) {
        if (!own.isEmpty()) {
            out.append("<toolspecific tool=\"").append(Pnml.TOOL).append("\" version=\"1\">").append(own)
                .append("</toolspecific>");
        }
    }

    private static String escaped(String text) {
        return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;");
    }
}
