package tickbus.simulator.expression;

import java.util.List;

/** The functions without a state. All arguments are always computed. */
final class Functions {
    static final List<Callable> ALL = List.of(
            function("SEL", "IN0 if G is FALSE, else IN1", false, Functions::sel, "G", "IN0", "IN1"),
            function("MUX", "the K-th of the others from 0; K below 0 means the first, above the last", true,
                    Functions::mux, "K", "IN0", "IN1"),
            function("LIMIT", "IN, but never below MN or above MX", false, Functions::limit, "MN", "IN", "MX"),
            function("MIN", "the least", true, (typing, call) -> least(typing, call, true), "IN1", "IN2"),
            function("MAX", "the greatest", true, (typing, call) -> least(typing, call, false), "IN1", "IN2"),
            function("ABS", "IN without its sign", false, Functions::abs, "IN"),
            function("TO_LINT", "a whole number of an LREAL, halves to the even one, or of a BOOL", false,
                    Functions::toLint, "IN"),
            function("TO_LREAL", "an LREAL of a LINT or BOOL, or the seconds of a TIME", false, Functions::toLreal,
                    "IN"));

    private static final double NANOS_PER_SECOND = 1e9;

    private Functions() {
    }

    private static Callable function(String name, String meaning, boolean open, Callable.Maker maker,
            String... parameters) {
        return new Callable(name, List.of(parameters), open, List.of(), meaning, maker);
    }

    private static Node sel(Typing typing, Call call) {
        Node gate = typing.as(Type.BOOL, call.argument(0), "G of SEL");
        List<Node> inputs = typing.alike(call.arguments().subList(1, 3), "SEL");
        return choice(call, inputs, v -> gate.truth(v) ? 1 : 0);
    }

    private static Node mux(Typing typing, Call call) {
        Node number = typing.as(Type.LINT, call.argument(0), "K of MUX");
        List<Node> inputs = typing.alike(call.arguments().subList(1, call.arguments().size()), "MUX");
        long last = inputs.size() - 1L;
        return choice(call, inputs, v -> Math.max(0, Math.min(last, number.whole(v))));
    }

    /** Computes all inputs, and takes one of them. */
    private static Node choice(Call call, List<Node> inputs, Node.Whole which) {
        Node[] all = inputs.toArray(Node[]::new);
        return switch (all[0].type) {
            case BOOL -> Node.truth(call.offset(), v -> {
                long wanted = which.of(v);
                boolean result = false;
                for (int i = 0; i < all.length; i++) {
                    boolean one = all[i].truth(v);
                    result = i == wanted ? one : result;
                }
                return result;
            });
            case LREAL -> Node.real(call.offset(), v -> {
                long wanted = which.of(v);
                double result = 0;
                for (int i = 0; i < all.length; i++) {
                    double one = all[i].real(v);
                    result = i == wanted ? one : result;
                }
                return result;
            });
            case LINT, TIME -> whole(call, all[0].type, v -> {
                long wanted = which.of(v);
                long result = 0;
                for (int i = 0; i < all.length; i++) {
                    long one = all[i].whole(v);
                    result = i == wanted ? one : result;
                }
                return result;
            });
        };
    }

    private static Node whole(Call call, Type type, Node.Whole whole) {
        return type == Type.TIME ? Node.time(call.offset(), whole) : Node.whole(call.offset(), whole);
    }

    private static Node limit(Typing typing, Call call) {
        List<Node> all = typing.quantities(call.arguments(), "LIMIT");
        Node low = all.get(0);
        Node in = all.get(1);
        Node high = all.get(2);
        if (in.type == Type.LREAL) {
            return Node.real(call.offset(), v -> {
                double least = low.real(v);
                double value = in.real(v);
                return Math.min(Math.max(value, least), high.real(v));
            });
        }
        return whole(call, in.type, v -> {
            long least = low.whole(v);
            long value = in.whole(v);
            return Math.min(Math.max(value, least), high.whole(v));
        });
    }

    private static Node least(Typing typing, Call call, boolean least) {
        Node[] all = typing.quantities(call.arguments(), call.name()).toArray(Node[]::new);
        if (all[0].type == Type.LREAL) {
            return Node.real(call.offset(), v -> {
                double best = all[0].real(v);
                for (int i = 1; i < all.length; i++) {
                    double one = all[i].real(v);
                    best = least ? Math.min(best, one) : Math.max(best, one);
                }
                return best;
            });
        }
        return whole(call, all[0].type, v -> {
            long best = all[0].whole(v);
            for (int i = 1; i < all.length; i++) {
                long one = all[i].whole(v);
                best = least ? Math.min(best, one) : Math.max(best, one);
            }
            return best;
        });
    }

    private static Node abs(Typing typing, Call call) {
        Node in = typing.quantities(call.arguments(), "ABS").get(0);
        return in.type == Type.LREAL ? Node.real(call.offset(), v -> Math.abs(in.real(v)))
                : whole(call, in.type, v -> Math.abs(in.whole(v)));
    }

    private static Node toLint(Typing typing, Call call) {
        Node in = converted(typing, call);
        return switch (in.type) {
            case BOOL -> Node.whole(call.offset(), v -> in.truth(v) ? 1 : 0);
            case LREAL -> Node.whole(call.offset(), v -> (long) Math.rint(in.real(v)));
            case LINT -> in;
            case TIME -> throw new ExpressionException(in.offset, "TO_LINT takes LREAL or BOOL; this is TIME"
                    + "; write TO_LREAL(…), which gives seconds");
        };
    }

    private static Node toLreal(Typing typing, Call call) {
        Node in = converted(typing, call);
        return switch (in.type) {
            case BOOL -> Node.real(call.offset(), v -> in.truth(v) ? 1 : 0);
            case LREAL -> in;
            case LINT -> Node.real(call.offset(), v -> in.whole(v));
            case TIME -> Node.real(call.offset(), v -> in.whole(v) / NANOS_PER_SECOND);
        };
    }

    private static Node converted(Typing typing, Call call) {
        return typing.alike(call.arguments(), call.name()).get(0);
    }
}
