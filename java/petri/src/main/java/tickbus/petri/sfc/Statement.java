package tickbus.petri.sfc;

import java.util.List;

/** A statement of an action. */
@FunctionalInterface
interface Statement {
    void run(State state);

    static Statement all(List<Statement> list) {
        Statement[] statements = list.toArray(Statement[]::new);
        return state -> {
            for (Statement one : statements) {
                one.run(state);
            }
        };
    }
}
