//! Whole pictures: the parts that stay or go, and the notes.

use super::*;

const SIGNALS: [&str; 4] = ["LA1 position", "Lamp", "Mode: auto", "Phase"];

fn good(body: &str) -> Picture {
    let text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" viewBox=\"0 0 9 9\">\n{body}</svg>"
    );
    read(&text, &SIGNALS).expect("an SVG")
}

#[test]
fn what_draws_stays_as_it_was() {
    let picture = good(
        "<title>A &amp; B &#228;</title><defs><linearGradient id=\"a\"><stop offset=\"0\" style=\"stop-color:#fff\"/></linearGradient></defs>\n\
         <g transform=\"translate(3)\" style=\"fill:url(#a);stroke:none\"><path d=\"M0 0h3\" fill=\"#000\"/><use xlink:href=\"#b\" x=\"1\"/></g>\
         <image href=\"data:image/png;base64,AAAA\" width=\"1\"/><text x=\"1\">x &lt; <tspan>y</tspan></text>",
    );
    assert_eq!(
        picture.svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 9 9\"><title>A &amp; B ä</title>\
         <defs><linearGradient id=\"a\"><stop offset=\"0\" stop-color=\"#fff\"/></linearGradient></defs>\
         <g transform=\"translate(3)\" fill=\"url(#a)\" stroke=\"none\"><path d=\"M0 0h3\" fill=\"#000\"/><use x=\"1\" href=\"#b\"/></g>\
         <image width=\"1\" href=\"data:image/png;base64,AAAA\"/><text x=\"1\">x &lt; <tspan>y</tspan></text></svg>\n"
    );
    assert_eq!(picture.left_out, [""; 0]);
    assert_eq!(picture.mistakes, [""; 0]);
    // A second reading changes nothing.
    assert_eq!(
        read(&picture.svg, &SIGNALS).expect("an SVG").svg,
        picture.svg
    );
}

#[test]
fn what_could_do_harm_is_left_out_and_told() {
    let picture = good(
        "<script>alert(1)</script>\n<rect onclick=\"alert(2)\" ONLOAD=\"x\" width=\"3\"/>\n<foreignObject><div><b/></div></foreignObject>\n\
         <image href=\"http://evil.example/a.png\"/>\n<use xlink:href=\"other.svg#a\"/>\n<a href=\"javascript:alert(3)\"><circle r=\"1\"/></a>\n\
         <rect fill=\"url(http://evil.example)\"/>\n<style>@import 'x';</style>\n<animate attributeName=\"href\" values=\"javascript:x\"/>\n\
         <image href=\"data:image/svg+xml,x\"/><rect style=\"fill:url(//evil.example);stroke:#fff\"/>",
    );
    for word in [
        "script",
        "alert",
        "evil",
        "javascript",
        "foreign",
        "@",
        "onclick",
        "ONLOAD",
        "animate",
        "div",
        "svg+xml",
    ] {
        assert!(!picture.svg.contains(word), "{word}: {}", picture.svg);
    }
    assert!(
        picture.svg.contains("<g><circle r=\"1\"/></g>")
            && picture.svg.contains("<rect stroke=\"#fff\"/>"),
        "{}",
        picture.svg
    );
    let told = [
        "line 2: <script>",
        "line 3: the event handler onclick",
        "line 3: the event handler ONLOAD",
        "line 4: <foreignObject>",
        "line 5: a reference to http://evil.example/a.png",
        "line 6: a reference to other.svg#a",
        "line 7: a reference to javascript:alert(3)",
        "line 8: fill=url(http://evil.example)",
        "line 9: a style sheet that loads something, or has rules beginning with @",
        "line 10: <animate>",
        "line 11: a reference to data:image/svg+xml,x",
        "line 11: a style that loads something: url(//evil.example)",
    ];
    assert_eq!(picture.left_out, told);
}

#[test]
fn a_billion_laughs_are_none() {
    let laughs = (1..10).map(|n| {
        let ten = format!("&lol{};", n - 1).repeat(10);
        format!("<!ENTITY lol{n} \"{ten}\">\n")
    });
    let text = format!(
        "<?xml version=\"1.0\"?>\n<!DOCTYPE svg [\n<!ENTITY lol \"lol\">\n{}]>\n\
         <svg xmlns=\"http://www.w3.org/2000/svg\"><text fill=\"&lol9;\">ha &lol9;</text><rect/></svg>",
        laughs.collect::<String>()
    );
    let picture = read(&text, &[]).expect("an SVG");
    assert_eq!(
        picture.svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\"><text fill=\"\">ha </text><rect/></svg>\n"
    );
    assert_eq!(
        picture.left_out,
        [
            "line 2: the entities of the DOCTYPE",
            "line 14: the entity &lol9;"
        ]
    );
    // The same by elements that show other elements.
    let uses = (1..12).map(|n| {
        let ten = format!("<use href=\"#g{}\"/>", n - 1).repeat(10);
        format!("<g id=\"g{n}\">{ten}</g>")
    });
    let body = format!("<g id=\"g0\"><rect/></g>{}", uses.collect::<String>());
    let picture = good(&body);
    assert!(!picture.svg.contains("href") && picture.svg.contains("<rect/>"));
    assert!(
        picture.left_out[0].contains("references"),
        "{:?}",
        picture.left_out
    );
    for endless in [
        "<g id=\"a\"><use href=\"#a\"/></g>",
        "<pattern id=\"a\"><rect fill=\"url(#a)\"/></pattern>",
    ] {
        assert_eq!(good(endless).left_out.len(), 1, "{endless}");
    }
}

#[test]
fn what_only_editors_need_goes_without_a_word() {
    let text = "<!-- Inkscape --><svg xmlns=\"http://www.w3.org/2000/svg\" \
        xmlns:inkscape=\"http://www.inkscape.org/namespaces/inkscape\" \
        xmlns:sodipodi=\"http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd\" width=\"9mm\" inkscape:version=\"1.3\">\
        <sodipodi:namedview id=\"n\"><inkscape:grid/></sodipodi:namedview><metadata><x:RDF xmlns:x=\"y\"/></metadata>\
        <g inkscape:label=\"Layer 1\" inkscape:groupmode=\"layer\"><rect sodipodi:nodetypes=\"cc\" data-name=\"x\"/></g></svg>";
    let picture = read(text, &[]).expect("an SVG");
    assert_eq!(
        picture.svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"9mm\"><g><rect/></g></svg>\n"
    );
    assert_eq!(picture.left_out, [""; 0]);
}

#[test]
fn what_only_a_picture_that_stands_still_shows_is_not_there() {
    let picture = good(
        "<g data-tb-still=\"\"><rect/></g><circle/><title data-tb-still=\"yes\">at 3 s</title>",
    );
    assert!(
        picture.svg.contains("\"><circle/></svg>"),
        "{}",
        picture.svg
    );
    assert_eq!(picture.left_out, [""; 0]);
}

#[test]
fn bindings_become_data() {
    let picture = good(
        "<g data-tb-y=\"LA1 position: 0..250 -> 0..-180\" data-tb-show=\"Lamp\" data-tb-smooth=\"0.5s\" data-tb-pivot=\"1, 2\">\
         <rect data-tb-fill=\"Mode: auto: on -> red\" data-tb-turn=\"Lamp.edges: 90\"/></g><text data-tb-text=\"bus.age\">x</text>",
    );
    assert_eq!(picture.mistakes, [""; 0]);
    let bindings: Vec<serde_json::Value> = picture
        .svg
        .split("data-tb=\"")
        .skip(1)
        .map(|rest| {
            let text = rest.split('"').next().expect("the end of the attribute");
            serde_json::from_str(&text.replace("&quot;", "\"").replace("&gt;", ">")).expect("JSON")
        })
        .collect();
    assert_eq!(
        bindings,
        [
            serde_json::json!([
                {"do": "y", "signal": "LA1 position", "edges": false, "map": {"cases": [[0.0, 250.0, [0.0, -180.0]]]}},
                {"do": "show", "signal": "Lamp", "edges": false, "map": null},
            ]),
            serde_json::json!([
                {"do": "fill", "signal": "Mode: auto", "edges": false, "map": {"cases": [[1.0, 1.0, "red"]]}},
                {"do": "turn", "signal": "Lamp", "edges": true, "map": {"factor": 90.0, "offset": 0.0}},
            ]),
            serde_json::json!([{"do": "text", "signal": "bus.age", "edges": false, "map": null}]),
        ]
    );
    assert!(
        picture
            .svg
            .contains("data-tb-smooth=\"0.5\" data-tb-pivot=\"1 2\""),
        "{}",
        picture.svg
    );
}

#[test]
fn controls_have_a_signal_and_the_value_of_a_pressed_button() {
    let picture = good(
        "<g data-tb-press=\"Lamp\"/><g data-tb-press=\"Mode: auto: off\"/><g data-tb-press=\"LA1 position: 12.5\"/>\
         <g data-tb-switch=\"Lamp\"/>\n<g data-tb-press=\"Lump\"/><g data-tb-press=\"Lamp.edges\"/><g data-tb-press=\"bus.age\"/>\
         <g data-tb-press=\"Lamp: hard\"/><g data-tb-switch=\"Lamp: on\"/>",
    );
    for binding in [
        "[{do:press,edges:false,map:null,signal:Lamp,to:1.0}]",
        "[{do:press,edges:false,map:null,signal:Mode: auto,to:0.0}]",
        "[{do:press,edges:false,map:null,signal:LA1 position,to:12.5}]",
        "[{do:switch,edges:false,map:null,signal:Lamp,to:1.0}]",
    ] {
        let svg = picture.svg.replace("&quot;", "");
        assert!(svg.contains(binding), "{binding} in {svg}");
    }
    assert_eq!(
        picture.mistakes,
        [
            "line 3: data-tb-press: there is no signal \"Lump\"; did you mean \"Lamp\"?",
            "line 3: data-tb-press: \"Lamp.edges\" is no signal that can be forced",
            "line 3: data-tb-press: \"bus.age\" is no signal that can be forced",
            "line 3: data-tb-press: \"hard\" is no value; write what the signal is while the button is pressed: on, off or a number",
            "line 3: data-tb-switch: a switch has the name of its signal alone, which has to be a BOOL",
        ]
    );
}

#[test]
fn a_misspelt_binding_is_told_with_what_is_nearest() {
    let picture = good(
        "<g data-tb-y=\"LA1 postion: 0..250 -> 0..-180\"/>\n<g data-tb-fil=\"Lamp\"/>\n<g data-tb-show=\"Something else\"/>\n\
         <g data-tb-fill=\"Lamp: green\"/>\n<g data-tb-smooth=\"soon\"/><g data-tb-pivot=\"1\"/>",
    );
    assert_eq!(
        picture.mistakes,
        [
            "line 2: data-tb-y: there is no signal \"LA1 postion\"; did you mean \"LA1 position\"?",
            "line 3: data-tb-fil: nothing can be done by this name; did you mean data-tb-fill?",
            "line 4: data-tb-show: there is no signal \"Something else\"; write the name of a signal as it stands in the driver.cfg",
            "line 5: data-tb-fill: \"green\" is no value and no range; write colours such as off -> #d0d0d0, on -> #20a050, or \
             0..100 -> #0000ff..#ff0000",
            "line 6: data-tb-smooth: \"soon\" is no time; write seconds, from 0 to 60, such as 0.5",
            "line 6: data-tb-pivot: \"1\" is no point; write its two coordinates, such as 120 80.5",
        ]
    );
    assert!(!picture.svg.contains("data-tb"), "{}", picture.svg);
}

#[test]
fn what_is_no_svg_is_refused_with_the_place() {
    for (text, words) in [
        ("", "is no SVG"),
        ("hello", "is no SVG"),
        ("<html/>", "left"),
        ("<svg><g>", "breaks off"),
        ("<svg>\n<g></svg>", "line 2"),
        ("<g/>", "<g>"),
        ("<svg/><svg/>", "<svg>"),
    ] {
        let found = read(text, &[]);
        let told = found
            .as_ref()
            .map_or_else(ToString::to_string, |_| "read".to_owned());
        assert!(words == "left" || told.contains(words), "{text}: {told}");
        assert!(found.is_err(), "{text}");
    }
    assert!(read(&" ".repeat(LIMIT + 1), &[]).is_err());
    let deep = format!("<svg>{}{}</svg>", "<g>".repeat(200), "</g>".repeat(200));
    assert!(
        read(&deep, &[])
            .expect_err("too deep")
            .what
            .contains("more than")
    );
    let many = format!("<svg>{}</svg>", "<g/>".repeat(60_000));
    assert!(read(&many, &[]).is_err());
}

#[test]
fn notes_end_somewhere() {
    let picture = good(&"<script/>".repeat(1000));
    assert_eq!(picture.left_out.len(), MOST_NOTES + 1);
}
