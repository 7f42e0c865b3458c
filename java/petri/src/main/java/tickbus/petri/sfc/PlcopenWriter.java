package tickbus.petri.sfc;

import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.stream.IntStream;
import tickbus.petri.net.Transition;

/** Writes a chart as a project in PLCopen XML, in the form of Beremiz and OpenPLC Editor. */
final class PlcopenWriter {
    private static final Map<String, String> BLOCKS = Map.of("VAR", "localVars", "VAR_INPUT", "inputVars", "VAR_OUTPUT", "outputVars");
    private static final String OUT = "connectionPointOut formalParameter=\"\"";
    private static final String HEAD = """
        <?xml version='1.0' encoding='utf-8'?>
        <project xmlns="http://www.plcopen.org/xml/tc6_0201" xmlns:xhtml="http://www.w3.org/1999/xhtml">
          <fileHeader companyName="tickbus" productName="%1$s" productVersion="1" creationDateTime="1970-01-01T00:00:00"/>
          <contentHeader name="%1$s">
            <coordinateInfo>
              <fbd><scaling x="0" y="0"/></fbd>
              <ld><scaling x="0" y="0"/></ld>
              <sfc><scaling x="0" y="0"/></sfc>
            </coordinateInfo>
          </contentHeader>
          <types>
            <dataTypes/>
            <pous>
              <pou name="%1$s" pouType="%2$s">
        """;
    private static final String INSTANCE = """
              <configuration name="config">
                <resource name="resource1">
                  <task name="task0" priority="0" interval="T#20ms">
                    <pouInstance name="instance0" typeName="%s"/>
                  </task>
                </resource>
              </configuration>
        """;

    private final Sfc chart;
    private final ChartShape shape;
    private final PlcopenLayout layout;
    private final StringBuilder out = new StringBuilder();
    private int id;
    /** The number of each step. */
    private final int[] ids;
    /** The element above each step that is below a transition, and the lower end of that. */
    private final int[] above;
    private final int[] aboveY;

    PlcopenWriter(Sfc chart) {
        this.chart = chart;
        shape = new ChartShape(chart);
        layout = new PlcopenLayout(chart, shape);
        ids = IntStream.rangeClosed(1, chart.net().places().size()).toArray();
        id = ids.length;
        above = new int[ids.length];
        aboveY = new int[ids.length];
    }

    String text() {
        boolean isProgram = chart.source.kind().equals("PROGRAM");
        out.append(HEAD.formatted(chart.net().name(), isProgram ? "program" : "functionBlock"));
        variables();
        actions();
        out.append("        <body>\n          <SFC>\n");
        for (int step : layout.order()) {
            step(step);
            layout.groups(step).forEach(group -> group(step, group));
        }
        out.append("          </SFC>\n        </body>\n      </pou>\n    </pous>\n  </types>\n  <instances>\n    <configurations>\n")
            .append(isProgram ? INSTANCE.formatted(chart.net().name()) : "").append("    </configurations>\n  </instances>\n</project>\n");
        return out.toString();
    }

    private void variables() {
        out.append("        <interface>\n");
        List<Variable> variables = chart.variables.isEmpty() ? List.of(SfcWriter.NONE) : chart.variables;
        String open = "";
        for (int i = 0; i < variables.size(); i++) {
            Variable one = variables.get(i);
            String block = chart.variables.isEmpty() ? "VAR" : chart.source.blocks().get(i);
            if (!block.equals(open)) {
                close(open);
                String[] words = block.split(" ");
                out.append("          <").append(BLOCKS.get(words[0]));
                for (int k = 1; k < words.length; k++) {
                    out.append(' ').append(words[k].replace("_", "").toLowerCase(Locale.ROOT)).append("=\"true\"");
                }
                out.append(">\n");
                open = block;
            }
            out.append("            <variable name=\"").append(one.name()).append('"')
                .append(one.location().isEmpty() ? "" : " address=\"" + one.location() + "\"").append("><type><").append(one.type())
                .append("/></type>").append(one.initial() == 0 ? "" : "<initialValue><simpleValue value=\"" + SfcWriter.initial(one)
                    + "\"/></initialValue>").append("</variable>\n");
        }
        close(open);
        out.append("        </interface>\n");
    }

    private void close(String block) {
        if (!block.isEmpty()) {
            out.append("          </").append(BLOCKS.get(block.split(" ")[0])).append(">\n");
        }
    }

    private void actions() {
        StringBuilder all = new StringBuilder();
        for (int action = 0; action < chart.actions.size(); action++) {
            if (chart.actions.get(action).body() != null) {
                all.append("          <action name=\"").append(chart.source.names().get(action)).append("\"><body>")
                    .append(code(chart.source.bodies().get(action))).append("</body></action>\n");
            }
        }
        out.append(all.length() == 0 ? "" : "        <actions>\n" + all + "        </actions>\n");
    }

    private static String code(String text) {
        return "<ST><xhtml:p><![CDATA[" + text + "]]></xhtml:p></ST>";
    }

    private void step(int step) {
        int x = layout.stepX(step);
        int y = layout.stepY(step);
        int width = layout.width(step);
        boolean hasActions = !shape.associations(step).isEmpty();
        open("step", ids[step], x - width / 2, y, width, PlcopenLayout.STEP_HEIGHT, " name=\"" + chart.net().place(step).name() + "\" initialStep=\""
            + (chart.net().place(step).initial() > 0) + "\"");
        if (above[step] > 0) {
            in(width / 2, 0, above[step], x, y, x, aboveY[step]);
        }
        point(OUT, width / 2, PlcopenLayout.STEP_HEIGHT);
        if (hasActions) {
            point("connectionPointOutAction formalParameter=\"\"", width, PlcopenLayout.STEP_HEIGHT / 2);
        }
        end("step");
        if (hasActions) {
            block(step, x - width / 2 + width + 30, y);
        }
    }

    private void block(int step, int x, int y) {
        open("actionBlock", ++id, x, y, PlcopenLayout.BLOCK_WIDTH, layout.blockHeight(step), "");
        in(0, PlcopenLayout.STEP_HEIGHT / 2, ids[step], x, y + PlcopenLayout.STEP_HEIGHT / 2, x - 30, y + PlcopenLayout.STEP_HEIGHT / 2);
        int row = 0;
        for (Association one : shape.associations(step)) {
            out.append("              <action localId=\"0\" qualifier=\"").append(one.qualifier()).append('"')
                .append(one.qualifier().isTimed() ? " duration=\"" + SfcWriter.time(one.nanos()) + "\"" : "").append("><relPosition x=\"0\" y=\"")
                .append(PlcopenLayout.STEP_HEIGHT * row++).append("\"/><reference name=\"").append(chart.source.names().get(one.action()))
                .append("\"/></action>\n");
        }
        end("actionBlock");
    }

    /** The transitions from the same steps, with what is between them and the steps before and behind them. */
    private void group(int owner, PlcopenLayout.Group group) {
        int source = ids[owner];
        int first = layout.transitionX(group.transitions().get(0));
        int last = layout.transitionX(group.transitions().get(group.transitions().size() - 1));
        int y = layout.transitionY(group.transitions().get(0));
        int sourceX = layout.stepX(owner);
        int sourceY = layout.stepY(owner) + PlcopenLayout.STEP_HEIGHT;
        if (group.from().size() > 1) {
            int left = Math.min(first, group.from().stream().mapToInt(layout::stepX).min().orElseThrow());
            int right = Math.max(first, group.from().stream().mapToInt(layout::stepX).max().orElseThrow());
            open("simultaneousConvergence", ++id, left, y - 50, right - left, 3, "");
            for (int step : group.from()) {
                int x = layout.stepX(step);
                in(x - left, 0, ids[step], x, y - 50, x, layout.stepY(step) + PlcopenLayout.STEP_HEIGHT);
            }
            point("connectionPointOut", first - left, 3);
            end("simultaneousConvergence");
            source = id;
            sourceX = first;
            sourceY = y - 47;
        }
        if (group.transitions().size() > 1) {
            open("selectionDivergence", ++id, first, y - 25, last - first, 1, "");
            in(0, 0, source, first, y - 25, sourceX, sourceY);
            group.transitions().forEach(t -> point(OUT, layout.transitionX(t) - first, 1));
            end("selectionDivergence");
            source = id;
            sourceX = -1;
            sourceY = y - 24;
        }
        for (int t : group.transitions()) {
            int x = layout.transitionX(t);
            transition(chart.net().transition(t), source, x, y, sourceX < 0 ? x : sourceX, sourceY);
            behind(t, x, y);
        }
    }

    private void transition(Transition of, int source, int x, int y, int sourceX, int sourceY) {
        int priority = shape.priority(of.index());
        open("transition", ++id, x - 10, y, 20, 2, priority == 0 ? "" : " priority=\"" + priority + "\"");
        in(10, 0, source, x, y, sourceX, sourceY);
        point("connectionPointOut", 10, 2);
        out.append("              <condition><inline name=\"\">").append(code(chart.source.conditions().get(of.index())))
            .append("</inline></condition>\n");
        end("transition");
    }

    private void behind(int t, int x, int y) {
        List<Integer> behind = shape.behind(t);
        int[] columns = layout.behindX(t);
        int source = id;
        int sourceY = y + 2;
        if (columns.length > 1) {
            open("simultaneousDivergence", ++id, columns[0], y + 25, columns[columns.length - 1] - columns[0], 3, "");
            in(x - columns[0], 0, source, x, y + 25, x, sourceY);
            for (int column : columns) {
                point(OUT, column - columns[0], 3);
            }
            end("simultaneousDivergence");
            source = id;
            sourceY = y + 28;
        }
        for (int i = 0; i < columns.length; i++) {
            int step = behind.get(i);
            if (layout.isBelow(step, t)) {
                above[step] = source;
                aboveY[step] = sourceY;
            } else {
                open("jumpStep", ++id, columns[i] - 6, y + 50, 12, 13, " targetName=\"" + chart.net().place(step).name() + "\"");
                in(6, 0, source, columns[i], y + 50, columns[i], sourceY);
                end("jumpStep");
            }
        }
    }

    private void open(String tag, int number, int x, int y, int width, int height, String attributes) {
        out.append("            <").append(tag).append(" localId=\"").append(number).append('"').append(attributes).append(" height=\"")
            .append(height).append("\" width=\"").append(width).append("\">\n              <position x=\"").append(x).append("\" y=\"").append(y)
            .append("\"/>\n");
    }

    private void end(String tag) {
        out.append("            </").append(tag).append(">\n");
    }

    /** A point at which a line from another element ends; the line goes down, across and down. */
    private void in(int relativeX, int relativeY, int source, int x, int y, int sourceX, int sourceY) {
        out.append("              <connectionPointIn><relPosition x=\"").append(relativeX).append("\" y=\"").append(relativeY)
            .append("\"/><connection refLocalId=\"").append(source).append("\">");
        position(x, y);
        if (x != sourceX && y != sourceY) {
            position(x, y - 5);
            position(sourceX, y - 5);
        }
        position(sourceX, sourceY);
        out.append("</connection></connectionPointIn>\n");
    }

    private void position(int x, int y) {
        out.append("<position x=\"").append(x).append("\" y=\"").append(y).append("\"/>");
    }

    private void point(String tag, int x, int y) {
        out.append("              <").append(tag).append("><relPosition x=\"").append(x).append("\" y=\"").append(y).append("\"/></")
            .append(tag.split(" ")[0]).append(">\n");
    }
}
