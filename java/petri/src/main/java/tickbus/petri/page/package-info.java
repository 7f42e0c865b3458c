/** A live page about running nets, for browsers: see {@link tickbus.petri.page.NetPage}. Needs the JDK's module jdk.httpserver. */
package tickbus.petri.page;
