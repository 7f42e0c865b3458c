/**
 * Petri nets: build or read a net, run it against inputs and outputs, and prove things about it. This package has no classes
 * of its own:
 *
 * <ul>
 * <li>{@code net}: a net and its parts. A {@link tickbus.petri.net.PetriNet} never changes; a
 * {@link tickbus.petri.net.Marking} does.
 * <li>{@code run}: the {@link tickbus.petri.run.Coordinator} runs a net as a control program, the
 * {@link tickbus.petri.run.Stepper} step by step, and {@link tickbus.petri.run.NetWatch} shows a running net to others. Time
 * is in nanoseconds, on a clock that the caller hands in.
 * <li>{@code analysis}: proofs about a net, such as {@link tickbus.petri.analysis.Reachability}.
 * <li>{@code format}: files, such as {@link tickbus.petri.format.Pnml}.
 * <li>{@code draw}: drawings, such as {@link tickbus.petri.draw.NetSvg}.
 * <li>{@code page}: a live page about running nets; {@code command}: the jar as a command.
 * </ul>
 */
package tickbus.petri;
