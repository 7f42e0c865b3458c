package tickbus.petri.format;

import java.util.stream.Collectors;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.net.Transition;

/** Writes nets as other tools write them, with everything around the net that they add. Independent of the library's writers. */
enum ForeignFiles {
    TAPAAL(".pnml", true, false) {
        @Override
        String write(PetriNet net) {
            StringBuilder out = new StringBuilder("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
                + "<pnml xmlns=\"http://www.pnml.org/version-2009/grammar/pnml\">\n<net id=\"ComposedModel\" "
                + "type=\"http://www.pnml.org/version-2009/grammar/ptnet\">\n<page id=\"page0\">\n");
            for (Place one : net.places()) {
                out.append("<place id=\"" + one.name() + "\"><graphics><position x=\"3\" y=\"4\" /></graphics><name><graphics>"
                    + "<offset x=\"0\" y=\"0\" /></graphics><text>" + one.name() + "</text></name><initialMarking><text>" + one.initial()
                    + "</text></initialMarking></place>\n");
            }
            for (Transition one : net.transitions()) {
                out.append("<transition id=\"" + one.name() + "\"><name><text>" + one.name() + "</text></name></transition>\n");
            }
            for (Arc arc : net.arcs()) {
                out.append("<arc" + ends(net, arc) + " type=\"" + (arc.kind() == ArcKind.INHIBITOR ? "inhibitor" : "normal") + "\">"
                    + "<inscription><text>" + arc.weight() + "</text></inscription></arc>\n");
            }
            return out.append("</page>\n<name><text>ComposedModel</text></name>\n</net></pnml>\n").toString();
        }
    },
    TAPAAL_PROJECT(".xml", true, false) {
        @Override
        String write(PetriNet net) {
            StringBuilder out = new StringBuilder("<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"no\"?>\n"
                + "<pnml xmlns=\"http://www.informatik.hu-berlin.de/top/pnml/ptNetb\">\n  <constant name=\"a\" value=\"5\"/>\n"
                + "  <net active=\"true\" id=\"TAPN1\" type=\"P/T net\">\n  <labels border=\"true\" height=\"9\" width=\"9\">note</labels>\n");
            String drawn = "positionX=\"30.0\" positionY=\"45.0\" nameOffsetX=\"-5.0\" nameOffsetY=\"35.0\"";
            for (Place one : net.places()) {
                out.append("<place id=\"" + one.name() + "\" initialMarking=\"" + one.initial() + "\" invariant=\"&lt; inf\" name=\"" + one.name()
                    + "\" markingOffsetX=\"0.0\" markingOffsetY=\"0.0\" " + drawn + "/>\n");
            }
            for (Transition one : net.transitions()) {
                out.append("<transition angle=\"0\" id=\"" + one.name() + "\" infiniteServer=\"false\" name=\"" + one.name() + "\" priority=\"0\" "
                    + "urgent=\"false\" " + drawn + "/>\n");
            }
            for (Arc arc : net.arcs()) {
                out.append("<arc" + ends(net, arc) + (arc.kind() == ArcKind.OUTPUT ? " inscription=\"1\" type=\"normal\""
                    : " inscription=\"[0,inf)\" type=\"" + (arc.kind() == ArcKind.INPUT ? "timed" : "tapnInhibitor") + "\"")
                    + " weight=\"" + arc.weight() + "\"><arcpath arcPointType=\"false\" id=\"0\" xCoord=\"1\" yCoord=\"2\"/></arc>\n");
            }
            return out.append("</net>\n<query active=\"true\" capacity=\"4\" name=\"q\" query=\"EF true\"/>\n<k-bound bound=\"3\"/>\n</pnml>\n")
                .toString();
        }
    },
    PROM(".pnml", true, false) {
        @Override
        String write(PetriNet net) {
            StringBuilder out = new StringBuilder("<?xml version='1.0' encoding='UTF-8'?>\n<pnml>\n  <net id=\"imdf\" "
                + "type=\"http://www.pnml.org/version-2009/grammar/pnmlcoremodel\">\n    <name>\n      <text>imdf</text>\n    </name>\n"
                + "    <page id=\"n0\">\n");
            for (Place one : net.places()) {
                out.append("<place id=\"" + one.name() + "\"><name><text>" + one.name() + "</text></name>" + (one.initial() == 0 ? ""
                    : "<initialMarking><text>" + one.initial() + "</text></initialMarking>") + "</place>\n");
            }
            for (Transition one : net.transitions()) {
                out.append("<transition id=\"" + one.name() + "\"><name><text>" + one.name() + "</text></name><toolspecific tool=\"ProM\" "
                    + "version=\"6.4\" activity=\"$invisible$\" localNodeID=\"" + one.index() + "\"/></transition>\n");
            }
            for (Arc arc : net.arcs()) {
                out.append("<arc" + ends(net, arc) + ">" + (arc.weight() == 1 ? "" : "<inscription><text>" + arc.weight() + "</text></inscription>")
                    + "<arctype><text>" + (arc.kind() == ArcKind.INHIBITOR ? "inhibitor" : "normal") + "</text></arctype></arc>\n");
            }
            return out.append("</page>\n<finalmarkings><marking><place idref=\"p0\"><text>1</text></place></marking></finalmarkings>\n"
                + "</net>\n</pnml>\n").toString();
        }
    },
    WOPED(".pnml", false, false) {
        @Override
        String write(PetriNet net) {
            StringBuilder out = new StringBuilder("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!--PLEASE DO NOT EDIT THIS FILE-->\n<pnml>\n"
                + "  <net type=\"http://www.informatik.hu-berlin.de/top/pntd/ptNetb\" id=\"noID\">\n");
            String drawn = "<graphics><position x=\"70\" y=\"110\"/><dimension x=\"40\" y=\"40\"/></graphics>";
            for (Place one : net.places()) {
                out.append("<place id=\"" + one.name() + "\"><name><text>" + one.name() + "</text><graphics><offset x=\"70\" y=\"150\"/></graphics>"
                    + "</name>" + drawn + (one.initial() == 0 ? "" : "<initialMarking><text>" + one.initial() + "</text></initialMarking>")
                    + "</place>\n");
            }
            for (Transition one : net.transitions()) {
                out.append("<transition id=\"" + one.name() + "\"><name><text>" + one.name() + "</text></name>" + drawn
                    + "<toolspecific tool=\"WoPeD\" version=\"1.0\"><time>0</time><timeUnit>1</timeUnit><orientation>1</orientation></toolspecific>"
                    + "</transition>\n");
            }
            for (Arc arc : net.arcs()) {
                // WoPeD gives ids of arcs again after some have been deleted.
                out.append("<arc" + ends(net, arc).replace("id=\"a1\"", "id=\"a0\"") + "><inscription><text>" + arc.weight() + "</text></inscription><graphics/>"
                    + "<toolspecific tool=\"WoPeD\" version=\"1.0\"><probability>1.0</probability></toolspecific></arc>\n");
            }
            return out.append("<toolspecific tool=\"WoPeD\" version=\"1.0\"><bounds><position x=\"2\" y=\"25\"/></bounds></toolspecific>\n"
                + "</net>\n</pnml>\n").toString();
        }
    },
    PIPE(".xml", true, true) {
        @Override
        String write(PetriNet net) {
            StringBuilder out = new StringBuilder("<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?><pnml>\n<net id=\"Net-One\" type=\"P/T net\">"
                + "<token id=\"Default\" enabled=\"true\" red=\"0\" green=\"0\" blue=\"0\"/>\n");
            for (Place one : net.places()) {
                out.append("<place id=\"" + one.name() + "\"><graphics><position x=\"615.0\" y=\"210.0\"/></graphics><name><value>" + one.name()
                    + "</value><graphics><offset x=\"0.0\" y=\"0.0\"/></graphics></name><initialMarking><value>Default," + one.initial()
                    + "</value><graphics/></initialMarking><capacity><value>" + (one.isLimited() ? one.capacity() : 0) + "</value></capacity></place>\n");
            }
            for (Transition one : net.transitions()) {
                out.append("<transition id=\"" + one.name() + "\"><name><value>" + one.name() + "</value></name><orientation><value>0</value>"
                    + "</orientation><rate><value>1.0</value></rate><timed><value>false</value></timed><infiniteServer><value>false</value>"
                    + "</infiniteServer></transition>\n");
            }
            for (Arc arc : net.arcs()) {
                out.append("<arc" + ends(net, arc) + "><graphics/><inscription><value>Default," + arc.weight() + "</value><graphics/></inscription>"
                    + "<tagged><value>false</value></tagged><arcpath id=\"000\" x=\"1\" y=\"2\" curvePoint=\"false\"/><type value=\""
                    + (arc.kind() == ArcKind.INHIBITOR ? "inhibitor" : "normal") + "\"/></arc>\n");
            }
            return out.append("</net></pnml>\n").toString();
        }
    },
    LOLA(".lola", false, false) {
        @Override
        String write(PetriNet net) {
            StringBuilder out = new StringBuilder("{ a net, PLACE by PLACE }\nPLACE\n  SAFE 7: ");
            out.append(net.places().stream().map(Place::name).limit(2).collect(Collectors.joining(",\n    "))).append(";\n  ");
            out.append(net.places().stream().skip(2).map(Place::name).collect(Collectors.joining(", ", "", ";\n")));
            out.append("MARKING // the beginning\n  ").append(net.places().stream().filter(one -> one.initial() > 0)
                .map(one -> one.name() + (one.initial() == 1 ? "" : ": " + one.initial())).collect(Collectors.joining(", "))).append(";\n");
            for (Transition one : net.transitions()) {
                out.append("TRANSITION ").append(one.name()).append(one.index() == 0 ? " WEAK FAIR" : "").append("\nCONSUME\n  ")
                    .append(list(net, one, ArcKind.INPUT, ":")).append(";\nPRODUCE ").append(list(net, one, ArcKind.OUTPUT, ":")).append(";\n");
            }
            return out.toString();
        }
    },
    TINA(".net", true, false) {
        @Override
        String write(PetriNet net) {
            StringBuilder out = new StringBuilder("#\n# net {of nets}\n\nnet {a \\{net\\}}\n");
            for (Transition one : net.transitions()) {
                String inhibitors = list(net, one, ArcKind.INHIBITOR, "?-").replace(",", " ");
                String tests = list(net, one, ArcKind.TEST, "?").replace(",", " ");
                out.append("tr ").append(one.name()).append(" : {label}").append(one.index() % 2 == 0 ? " [0,w[ " : " ")
                    .append(list(net, one, ArcKind.INPUT, "*").replace(",", " ")).append(' ').append(inhibitors).append(' ').append(tests)
                    .append(" -> ").append(list(net, one, ArcKind.OUTPUT, "*").replace(",", " ")).append('\n');
            }
            net.places().forEach(one -> out.append("pl {").append(one.name()).append("} (").append(one.initial()).append(")\n"));
            return out.append("lb p0 {a label}\n").toString();
        }
    };

    final String ending;
    final boolean hasInhibitors;
    final boolean hasCapacities;

    ForeignFiles(String ending, boolean hasInhibitors, boolean hasCapacities) {
        this.ending = ending;
        this.hasInhibitors = hasInhibitors;
        this.hasCapacities = hasCapacities;
    }

    abstract String write(PetriNet net);

    private static String ends(PetriNet net, Arc arc) {
        String place = net.place(arc.place()).name();
        String transition = net.transition(arc.transition()).name();
        boolean output = arc.kind() == ArcKind.OUTPUT;
        return " id=\"a" + net.arcs().indexOf(arc) + "\" source=\"" + (output ? transition : place) + "\" target=\"" + (output ? place : transition) + "\"";
    }

    private static String list(PetriNet net, Transition of, ArcKind kind, String sign) {
        return net.arcs().stream().filter(arc -> arc.transition() == of.index() && arc.kind() == kind)
            .map(arc -> net.place(arc.place()).name() + (arc.weight() == 1 && sign.equals("*") ? "" : sign + arc.weight()))
            .collect(Collectors.joining(","));
    }
}
