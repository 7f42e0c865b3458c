/**
 * The peeling line: a charger feeds blocks of wood, centres them and hands them to a lathe, which peels them to veneer.
 *
 * <p>Two PLCs move its 25 axes over the link that S. Nyyssönen's thesis of 2018 describes (Control and communications of
 * peeling machine simulator, Tampere University of Technology). Lengths are in millimetres, angles in degrees or
 * revolutions, times in seconds.
 *
 * <p>In the demo, {@link tickbus.machines.peeler.PeelingDemo}, both PLCs peel some blocks over two links. At the end the
 * times between records are compared with those measured in 2018.
 */
package tickbus.machines.peeler;
