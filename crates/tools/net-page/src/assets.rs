//! The files of the page.

use tickbus_web::Asset;

/// The page itself, its styles and its scripts; files shared with other pages come from the report and the room.
pub(crate) const ASSETS: &[Asset] = &[
    Asset::page(include_str!("page.html")),
    Asset::style("/report.css", tickbus_report::STYLE),
    Asset::style("/room.css", tickbus_web::STYLE),
    Asset::style("/net.css", include_str!("net.css")),
    Asset::style("/nets.css", include_str!("page.css")),
    Asset::script("/stream.js", tickbus_web::STREAM),
    Asset::script("/client.js", tickbus_web::CLIENT),
    Asset::script("/head.js", tickbus_web::HEAD),
    Asset::script("/elements.js", tickbus_web::ELEMENTS),
    Asset::script("/net-model.js", include_str!("model.js")),
    Asset::script("/net-view.js", include_str!("view.js")),
    Asset::script("/nets.js", include_str!("nets.js")),
];
