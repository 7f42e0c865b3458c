/** Drawings of nets: {@link tickbus.petri.draw.NetSvg} for browsers, {@link tickbus.petri.draw.Dot} for Graphviz. */
package tickbus.petri.draw;
