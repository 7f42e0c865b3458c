package tickbus.simulator.expression;

import java.util.List;

/** Operators, as nodes. Both sides are always computed. */
final class Operators {
    private final Typing typing;

    Operators(Typing typing) {
        this.typing = typing;
    }

    /**
     * The result of an operator between two nodes.
     *
     * @param sign in capitals
     * @param offset place of the operator
     */
    Node binary(String sign, int offset, Node left, Node right) {
        return switch (sign) {
            case "AND", "&", "OR", "XOR" -> logic(sign, offset, left, right);
            case "=", "<>" -> equal(sign, offset, left, right);
            case "<", ">", "<=", ">=" -> order(sign, offset, left, right);
            case "MOD" -> {
                Node a = typing.as(Type.LINT, left, sign);
                Node b = typing.as(Type.LINT, right, sign);
                yield Node.whole(offset, v -> modulo(a.whole(v), b.whole(v)));
            }
            default -> arithmetic(sign, offset, left, right);
        };
    }

    Node not(int offset, Node node) {
        Node a = typing.as(Type.BOOL, node, "NOT");
        return Node.truth(offset, v -> !a.truth(v));
    }

    Node negative(int offset, Node node) {
        if (node.literal) {
            return Node.literal(offset, -node.whole(null));
        }
        Node a = typing.quantities(List.of(node), "-").get(0);
        return switch (a.type) {
            case LREAL -> Node.real(offset, v -> -a.real(v));
            case TIME -> Node.time(offset, v -> -a.whole(v));
            default -> Node.whole(offset, v -> -a.whole(v));
        };
    }

    private Node logic(String sign, int offset, Node left, Node right) {
        Node a = typing.as(Type.BOOL, left, sign);
        Node b = typing.as(Type.BOOL, right, sign);
        return Node.truth(offset, switch (sign) {
            case "OR" -> v -> a.truth(v) | b.truth(v);
            case "XOR" -> v -> a.truth(v) ^ b.truth(v);
            default -> v -> a.truth(v) & b.truth(v);
        });
    }

    private Node equal(String sign, int offset, Node left, Node right) {
        Type type = typing.common(List.of(left, right));
        boolean wanted = sign.equals("=");
        if (type == null) {
            // Two variables of the machine: their numbers are equal, whatever they mean.
            return Node.truth(offset, v -> left.real(v) == right.real(v) == wanted);
        }
        Node a = typing.as(type, left, sign);
        Node b = typing.as(type, right, sign);
        return Node.truth(offset, switch (type) {
            case BOOL -> v -> a.truth(v) == b.truth(v) == wanted;
            case LREAL -> v -> a.real(v) == b.real(v) == wanted;
            case LINT, TIME -> v -> a.whole(v) == b.whole(v) == wanted;
        });
    }

    private Node order(String sign, int offset, Node left, Node right) {
        List<Node> both = typing.quantities(List.of(left, right), sign);
        Node a = both.get(0);
        Node b = both.get(1);
        if (a.type == Type.LREAL) {
            return Node.truth(offset, switch (sign) {
                case "<" -> v -> a.real(v) < b.real(v);
                case ">" -> v -> a.real(v) > b.real(v);
                case "<=" -> v -> a.real(v) <= b.real(v);
                default -> v -> a.real(v) >= b.real(v);
            });
        }
        return Node.truth(offset, switch (sign) {
            case "<" -> v -> a.whole(v) < b.whole(v);
            case ">" -> v -> a.whole(v) > b.whole(v);
            case "<=" -> v -> a.whole(v) <= b.whole(v);
            default -> v -> a.whole(v) >= b.whole(v);
        });
    }

    private Node arithmetic(String sign, int offset, Node left, Node right) {
        boolean sum = sign.equals("+") || sign.equals("-");
        for (Node node : List.of(left, right)) {
            if (node.type == Type.TIME && !sum) {
                throw new ExpressionException(node.offset, sign + " takes numbers; this is TIME"
                        + "; write TO_LREAL(…), which gives seconds");
            }
        }
        List<Node> both = typing.quantities(List.of(left, right), sign);
        Node a = both.get(0);
        Node b = both.get(1);
        if (a.type == Type.LREAL) {
            return Node.real(offset, switch (sign) {
                case "+" -> v -> a.real(v) + b.real(v);
                case "-" -> v -> a.real(v) - b.real(v);
                case "*" -> v -> a.real(v) * b.real(v);
                default -> v -> a.real(v) / b.real(v);
            });
        }
        Node.Whole whole = switch (sign) {
            case "+" -> v -> a.whole(v) + b.whole(v);
            case "-" -> v -> a.whole(v) - b.whole(v);
            case "*" -> v -> a.whole(v) * b.whole(v);
            default -> v -> divided(a.whole(v), b.whole(v));
        };
        return a.type == Type.TIME ? Node.time(offset, whole) : Node.whole(offset, whole);
    }

    /** A whole number divided by 0 is 0: a tick must not end a run. */
    private static long divided(long a, long b) {
        return b == 0 ? 0 : a / b;
    }

    private static long modulo(long a, long b) {
        return b == 0 ? 0 : a % b;
    }
}
