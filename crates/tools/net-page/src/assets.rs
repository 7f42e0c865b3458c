//! The files of the page.

use tickbus_web::Asset;

const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

/// The page itself, its styles and its scripts; files shared with other pages come from the report and the room.
pub(crate) const ASSETS: &[Asset] = &[
    Asset {
        path: "/",
        kind: "text/html; charset=utf-8",
        text: include_str!("page.html"),
    },
    style("/report.css", tickbus_report::STYLE),
    style("/room.css", tickbus_web::STYLE),
    style("/net.css", include_str!("net.css")),
    style("/nets.css", include_str!("page.css")),
    script("/stream.js", tickbus_web::STREAM),
    script("/client.js", tickbus_web::CLIENT),
    script("/head.js", tickbus_web::HEAD),
    script("/elements.js", tickbus_web::ELEMENTS),
    script("/net-model.js", include_str!("model.js")),
    script("/net-view.js", include_str!("view.js")),
    script("/nets.js", include_str!("nets.js")),
];

const fn asset(path: &'static str, kind: &'static str, text: &'static str) -> Asset {
    Asset { path, kind, text }
}

const fn style(path: &'static str, text: &'static str) -> Asset {
    asset(path, STYLE, text)
}

const fn script(path: &'static str, text: &'static str) -> Asset {
    asset(path, SCRIPT, text)
}
