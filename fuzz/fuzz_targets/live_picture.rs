//! Any text as a picture of the live page.
//!
//! Nothing may panic, what comes out is harmless, and what is harmless comes out as it is.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus_live_page::picture;

const SIGNALS: [&str; 3] = ["Lamp", "LA1 position", "a: b"];

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    let Ok(picture) = picture::read(text, &SIGNALS) else {
        return;
    };
    let svg = &picture.svg;
    for element in [
        "<script",
        "<foreignObject",
        "<iframe",
        "<animate",
        "<set",
        "<a>",
        "<a ",
        "<!",
        "<?",
    ] {
        assert!(!svg.contains(element), "{element} in {svg}");
    }
    // What is left of tags and their attributes: texts have their "<" and quotes escaped.
    for tag in svg
        .split('<')
        .skip(1)
        .filter_map(|rest| rest.split('>').next())
    {
        let mut outside = true;
        for (at, part) in tag.split('"').enumerate() {
            outside = at % 2 == 0;
            let name = part
                .rsplit(' ')
                .next()
                .and_then(|name| name.strip_suffix('='));
            let name = name.unwrap_or_default().to_ascii_lowercase();
            assert!(
                !outside || !name.starts_with("on") && name != "style" && name != "src",
                "{name} in {svg}"
            );
            if !outside {
                let before = tag.split('"').nth(at - 1).unwrap_or_default();
                assert!(
                    !before.ends_with(" href=")
                        || part.starts_with('#')
                        || part.trim_start().starts_with("data:image/"),
                    "{part}"
                );
            }
        }
        assert!(outside, "a quote is open in {svg}");
    }
    let again = picture::read(svg, &[]).expect("what was written is read");
    assert!(again.left_out.is_empty(), "{:?} of {svg}", again.left_out);
    assert!(again.mistakes.is_empty(), "{:?} of {svg}", again.mistakes);
});
