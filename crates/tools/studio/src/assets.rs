//! The files of the page; it uses those of the live page, too.

use tickbus_web::Asset;

const SCRIPT: &str = "text/javascript; charset=utf-8";

pub(crate) const ASSETS: &[Asset] = &[
    Asset {
        path: "/",
        kind: "text/html; charset=utf-8",
        text: include_str!("studio.html"),
    },
    Asset {
        path: "/studio.css",
        kind: "text/css; charset=utf-8",
        text: include_str!("studio.css"),
    },
    Asset {
        path: "/studio.js",
        kind: SCRIPT,
        text: include_str!("studio.js"),
    },
    Asset {
        path: "/cells.js",
        kind: SCRIPT,
        text: include_str!("cells.js"),
    },
    Asset {
        path: "/running.js",
        kind: SCRIPT,
        text: include_str!("running.js"),
    },
    Asset {
        path: "/explore.js",
        kind: SCRIPT,
        text: include_str!("explore.js"),
    },
    Asset {
        path: "/tags.js",
        kind: SCRIPT,
        text: include_str!("tags.js"),
    },
    Asset {
        path: "/bus.js",
        kind: SCRIPT,
        text: include_str!("bus.js"),
    },
];
