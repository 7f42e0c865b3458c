//! The native methods of the Java class `tickbus.Tickbus`.
