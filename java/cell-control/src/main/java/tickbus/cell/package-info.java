/** The control of the manufacturing cell: a Petri net for each station, one for the transport and one for the whole. */
package tickbus.cell;
