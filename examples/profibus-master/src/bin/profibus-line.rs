//! A serial line without hardware, for the demo: prints the names of its two ends, and runs until stdin ends.

#[cfg(unix)]
#[path = "../../../../tests/peers/pty.rs"]
mod pty;

#[cfg(unix)]
fn main() {
    let line = pty::Line::new();
    println!("{} {}", line.end(0).display(), line.end(1).display());
    // The parent process holds the other end of stdin, and closes it at the latest when it ends.
    let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
}

#[cfg(not(unix))]
fn main() {
    eprintln!("profibus-line: pseudo-terminals need a Unix");
    std::process::exit(1);
}
