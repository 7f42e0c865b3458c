//! The files of the page.

use tickbus_web::Asset;

/// The page itself, its styles and its scripts; files shared with the report and the room come from there.
pub(crate) const ASSETS: &[Asset] = &[
    Asset::page(include_str!("page.html")),
    Asset::style("/report.css", tickbus_report::STYLE),
    Asset::style("/live.css", include_str!("page.css")),
    Asset::style("/analyser.css", include_str!("analyser.css")),
    Asset::style("/views.css", include_str!("views.css")),
    Asset::script("/stream.js", tickbus_web::STREAM),
    Asset::script("/client.js", tickbus_web::CLIENT),
    Asset::script("/head.js", tickbus_web::HEAD),
    Asset::style("/room.css", tickbus_web::STYLE),
    Asset::script("/lookup.js", tickbus_report::LOOKUP),
    Asset::script("/draw.js", tickbus_report::DRAW),
    Asset::script("/elements.js", tickbus_web::ELEMENTS),
    Asset::script("/signals.js", include_str!("signals.js")),
    Asset::script("/trend.js", include_str!("trend.js")),
    Asset::script("/sparks.js", include_str!("sparks.js")),
    Asset::script("/views.js", include_str!("views.js")),
    Asset::script("/watch.js", include_str!("watch.js")),
    Asset::script("/sets.js", include_str!("sets.js")),
    Asset::script("/rows.js", include_str!("rows.js")),
    Asset::script("/format.js", include_str!("format.js")),
    Asset::script("/list.js", include_str!("list.js")),
    Asset::script("/outage.js", include_str!("outage.js")),
    Asset::script("/line.js", include_str!("line.js")),
    Asset::script("/picture.js", include_str!("picture.js")),
    Asset::script("/touch.js", include_str!("touch.js")),
    Asset::script("/pads.js", include_str!("pads.js")),
    Asset::script("/bar.js", include_str!("bar.js")),
    Asset::script("/trigger.js", include_str!("trigger.js")),
    Asset::script("/analyser.js", include_str!("analyser.js")),
    Asset::script("/live.js", include_str!("live.js")),
];

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
