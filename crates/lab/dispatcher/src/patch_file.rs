//! The file in which a patch survives.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use tickbus_base::toml_text::{Collector, Mistakes, Table, load_text, read_text};

use crate::patch::{Patch, Pin};

/// The heading of a file written here.
const HEADING: &str = "\
# The patch of a tickbus dispatcher, input = output. It is rewritten with every CONNECT and DISCONNECT: edit it only
# while the dispatcher does not run.
[patch]
";

/// A file with a patch. The file is replaced as a whole: at every moment it has either the old patch or the new one.
#[derive(Clone, Debug)]
pub struct PatchFile {
    path: PathBuf,
}

impl PatchFile {
    /// The file at `path`.
    pub fn new(path: &Path) -> Self {
        let path = path.to_owned();
        Self { path }
    }

    /// Reads the patch; a file that does not exist has none.
    ///
    /// # Errors
    ///
    /// With every mistake in it.
    pub fn load(&self) -> Result<Patch, Mistakes> {
        if let Err(error) = fs::metadata(&self.path)
            && error.kind() == io::ErrorKind::NotFound
        {
            return Ok(Patch::new());
        }
        let text = load_text(&self.path)?;
        parse(&self.path.display().to_string(), &text)
    }

    /// Replaces the file. On return the patch is safe, even if the computer crashes.
    ///
    /// # Errors
    ///
    /// The file cannot be written, and still has the old patch.
    pub fn save(&self, patch: &Patch) -> io::Result<()> {
        let mut text = HEADING.to_owned();
        for (sink, source) in patch.iter() {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "\"{sink}\" = \"{source}\"");
        }
        replace_file(&self.path, &text)
    }
}

/// Replaces a file by one with this text. On return the text is safe, even if the computer crashes; at every moment the
/// file has either the old text or the new one.
///
/// # Errors
///
/// The file cannot be written, and still has the old text.
pub fn replace_file(path: &Path, text: &str) -> io::Result<()> {
    // In the same folder.
    let mut next = path.as_os_str().to_owned();
    next.push(".new");
    let next = PathBuf::from(next);
    // In a shared folder the name may be another user's link, which must not be followed.
    match fs::remove_file(&next) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let mut file = File::create_new(&next)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()?;
    drop(file);
    fs::rename(&next, path)?;
    #[cfg(unix)]
    {
        let folder = path.parent().filter(|it| !it.as_os_str().is_empty());
        File::open(folder.unwrap_or(Path::new(".")))?.sync_all()?;
    }
    Ok(())
}

fn parse(file: &str, text: &str) -> Result<Patch, Mistakes> {
    const RIGHT: &str = "write a [patch] table with lines such as \"LOGO2:I4\" = \"LOGO1:Q1\"";

    let mut collector = Collector::new(file, text);
    let patch = read_text(&mut collector, text, |mut root| {
        let table = root.require("patch", RIGHT);
        root.finish();
        Some(read(&table?.table("[patch]", RIGHT)?))
    });
    match collector.finish() {
        Some(mistakes) => Err(mistakes),
        None => Ok(patch.unwrap_or_default()),
    }
}

fn read(table: &Table<'_>) -> Patch {
    let mut patch = Patch::new();
    for (key, value) in table.all() {
        let Some(sink) = Pin::parse(key).filter(|sink| !sink.channel.kind.is_output()) else {
            let what = format!(
                "\"{}\" is no input of a client",
                tickbus_base::toml_text::shown(key)
            );
            value.wrong(what, "write a name and an input, such as \"LOGO2:I4\"");
            continue;
        };
        let right = "write a name and an output, such as \"LOGO1:Q1\"";
        let Some(text) = value.text(right) else {
            continue;
        };
        let Some(source) = Pin::parse(text).filter(|source| source.channel.kind.is_output()) else {
            let what = format!(
                "\"{}\" is no output of a client",
                tickbus_base::toml_text::shown(text)
            );
            value.wrong(what, right);
            continue;
        };
        if source.channel.kind.is_analog() != sink.channel.kind.is_analog() {
            let what = format!("{sink} and {source} are not both digital or both analog");
            value.wrong(what, "connect digital with digital and analog with analog");
        } else if patch.source(&sink).is_some() {
            value.wrong(
                format!("{sink} stands here twice"),
                "an input has one source",
            );
        } else {
            patch.connect(sink, source);
        }
    }
    patch
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_patch_reads_what_was_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = PatchFile::new(&folder.path().join("lab.toml"));
        assert_eq!(file.load().expect("no file"), Patch::new());
        let mut patch = Patch::new();
        for (sink, source) in [
            ("B:I4", "A.1:Q1"),
            ("A.1:AI0", "x-y_z:AQ3"),
            ("B:I5", "A.1:Q1"),
        ] {
            patch.connect(
                Pin::parse(sink).expect(sink),
                Pin::parse(source).expect(source),
            );
            file.save(&patch).expect("it can be written");
            assert_eq!(file.load().expect("it is right"), patch);
        }
        let names = fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(names, 1, "nothing is left behind");
    }

    #[test]
    fn mistakes_are_told_at_their_place() {
        let text = "[patch]\n\"A:Q1\" = \"B:Q1\"\n\"A:I1\" = \"B:I1\"\n\"A:I2\" = 7\n\"A:AI1\" = \"B:Q1\"\n\"A:i3\" = \"B:Q1\"\n\
                    \"A:I3\" = \"B:Q1\"\nx = 1\n[other]\n";
        let told = parse("lab.toml", text)
            .expect_err("it is wrong")
            .to_string();
        let expected = [
            "lab.toml:2:10: \"A:Q1\" is no input of a client; write a name and an input, such as \"LOGO2:I4\"",
            "lab.toml:3:10: \"B:I1\" is no output of a client; write a name and an output, such as \"LOGO1:Q1\"",
            "lab.toml:4:10: ",
            "lab.toml:5:11: A:AI1 and B:Q1 are not both digital or both analog; ",
            "lab.toml:8:5: \"x\" is no input of a client; ",
            "lab.toml:9:2: unknown key \"other\" in the file; keys here are patch",
        ];
        for part in expected {
            assert!(told.contains(part), "{part} in {told}");
        }
        assert!(told.contains("A:I3 stands here twice"), "{told}");
        let told = parse("lab.toml", "").expect_err("it is empty").to_string();
        assert!(told.contains("write a [patch] table"), "{told}");
    }
}
