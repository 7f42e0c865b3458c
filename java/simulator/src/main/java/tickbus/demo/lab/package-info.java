/** The demo of the virtual laboratory: a dispatcher, two controllers and the testing board. */
package tickbus.demo.lab;
