/**
 * Identification of pallets by the code carriers that they bear, for controllers over the bus {@code ivi-client}.
 *
 * <p>{@link tickbus.identification.IdentificationHead} gives commands to a head and takes its answers, {@link
 * tickbus.identification.PalletRecord} is what a pallet's carrier holds.
 */
package tickbus.identification;
