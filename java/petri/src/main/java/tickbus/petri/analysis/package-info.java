/**
 * Proofs about nets: {@link tickbus.petri.analysis.Reachability}, {@link tickbus.petri.analysis.Coverability},
 * {@link tickbus.petri.analysis.Semiflows}, {@link tickbus.petri.analysis.Siphons} and
 * {@link tickbus.petri.analysis.Conflicts}.
 */
package tickbus.petri.analysis;
