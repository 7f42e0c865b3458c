//! The files of the page, beside those of the live page.

use std::sync::OnceLock;

use tickbus_web::Asset;

const SCRIPT: &str = "text/javascript; charset=utf-8";

const OWN: &[Asset] = &[
    Asset {
        path: "/studio",
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

/// The files of the studio and these, which are the live page's.
pub(crate) fn assets(live: &[Asset]) -> &'static [Asset] {
    static ALL: OnceLock<Vec<Asset>> = OnceLock::new();
    ALL.get_or_init(|| OWN.iter().chain(live).copied().collect())
}
