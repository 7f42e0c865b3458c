/** The drop-in driver: put its jar and one or more {@code .cfg} files into a simulator's DeviceDriver folder. */
package DeviceDrivers;
