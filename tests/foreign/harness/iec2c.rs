//! The compiler `iec2c`, and its output for programs.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::Absent;

/// The compiler and its library.
pub struct Compiler {
    pub program: PathBuf,
    pub library: PathBuf,
}

impl Compiler {
    /// The compiler named by `IEC2C`, on the `PATH`, or in `shared/peers` beside the checkout; with the
    /// library named by `IEC2C_LIB`, or beside the compiler.
    pub fn find() -> Result<Self, Absent> {
        let absent = |why: &str| Absent(why.to_owned());
        let stated = std::env::var_os("IEC2C").map(PathBuf::from);
        let path = std::env::var_os("PATH").unwrap_or_default();
        let on_path = std::env::split_paths(&path).map(|folder| folder.join("iec2c"));
        let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/peers/iec2c/iec2c");
        let mut candidates = stated.into_iter().chain(on_path).chain([beside]);
        let program = candidates.find(|path| path.is_file());
        let why = "there is no iec2c (it comes with OpenPLC Editor and Beremiz; IEC2C names it)";
        let program = program.ok_or_else(|| absent(why))?;
        let program = program.canonicalize().expect("it is there");
        let folder = program.parent().expect("a file is in a folder").to_owned();
        let stated = std::env::var_os("IEC2C_LIB").map(PathBuf::from);
        let beside = ["lib", "../lib", "../lib/matiec", "../share/matiec/lib"];
        let beside = beside.iter().map(|name| folder.join(name));
        let mut candidates = stated.into_iter().chain(beside);
        let library = candidates
            .find(|path| path.join("ieclib.txt").is_file())
            .ok_or_else(|| {
                absent("there is no ieclib.txt beside iec2c; IEC2C_LIB names its folder")
            })?;
        Ok(Self { program, library })
    }

    /// Builds a program in Structured Text as users do, into `folder`.
    pub fn build(&self, text: &str, folder: &Path) -> PathBuf {
        let (source, object) = (folder.join("program.st"), folder.join("program.so"));
        std::fs::write(&source, text).expect("the file is written");
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let output = Command::new(root.join("plc/build"))
            .args([&source, &object])
            .env("IEC2C", &self.program)
            .env("IEC2C_LIB", &self.library)
            .output()
            .expect("plc/build runs");
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{told}\n{text}");
        object
    }
}
