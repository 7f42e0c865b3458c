//! A driver.cfg as an FMU.

mod arrays;
mod description;
mod exposed;
mod files;
mod instance;
mod library;
mod own;
mod package;
mod resources;
mod variables;

pub use arrays::Array;
pub use description::model_description;
pub use exposed::{Cell, Exposed, Part, kind_of};
pub use instance::{EventMode, Instance, StepEnd, Updated};
pub use library::{NativeLibrary, Platform, find_libraries};
pub use own::is_stepped;
pub use package::{Package, export};
pub use resources::{folder_of, folder_of_uri, token};
pub use variables::{Enumeration, Place, Start, Use, Variable};
