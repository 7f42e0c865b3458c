package tickbus.simulator.expression;

import java.util.List;

/** The rules of types: nothing is converted silently; a whole number as written is an LREAL beside one. */
final class Typing {
    private final Names names;

    Typing(Names names) {
        this.names = names;
    }

    /**
     * A node with the type that is needed.
     *
     * @param what needs it, for the message, such as {@code AND}
     * @throws ExpressionException if the node has another type
     */
    Node as(Type type, Node node, String what) {
        Type has = type(node);
        if (node.type == null && (type == Type.BOOL || type == Type.LREAL)) {
            if (has == null) {
                names.use(node.index, type);
            } else if (has != type) {
                throw new ExpressionException(node.offset, "\"" + node.name + "\" is used as " + has
                        + " elsewhere in the table; " + what + " takes " + type);
            }
            return type == Type.BOOL ? node.asTruth() : node.asReal();
        }
        if (has == type) {
            return node;
        }
        if (node.literal && type == Type.LREAL) {
            return node.asReal();
        }
        Type is = has == null ? Type.LREAL : has;
        throw new ExpressionException(node.offset, what + " takes " + type + "; this is " + is + cure(is, type));
    }

    private static String cure(Type is, Type wanted) {
        return switch (wanted) {
            case BOOL -> is == Type.TIME ? "; compare it, such as … > T#1s" : "; compare it, such as … <> 0";
            case LINT -> is == Type.LREAL ? "; write TO_LINT(…), which rounds"
                    : is == Type.BOOL ? "; write TO_LINT(…)" : "; write a whole number";
            case LREAL -> is == Type.TIME ? "; write TO_LREAL(…), which gives seconds" : "; write TO_LREAL(…)";
            case TIME -> "; write a duration, such as T#500ms";
        };
    }

    /**
     * The one type that several nodes have: that of the first one that is neither a whole number as written nor without a
     * type.
     *
     * @return null if all nodes are without a type
     */
    Type common(List<Node> nodes) {
        boolean literal = false;
        boolean untyped = false;
        for (Node node : nodes) {
            Type type = type(node);
            if (type == null) {
                untyped = true;
            } else if (node.literal) {
                literal = true;
            } else {
                return type;
            }
        }
        return !literal ? null : untyped ? Type.LREAL : Type.LINT;
    }

    /** The nodes with the type that they have in common; with LREAL if none has a type. */
    List<Node> alike(List<Node> nodes, String what) {
        Type common = common(nodes);
        Type type = common == null ? Type.LREAL : common;
        return nodes.stream().map(node -> as(type, node, what)).toList();
    }

    /** The nodes with the type that they have in common, which is one for quantities: LINT, LREAL or TIME. */
    List<Node> quantities(List<Node> nodes, String what) {
        for (Node node : nodes) {
            if (type(node) == Type.BOOL) {
                throw new ExpressionException(node.offset, what + " takes numbers or durations; this is BOOL"
                        + "; SEL(…, 0, 1) makes a number of it");
            }
        }
        return alike(nodes, what);
    }

    /** The type that a node has by now: another part of the expression may have decided it. */
    private Type type(Node node) {
        return node.type == null ? names.used(node.index) : node.type;
    }
}
