//! `omnibase plan`: a way through a room, driven, and why there is none.

use super::{Folder, json, omnibase, prints, refused, words};

const OFFICE: [&str; 4] = ["plan", "robots/bmm.toml", "--map", "robots/maps/office.yaml"];

#[test]
fn a_way_through_an_office_is_found_drawn_written_and_driven() {
    let folder = Folder::new("plan");
    let (points, picture) = (folder.path("way.dat"), folder.path("way.svg"));
    let to = ["--to", "3 2.3 0.8", "--write", &points, "--picture", &picture, "--json"];
    let way = json(&[&OFFICE[..], &to].concat());
    // Straight it is 3.78 m; a cupboard stands between.
    let length_m = way["length_m"].as_f64().unwrap();
    assert!(way["found"] == true && (3.8..4.6).contains(&length_m), "{length_m} m");
    let end = way["poses"].as_array().unwrap().last().unwrap().as_array().unwrap();
    let end: Vec<f64> = end.iter().filter_map(serde_json::Value::as_f64).collect();
    assert!((end[0] - 3.0).abs() + (end[1] - 2.3).abs() + (end[2] - 0.8).abs() < 1e-9, "{end:?}");
    let svg = std::fs::read_to_string(&picture).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("<polygon") && svg.ends_with("</svg>\n"));
    assert!(svg.contains(">start</text>") && svg.contains(">goal</text>"));
    let driven = prints(&["run", "robots/bmm.toml", "--path", &points, "--timing", "fastest"]);
    assert!(driven.contains("final"), "{driven}");
}

#[test]
fn where_there_is_no_way_or_no_map_the_reason_is_said() {
    let (code, text) = refused(&[&OFFICE[..], &["--to", "1.6 1.2 0"]].concat());
    assert_eq!(code, Some(1));
    assert!(
        text.contains("goal (1.600, 1.200, 0.000): the footprint touches what is in the way there"),
        "{text}"
    );
    let (code, text) = refused(&[&OFFICE[..], &["--to", "3 2.3 0.8", "--within", "0"]].concat());
    assert!(code == Some(1) && text.contains("no way was found in the time that was given for it"), "{text}");
    let (code, text) = refused(&[&OFFICE[..], &["--to", "3 2.3 0.8", "--within=-1"]].concat());
    assert!(code == Some(2) && text.contains("expected seconds, 0 or more"), "{text}");
    let (code, text) = refused(&[&OFFICE[..], &["--to", "far"]].concat());
    assert!(code == Some(2) && text.contains("--to \"far\": expected x m, y m"), "{text}");
    let folder = Folder::new("plan-bad");
    let map = folder.file("bad.yaml", "image: none.pgm\nresolution: 0.05\norigin: [0, 0]\n");
    let output = omnibase(&["plan", "robots/bmm.toml", "--map", &map, "--to", "1 0 0"]);
    let text = words(&output.stderr);
    assert!(text.contains("line 3: origin: expected [x, y, yaw] in m and rad, found `[0, 0]`"), "{text}");
    let polygon = "map.blocked_m=[[[1.0, 0.0], [2.0, 0.0]]]";
    let (_, text) = refused(&["plan", "robots/bmm.toml", "--set", polygon, "--to", "1 0 0"]);
    assert!(
        text.contains("a polygon covers some floor") && text.contains("polygon 0 with 2 corners"),
        "{text}"
    );
}
