//! The native library as a JVM sees it: the names that it exports.
#![allow(unsafe_code, reason = "a library is loaded")]

use std::path::PathBuf;

use libloading::Library;

/// The cdylib built by cargo for this test, beside or above the test's executable.
fn cdylib() -> PathBuf {
    let name = libloading::library_filename("tickbus");
    let test = std::env::current_exe().expect("a test has a path");
    let places: Vec<_> = test
        .ancestors()
        .skip(1)
        .take(2)
        .map(|dir| dir.join(&name))
        .collect();
    let found = places.iter().find(|place| place.exists());
    found
        .unwrap_or_else(|| panic!("no {} in {places:?}", name.display()))
        .clone()
}

#[test]
fn the_native_methods_of_tickbus_are_exported() {
    // SAFETY: this is our own library; its only initialisers are those of the Rust runtime.
    let library = unsafe { Library::new(cdylib()) }.expect("loads");
    for name in [
        "JNI_OnLoad",
        "Java_tickbus_Tickbus_initializeNative",
        "Java_tickbus_Tickbus_xChangeData",
        "Java_tickbus_Tickbus_receiveNative",
        "Java_tickbus_Tickbus_sendNative",
        "Java_tickbus_Tickbus_finalizeNative",
        "Java_tickbus_Tickbus_statisticsNative",
        "Java_tickbus_SwallowedChanges_linesNative",
        "Java_tickbus_Tickbus_eventsNative",
        "Java_tickbus_Tickbus_injectNative",
        "Java_tickbus_Tickbus_endFaultNative",
        "Java_tickbus_Tickbus_faultsNative",
        "Java_tickbus_ModelFaults_declareNative",
        "Java_tickbus_ModelFaults_takeNative",
        "Java_tickbus_Tickbus_reportNative",
        "Java_tickbus_LiveNets_openNative",
        "Java_tickbus_LiveNets_wantedNative",
        "Java_tickbus_SweepSession_openNative",
        "Java_tickbus_SweepSession_afterNative",
    ] {
        // SAFETY: the symbol is looked up, and never called.
        let symbol = unsafe { library.get::<unsafe extern "C" fn()>(name) };
        assert!(symbol.is_ok(), "{name} is not exported");
    }
}
