//! Scripts and styles as browsers get them: without comments on lines of their own, and without indentation.

use crate::site::Asset;

/// The text of an asset as it is sent. What has neither comments nor indentation of this kind is sent as it is.
pub fn slim(asset: &Asset) -> String {
    if !asset.kind.starts_with("text/javascript") && !asset.kind.starts_with("text/css") {
        return asset.text.to_owned();
    }
    let mut sent = String::with_capacity(asset.text.len());
    let mut is_comment = false;
    for line in asset.text.lines() {
        let line = line.trim_start();
        is_comment |= line.starts_with("/*");
        if is_comment {
            // Code behind a comment keeps it.
            let Some((_, code)) = line.split_once("*/") else {
                continue;
            };
            is_comment = false;
            if code.trim().is_empty() {
                continue;
            }
        } else if line.is_empty() || line.starts_with("//") {
            continue;
        }
        sent.push_str(line);
        sent.push('\n');
    }
    sent
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_and_indentation_are_left_out_and_nothing_else() {
        let sent = |kind, text| {
            slim(&Asset {
                path: "/x",
                kind,
                text,
            })
        };
        let script = "// A comment.\n\"use strict\";\n\n/**\n * Many lines,\n   of any kind.\n */\nfunction x() {\n  \
                      /** One line. */\n  const a = \"// no comment\"; // one behind code\n  return /* short */ a;\n}\n";
        let expected = "\"use strict\";\nfunction x() {\nconst a = \"// no comment\"; // one behind code\n\
                        return /* short */ a;\n}\n";
        assert_eq!(sent("text/javascript; charset=utf-8", script), expected);
        let style = "/* Two\n   lines. */\na { }\n  b { } /* behind */\n/* before */ c { }\n";
        let expected = "a { }\nb { } /* behind */\n/* before */ c { }\n";
        assert_eq!(sent("text/css; charset=utf-8", style), expected);
        assert_eq!(
            sent("text/html", "<pre>\n  // text\n"),
            "<pre>\n  // text\n"
        );
    }
}
