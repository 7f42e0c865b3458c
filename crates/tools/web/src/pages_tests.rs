//! Several pages in one room.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::site::{State, Tab, Verb};

/// A page that keeps the changes that it gets.
struct Toy {
    assets: Vec<Asset>,
    tabs: Vec<Tab>,
    got: Mutex<Vec<String>>,
    viewers: AtomicUsize,
}

impl Site for Toy {
    fn assets(&self) -> &[Asset] {
        &self.assets
    }

    fn look(&self, _: Answer<State>) {}

    fn is_private(&self, path: &str) -> bool {
        path.starts_with("/secret")
    }

    fn longest_body(&self, _: &str) -> usize {
        self.assets.len()
    }

    fn tabs(&self) -> Vec<Tab> {
        self.tabs.clone()
    }

    fn heard(&self, viewers: usize) {
        self.viewers.store(viewers, Ordering::Relaxed);
    }

    fn change(&self, change: Change, answer: Answer<Outcome>) {
        self.got.lock().expect("no panic").push(change.path);
        answer.give(Ok(()));
    }
}

/// A page with these files.
fn toy(files: &[(&'static str, &'static str)]) -> Arc<Toy> {
    let asset = |&(path, text)| Asset {
        path,
        kind: "text/plain",
        text,
    };
    Arc::new(Toy {
        assets: files.iter().map(asset).collect(),
        tabs: Vec::new(),
        got: Mutex::default(),
        viewers: AtomicUsize::new(0),
    })
}

#[test]
fn a_room_without_a_first_page_leads_to_another_one() {
    let pages = Pages::default();
    assert_eq!(pages.instead_of_first(), None);
    let _nets = pages.join(Page::new("Nets", "/nets", toy(&[])));
    let _board = pages.join(Page::new("Board", "/board", toy(&[])));
    assert_eq!(pages.instead_of_first().as_deref(), Some("/nets"));
    let _first = pages.join(Page::new("Live page", "/", toy(&[])));
    assert_eq!(pages.instead_of_first(), None);
}

fn put(pages: &Pages, path: &str) {
    let change = Change {
        verb: Verb::Put,
        path: path.to_owned(),
        body: String::new(),
    };
    pages.change(change, Answer::new().0);
}

fn text(pages: &Pages, path: &str) -> Option<&'static str> {
    pages.asset(path).map(|asset| asset.text)
}

fn names(pages: &Pages) -> Vec<String> {
    let tabs = pages.tabs();
    let tabs = tabs.as_array().expect("a list").iter();
    tabs.map(|tab| format!("{} {}", tab["path"], tab["name"]).replace('"', ""))
        .collect()
}

#[test]
fn each_page_has_its_paths() {
    let live = toy(&[("/", "live"), ("/shared.js", "shared"), ("/x", "of live")]);
    let board = toy(&[("/", "board"), ("/board.js", "script"), ("/x", "of board")]);
    let pages = Pages::of("Live page", Arc::clone(&live) as _);
    let joined = pages.join(Page::new("Board", "/board", Arc::clone(&board) as _));
    assert_eq!(joined.path(), "/board");
    for (path, expected) in [
        ("/", Some("live")),
        ("/board", Some("board")),
        ("/board/", Some("board")),
        ("/board/x", Some("of board")),
        ("/x", Some("of live")),
        // A script is found without its page's path, and a page only at its own.
        ("/board.js", Some("script")),
        ("/board/shared.js", None),
        ("/boards", None),
    ] {
        assert_eq!(text(&pages, path), expected, "{path}");
    }
    put(&pages, "/board/patch/A:I1");
    put(&pages, "/boards");
    assert_eq!(*board.got.lock().expect("no panic"), ["/patch/A:I1"]);
    assert_eq!(*live.got.lock().expect("no panic"), ["/boards"]);
    assert!(pages.is_private("/board/secret"));
    assert!(!pages.is_private("/board/x/secret"));
    pages.heard(3);
    for page in [&live, &board] {
        assert_eq!(page.viewers.load(Ordering::Relaxed), 3);
    }

    drop(joined);
    assert_eq!(text(&pages, "/board"), None);
    assert_eq!(text(&pages, "/board.js"), None);
    assert_eq!(names(&pages), ["/ Live page"]);
}

#[test]
fn the_page_of_a_path_says_how_large_a_body_is() {
    let pages = Pages::of("Live page", toy(&[]));
    let _joined = pages.join(Page::new("Board", "/board", toy(&[("/", "board")])));
    assert_eq!(pages.longest_body("/x"), Some(0));
    assert_eq!(pages.longest_body("/board/x"), Some(1));
    assert_eq!(Pages::default().longest_body("/board/x"), None);
}

#[test]
fn a_path_that_is_taken_gets_a_number() {
    let pages = Pages::default();
    let first = pages.join(Page::new("Board", "/board", toy(&[("/", "first")])));
    let second = pages.join(Page::new("Board", "/board", toy(&[("/", "second")])));
    assert_eq!(names(&pages), ["/board Board", "/board-2 Board"]);
    drop(first);
    assert_eq!(text(&pages, second.path()), Some("second"));
    assert_eq!(text(&pages, "/"), None);
}

#[test]
fn several_pages_of_a_kind_have_a_path_each_and_the_first_one_that_of_the_kind() {
    let pages = Pages::of("Live page", toy(&[("/", "live")]));
    let join_site = |id, name, site| {
        let page = Page::new("Studio", "/studio", site);
        pages.join(page.one_of_several(id, name))
    };
    let join = |id, name, text| join_site(id, name, toy(&[("/", text)]));
    let seven = join("7", "Left", "seven");
    assert_eq!(names(&pages), ["/ Live page", "/studio Studio"]);
    let right = toy(&[("/", "eight")]);
    let _eight = join_site("8", "Right", Arc::clone(&right) as _);
    assert_eq!(
        names(&pages)[1..],
        ["/studio/of/7 Studio: Left", "/studio/of/8 Studio: Right"]
    );
    assert_eq!(text(&pages, "/studio"), Some("seven"));
    assert_eq!(text(&pages, "/studio/of/8"), Some("eight"));
    drop(seven);
    assert_eq!(text(&pages, "/studio"), Some("eight"));
    // Another driver's studio does not stand in for it.
    assert_eq!(text(&pages, "/studio/of/7"), None);
    put(&pages, "/studio/of/7/cell");
    put(&pages, "/studio/cell");
    assert_eq!(*right.got.lock().expect("no panic"), ["/cell"]);
}

#[test]
fn a_page_can_have_several_tabs() {
    let mut live = toy(&[]);
    let tab = |name: &str, fragment: &str| Tab {
        name: name.to_owned(),
        fragment: fragment.to_owned(),
        is_wide: fragment.is_empty(),
    };
    let own = vec![tab("Machine", ""), tab("Signals", "#signals")];
    Arc::get_mut(&mut live).expect("the only one").tabs = own;
    let pages = Pages::of("Live page", live);
    let _board = pages.join(Page::new("Board", "/board", toy(&[])));
    assert_eq!(
        names(&pages),
        ["/ Machine", "/#signals Signals", "/board Board"]
    );
    let tabs = pages.tabs();
    assert_eq!([&tabs[0]["wide"], &tabs[1]["wide"]], [true, false]);
}
