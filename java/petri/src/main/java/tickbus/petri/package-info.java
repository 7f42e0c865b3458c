/**
 * Petri nets: build or read a net, run it against inputs and outputs, and prove things about it.
 *
 * <p>A {@link tickbus.petri.PetriNet} never changes; a {@link tickbus.petri.Marking} does. The
 * {@link tickbus.petri.Coordinator} runs a net as a control program; {@link tickbus.petri.Reachability},
 * {@link tickbus.petri.Coverability}, {@link tickbus.petri.Semiflows}, {@link tickbus.petri.Siphons} and
 * {@link tickbus.petri.Conflicts} analyse it. Time is in nanoseconds, on a clock that the caller hands in.
 */
package tickbus.petri;
