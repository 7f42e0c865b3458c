//! The files of the page.

use tickbus_web::Asset;

/// The page itself, its styles and its scripts; files shared with other pages come from the report and the room.
pub(crate) const ASSETS: &[Asset] = &[
    Asset::page(include_str!("page.html")),
    Asset::style("/report.css", tickbus_report::STYLE),
    Asset::style("/patch-bay.css", include_str!("page.css")),
    Asset::script("/stream.js", tickbus_web::STREAM),
    Asset::script("/client.js", tickbus_web::CLIENT),
    Asset::script("/head.js", tickbus_web::HEAD),
    Asset::style("/room.css", tickbus_web::STYLE),
    Asset::script("/state.js", include_str!("state.js")),
    Asset::script("/route.js", include_str!("route.js")),
    Asset::script("/board.js", include_str!("board.js")),
    Asset::script("/changes.js", include_str!("changes.js")),
    Asset::script("/layout.js", include_str!("layout.js")),
    Asset::script("/matrix.js", include_str!("matrix.js")),
    Asset::script("/patch-bay.js", include_str!("page.js")),
];
