//! The files of the page.

use tickbus_web::Asset;

const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

/// The page itself, its styles and its scripts; files shared with the report and the room come from there.
pub(crate) const ASSETS: &[Asset] = &[
    Asset {
        path: "/",
        kind: "text/html; charset=utf-8",
        text: include_str!("page.html"),
    },
    Asset {
        path: "/report.css",
        kind: STYLE,
        text: tickbus_report::STYLE,
    },
    Asset {
        path: "/live.css",
        kind: STYLE,
        text: include_str!("page.css"),
    },
    Asset {
        path: "/analyser.css",
        kind: STYLE,
        text: include_str!("analyser.css"),
    },
    Asset {
        path: "/views.css",
        kind: STYLE,
        text: include_str!("views.css"),
    },
    script("/stream.js", tickbus_web::STREAM),
    script("/client.js", tickbus_web::CLIENT),
    script("/head.js", tickbus_web::HEAD),
    Asset {
        path: "/room.css",
        kind: STYLE,
        text: tickbus_web::STYLE,
    },
    script("/lookup.js", tickbus_report::LOOKUP),
    script("/draw.js", tickbus_report::DRAW),
    script("/elements.js", tickbus_web::ELEMENTS),
    script("/signals.js", include_str!("signals.js")),
    script("/trend.js", include_str!("trend.js")),
    script("/views.js", include_str!("views.js")),
    script("/watch.js", include_str!("watch.js")),
    script("/sets.js", include_str!("sets.js")),
    script("/rows.js", include_str!("rows.js")),
    script("/format.js", include_str!("format.js")),
    script("/list.js", include_str!("list.js")),
    script("/outage.js", include_str!("outage.js")),
    script("/line.js", include_str!("line.js")),
    script("/picture.js", include_str!("picture.js")),
    script("/touch.js", include_str!("touch.js")),
    script("/pads.js", include_str!("pads.js")),
    script("/bar.js", include_str!("bar.js")),
    script("/trigger.js", include_str!("trigger.js")),
    script("/analyser.js", include_str!("analyser.js")),
    script("/live.js", include_str!("live.js")),
];

const fn script(path: &'static str, text: &'static str) -> Asset {
    Asset {
        path,
        kind: SCRIPT,
        text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_at_most_250_kilobytes() {
        let sizes = ASSETS.iter().map(|asset| tickbus_web::slim(asset).len());
        let size: usize = sizes.sum();
        assert!(size <= 250_000, "{size} bytes");
    }
}
