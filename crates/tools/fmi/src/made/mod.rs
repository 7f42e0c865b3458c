//! A driver.cfg as an FMU.

mod description;
mod files;
mod instance;
mod library;
mod package;
mod resources;
mod variables;

pub use description::model_description;
pub use instance::Instance;
pub use library::{NativeLibrary, Platform, find_libraries};
pub use package::{Package, export};
pub use resources::{folder_of, folder_of_uri, token};
pub use variables::{Exposed, Place, Variable, is_stepped, kind_of};
