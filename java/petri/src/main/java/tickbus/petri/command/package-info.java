/** The command of this jar: step through a net, analyse it, draw it. */
package tickbus.petri.command;
