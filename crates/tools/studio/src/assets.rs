//! The files of the page; it uses those of the live page, too.

use tickbus_web::Asset;

pub(crate) const ASSETS: &[Asset] = &[
    Asset::page(include_str!("studio.html")),
    Asset::style("/studio.css", include_str!("studio.css")),
    Asset::script("/studio.js", include_str!("studio.js")),
    Asset::script("/cells.js", include_str!("cells.js")),
    Asset::script("/running.js", include_str!("running.js")),
    Asset::script("/explore.js", include_str!("explore.js")),
    Asset::script("/tags.js", include_str!("tags.js")),
    Asset::script("/bus.js", include_str!("bus.js")),
];
