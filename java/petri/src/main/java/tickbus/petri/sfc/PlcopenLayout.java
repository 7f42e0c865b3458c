package tickbus.petri.sfc;

import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.Deque;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;

/**
 * Positions for a chart, in pixels: each step has a column, below it its transitions side by side, and below each of them the
 * steps behind it. A step that has its place already is reached by a jump.
 */
final class PlcopenLayout {
    static final int STEP_HEIGHT = 30;
    private static final int JUMP_WIDTH = 80;
    static final int BLOCK_WIDTH = 160;
    private static final int ROW = 130;

    /**
     * Transitions from the same steps.
     *
     * @param from the steps
     * @param transitions the one that goes first is the first
     */
    record Group(List<Integer> from, List<Integer> transitions) {
    }

    private final Sfc chart;
    private final ChartShape shape;
    private final List<List<Group>> groups = new ArrayList<>();
    /** The steps, each behind the one that it is below. */
    private final List<Integer> order = new ArrayList<>();
    private final boolean[] isPlaced;
    /** The transition that a step is below; -1 for one at the top. */
    private final int[] below;
    /** The middle of each column, and the upper ends. */
    private final int[] stepX;
    private final int[] stepY;
    private final int[] transitionX;
    private final int[] transitionY;
    /** The columns of the steps or jumps behind each transition. */
    private final int[][] behindX;
    private final int half;

    PlcopenLayout(Sfc chart, ChartShape shape) {
        this.chart = chart;
        this.shape = shape;
        int steps = chart.net().places().size();
        int transitions = chart.net().transitions().size();
        isPlaced = new boolean[steps];
        below = new int[steps];
        stepX = new int[steps];
        stepY = new int[steps];
        transitionX = new int[transitions];
        transitionY = new int[transitions];
        behindX = new int[transitions][];
        int longest = 0;
        for (int step = 0; step < steps; step++) {
            groups.add(new ArrayList<>());
            longest = Math.max(longest, width(step));
        }
        half = longest / 2 + 20;
        int[] missing = new int[transitions];
        for (int t = 0; t < transitions; t++) {
            missing[t] = shape.before(t).size();
        }
        for (int pass = 0; pass < 2; pass++) {
            for (int step = 0; step < steps; step++) {
                if (!isPlaced[step] && (pass == 1 || chart.net().place(step).initial() > 0)) {
                    tree(step, missing);
                }
            }
        }
        place();
    }

    /** Orders the steps that can be reached from one. A transition belongs to the last of the steps before it. */
    private void tree(int root, int[] missing) {
        Deque<int[]> next = new ArrayDeque<>();
        next.push(new int[] {root, -1});
        while (!next.isEmpty()) {
            int[] one = next.pop();
            int step = one[0];
            if (isPlaced[step]) {
                continue;
            }
            isPlaced[step] = true;
            below[step] = one[1];
            order.add(step);
            Map<List<Integer>, Group> found = new LinkedHashMap<>();
            for (int t : shape.after(step)) {
                if (--missing[t] == 0) {
                    found.computeIfAbsent(shape.before(t), from -> new Group(from, new ArrayList<>())).transitions.add(t);
                }
            }
            groups.get(step).addAll(found.values());
            List<Integer> all = groups.get(step).stream().flatMap(group -> group.transitions.stream()).toList();
            for (int i = all.size() - 1; i >= 0; i--) {
                List<Integer> behind = shape.behind(all.get(i));
                for (int k = behind.size() - 1; k >= 0; k--) {
                    next.push(new int[] {behind.get(k), all.get(i)});
                }
            }
        }
    }

    private void place() {
        int[] stepWidth = new int[stepX.length];
        int[] transitionWidth = new int[transitionX.length];
        for (int i = order.size() - 1; i >= 0; i--) {
            int step = order.get(i);
            int sum = 0;
            for (Group group : groups.get(step)) {
                for (int t : group.transitions) {
                    int width = 0;
                    for (int behind : shape.behind(t)) {
                        width += below[behind] == t ? stepWidth[behind] : JUMP_WIDTH;
                    }
                    transitionWidth[t] = Math.max(width, 2 * half);
                    sum += transitionWidth[t];
                }
            }
            stepWidth[step] = Math.max(sum, 2 * half + (shape.associations(step).isEmpty() ? 0 : BLOCK_WIDTH + 60));
        }
        int top = 0;
        int[] left = new int[stepX.length];
        for (int step : order) {
            if (below[step] < 0) {
                left[step] = top;
                stepY[step] = 20;
                top += stepWidth[step];
            }
            stepX[step] = left[step] + half;
            int x = left[step];
            for (Group group : groups.get(step)) {
                int y = group.from.stream().mapToInt(this::bottom).max().orElseThrow();
                for (int t : group.transitions) {
                    transitionX[t] = x + half;
                    transitionY[t] = y + 70;
                    int column = x;
                    List<Integer> behind = shape.behind(t);
                    behindX[t] = new int[behind.size()];
                    for (int i = 0; i < behind.size(); i++) {
                        boolean isBelow = below[behind.get(i)] == t;
                        behindX[t][i] = column + (isBelow || behind.size() == 1 ? half : JUMP_WIDTH / 2);
                        if (isBelow) {
                            left[behind.get(i)] = column;
                            stepY[behind.get(i)] = y + ROW;
                        }
                        column += isBelow ? stepWidth[behind.get(i)] : JUMP_WIDTH;
                    }
                    x += transitionWidth[t];
                }
            }
        }
    }

    /** The steps, each behind the one that it is below. */
    List<Integer> order() {
        return order;
    }

    /** The transitions that are drawn below a step. */
    List<Group> groups(int step) {
        return groups.get(step);
    }

    /** True if a step is drawn below this transition; otherwise a jump leads to it. */
    boolean isBelow(int step, int transition) {
        return below[step] == transition;
    }

    int width(int step) {
        return 20 + 8 * chart.net().place(step).name().length();
    }

    int blockHeight(int step) {
        return STEP_HEIGHT * shape.associations(step).size();
    }

    /** The lower end of a step and its action block. */
    int bottom(int step) {
        return stepY[step] + Math.max(STEP_HEIGHT, blockHeight(step));
    }

    int stepX(int step) {
        return stepX[step];
    }

    int stepY(int step) {
        return stepY[step];
    }

    int transitionX(int transition) {
        return transitionX[transition];
    }

    int[] behindX(int transition) {
        return behindX[transition];
    }

    int transitionY(int transition) {
        return transitionY[transition];
    }
}
