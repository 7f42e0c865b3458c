//! Lists of signals over HTTP.

use std::fs;
use std::time::Duration;

use serde_json::json;

use super::{EVER, Page, Simulation};

#[test]
fn a_list_is_saved_only_with_the_token_and_seen_by_all() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("cell.lists.toml");
    let page = Page::open();
    let pause = Duration::from_millis(1);
    let _simulation =
        Simulation::start_beside(Some(path.clone()), "", pause, &page, (7, "Cell"), EVER);
    assert_eq!(page.get("/signals")["drivers"][0]["lists"], true);
    let list =
        json!({ "name": "a", "pins": ["out"], "group": "none", "order": "file", "formats": {} });
    let body = json!({ "was": null, "is": list }).to_string();
    let (status, _) = page.ask("PUT /lists/7/list", "", &body);
    assert_eq!(status, 401);
    assert!(!path.exists());
    let (status, text) = page.change("PUT /lists/7/list", &body);
    assert_eq!(status, 200, "{text}");
    assert_eq!(page.get("/lists/7")["lists"], json!([list]));
    let text = fs::read_to_string(&path).expect("the file");
    assert!(text.contains("pins = [\n    \"out\",\n]"), "{text}");
    for (line, body, code) in [
        ("PUT /lists/8/list", &*body, 404),
        ("PUT /lists/7/lost", &body, 404),
        ("PUT /lists/7/list", "{}", 400),
        ("PUT /lists/7/list", "{\"is\": 5}", 400),
        ("DELETE /lists/7/list", "", 405),
    ] {
        let (status, text) = page.change(line, body);
        assert_eq!(status, code, "{line}: {text}");
    }
    assert_eq!(fs::read_to_string(&path).expect("the file"), text);
}

#[test]
fn a_driver_without_a_place_for_lists_has_none() {
    let page = Page::open();
    let _simulation = Simulation::start(&page, 1, "Cell", EVER);
    assert_eq!(page.get("/signals")["drivers"][0]["lists"], false);
    assert_eq!(page.ask("GET /lists/1", "", "").0, 404);
    assert_eq!(page.change("PUT /lists/1/list", "{}").0, 404);
}
