package tickbus.petri.control;

import tickbus.petri.Action;

/**
 * One action, as it was written.
 *
 * @param moment when it happens
 * @param node the place, or the transition of {@link Moment#FIRING}
 * @param output the signal that it sets; null if it is code
 * @param value what the signal is set to
 * @param code the user's own action
 */
record Step(Moment moment, String node, String output, double value, Action code) {
    enum Moment {
        ENTRY("entry of place"), EXIT("exit of place"), DURING("place"), FIRING("firing of transition");

        final String text;

        Moment(String text) {
            this.text = text;
        }
    }

    String where() {
        return moment.text + " " + node;
    }
}
