/**
 * Nets and their parts: places, transitions, arcs, delays and markings. {@link tickbus.petri.net.NetBuilder} builds a net;
 * {@link tickbus.petri.net.PetriNet} is the net.
 */
package tickbus.petri.net;
