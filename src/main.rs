//! The `tickbus` command: see [`tickbus::cli`].

fn main() -> std::process::ExitCode {
    tickbus::cli::main(&tickbus::KINDS)
}
