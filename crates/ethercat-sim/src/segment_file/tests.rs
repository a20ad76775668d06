use super::*;
use std::path::Path;

fn problems(text: &str) -> Vec<String> {
    match SegmentFile::parse(text) {
        Ok(_) => Vec::new(),
        Err(error) => error.problems.iter().map(Mistake::to_string).collect(),
    }
}

fn shipped(name: &str) -> SegmentFile {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../segments").join(name);
    let text = std::fs::read_to_string(&path).unwrap();
    SegmentFile::parse(&text).unwrap_or_else(|error| panic!("{}:\n{error}", path.display()))
}

#[test]
fn shipped_segments_are_built() {
    for (name, count) in [
        ("three-sgdv.toml", 3),
        ("three-servos.toml", 3),
        ("hundred-servos.toml", 100),
        ("mixed-tree.toml", 9),
    ] {
        let file = shipped(name);
        let segment = file.build(Path::new(".")).unwrap_or_else(|error| panic!("{name}:\n{error}"));
        assert_eq!(segment.sub_devices().len(), count, "{name}");
        let drifts: Vec<f64> = file.sub_devices.iter().map(|entry| entry.piece.dc_drift_ppm).collect();
        assert!(drifts.iter().all(|drift| drift.abs() <= 50.0), "{name}: {drifts:?}");
        assert!(drifts.iter().any(|drift| drift.abs() == 50.0), "{name}: {drifts:?}");
    }
}

#[test]
fn counted_entries_count_names_aliases_and_serials() {
    let file = shipped("hundred-servos.toml");
    let last = &file.sub_devices[99];
    assert_eq!((last.name.as_str(), last.piece.alias, last.piece.serial), ("servo-100", 100, 100));
    assert_eq!(last.plug.parent, Some(98));
    assert_eq!(last.piece.dc_offset_ns, 99 * 1_000_003);
}

#[test]
fn every_problem_is_named_at_its_place() {
    let text = r#"
[[subdevice]]
kind = "sgvd"

[[subdevice]]
kind = "servo"
alais = 3
serial = -1
[subdevice.servo]
inertia_kgm2 = 0.1
rated_torque_n_m = "seven"
rx_pdo = ["6040:16", "607A"]

[[subdevice]]
kind = "digital-io"
parent = "hub"

[[subdevises]]
"#;
    assert_eq!(
        problems(text),
        [
            r#"3:8: "sgvd" is no kind of subdevice; did you mean "sgdv"?; there are sgdv, servo, coupler, digital-io, sii, esi"#,
            r#"7:1: unknown key "alais"; did you mean "alias"?"#,
            r#"8:10: "serial" must be a whole number from 0 to 4294967295, found -1"#,
            r#"10:1: unknown key "inertia_kgm2"; did you mean "inertia_kg_m2"?"#,
            r#"11:20: "rated_torque_n_m" must be a number from 0.000000001 to 1000000, found "seven""#,
            r#"12:22: a mapped object is written as "6041:16", "60C1.1:32" or "pad:8", found "607A""#,
            r#"15:8: digital I/O needs "inputs" or "outputs""#,
            r#"16:10: no subdevice before this one is named "hub""#,
            r#"18:3: unknown key "subdevises"; did you mean "subdevice"?"#,
        ]
    );
}

#[test]
fn broken_toml_and_impossible_mappings_are_problems_too() {
    assert_eq!(problems("[[subdevice]\nkind = \"servo\"").len(), 1);
    let found =
        problems("[[subdevice]]\nkind = \"sgdv\"\n[subdevice.servo]\ntx_pdo = [\"6041:16\", \"6040:16\"]\n");
    assert_eq!(found, ["3:1: mapping 1a00:02: 0x06040041 the object cannot be mapped into the PDO"]);
    let found = problems(
        "[[subdevice]]\nkind = \"sgdv\"\nname = \"a\"\n[[subdevice]]\nkind = \"sgdv\"\nname = \"a\"\n",
    );
    assert_eq!(found, ["6:8: the name \"a\" is taken"]);
}

#[test]
fn a_missing_image_and_a_full_parent_are_named_with_their_entry() {
    let file = SegmentFile::parse("\n[[subdevice]]\nkind = \"sii\"\nsii = \"nowhere.bin\"\n").unwrap();
    let error = file.build(Path::new("/nonexistent")).unwrap_err();
    assert_eq!((error.problems[0].line, error.problems.len()), (2, 1));
    assert!(error.to_string().contains("nowhere.bin"), "{error}");
    let text = "[[subdevice]]\nkind = \"servo\"\nname = \"a\"\n[[subdevice]]\nkind = \"servo\"\n[[subdevice]]\nkind = \"servo\"\nparent = \"a\"\n";
    let error = SegmentFile::parse(text).unwrap().build(Path::new(".")).unwrap_err();
    assert_eq!(error.to_string(), "6:1: \"a\" has no free port");
}

#[test]
fn a_line_of_images_is_a_segment() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/captures"));
    if !folder.is_dir() {
        eprintln!("SKIPPED: {} is missing", folder.display());
        return;
    }
    let images: Vec<Vec<u8>> =
        ["ek1100-sii.bin", "el2828-sii.bin", "el2889-sii.bin", "akd-sii.bin", "akd-broken-strings-sii.bin"]
            .iter()
            .map(|name| std::fs::read(folder.join(name)).unwrap())
            .collect();
    assert_eq!(line_of_images(&images[..3]).unwrap().sub_devices().len(), 3);
    for image in &images {
        assert!(line_of_images(core::slice::from_ref(image)).is_ok());
    }
    assert_eq!(
        line_of_images(&[vec![0; 5]]).unwrap_err().to_string(),
        "image 0: SII image of 5 bytes is shorter than its fixed part of 128"
    );
}
