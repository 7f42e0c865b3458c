/**
 * Running nets: the {@link tickbus.petri.run.Coordinator} with conditions, actions, inputs and outputs, and the
 * {@link tickbus.petri.run.Stepper} without. {@link tickbus.petri.run.NetWatch} hands their state to views.
 */
package tickbus.petri.run;
