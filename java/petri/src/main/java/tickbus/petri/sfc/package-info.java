/** Sequential function charts of IEC 61131-3: read as Petri nets, and run as a PLC runs them. */
package tickbus.petri.sfc;
