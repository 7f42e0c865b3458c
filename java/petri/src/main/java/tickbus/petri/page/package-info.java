/** A live page about running nets, for browsers: see {@link tickbus.petri.page.NetPage}. Needs the jar of tickbus. */
package tickbus.petri.page;
