package tickbus.petri.control;

import tickbus.petri.run.Action;

/**
 * One action, as written by the user.
 *
 * @param moment when it happens
 * @param node the place, or the transition of {@link Moment#FIRING}
 * @param output the signal to be set; null for code
 * @param value the signal's new value
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
