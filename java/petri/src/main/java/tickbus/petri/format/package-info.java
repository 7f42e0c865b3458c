/**
 * Files of nets and markings: {@link tickbus.petri.format.Pnml}, the files of HPSim ({@link tickbus.petri.format.Hpx},
 * {@link tickbus.petri.format.HpsimText}) and {@link tickbus.petri.format.MarkingFile}.
 */
package tickbus.petri.format;
