//! Reads a driver.cfg again.

use tickbus_base::toml_text::Mistakes;

use crate::Config;

impl Config {
    /// Reads the file again, which may have changed, with the same tables in place of its own.
    ///
    /// # Errors
    ///
    /// As [`load_as`](Self::load_as) and [`overlaid`](Self::overlaid).
    pub fn read_again(&self) -> Result<Self, Mistakes> {
        let config = Self::load_as(&self.path, self.origin.asked, self.kinds);
        let mut overlays = self.origin.overlays.iter();
        overlays.try_fold(config?, |config, (name, text)| config.overlaid(name, text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_again_with_the_tables_that_replaced_its_own() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("driver.cfg");
        let text = |name: &str| {
            format!(
                "[driver]\nid = 1\nname = \"{name}\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"a\"\n\
                 [[signal]]\nname = \"a\"\naddress = \"%IX0.0\"\n"
            )
        };
        std::fs::write(&path, text("first")).expect("written");
        let config = Config::load(&path, &crate::KINDS).expect("no mistakes");
        let tables = "[fieldbus]\nkind = \"loopback\"\nlink = \"b\"\n";
        let config = config.overlaid("tables", tables).expect("no mistakes");
        assert_eq!(config.read_again(), Ok(config.clone()));
        std::fs::write(&path, text("second")).expect("written");
        let again = config.read_again().expect("no mistakes");
        assert_eq!((&*again.name, &again.bus), ("second", &config.bus));
    }
}
