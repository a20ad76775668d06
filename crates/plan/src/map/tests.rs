use super::*;

const YAML: &str = "image: room.pgm\nresolution: 0.05\norigin: [-1.0, 2.0, 0.5]  # m, rad\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";

fn grey(value: u8) -> Pixel {
    Pixel { grey: value, alpha: 255 }
}
use image::Pixel;

#[test]
fn settings_are_read_as_map_server_writes_them_and_errors_say_where() {
    let settings = Settings::parse(YAML).unwrap();
    assert_eq!((settings.image.as_str(), settings.resolution_m), ("room.pgm", 0.05));
    assert_eq!((settings.origin, settings.mode), ([-1.0, 2.0, 0.5], Mode::Trinary));
    // As the map saver writes a list.
    let listed = "image: \"a b.png\"\nmode: scale\nresolution: 5e-2\norigin:\n- 1.5\n- -2\n- 0\n";
    let listed = Settings::parse(listed).unwrap();
    assert_eq!(
        (listed.image.as_str(), listed.origin, listed.mode),
        ("a b.png", [1.5, -2.0, 0.0], Mode::Scale)
    );
    // As other programs write it: a mark before the text, a comment behind a tab, a word for a number.
    let other = YAML.replace("room.pgm", "room.pgm\t# the image").replace("negate: 0", "negate: True");
    let other = Settings::parse(&format!("\u{feff}{other}")).unwrap();
    assert_eq!((other.image.as_str(), other.negate), ("room.pgm", settings::Negate::WhiteIsOccupied));
    for (text, expected) in [
        (
            YAML.replace("0.05", "five"),
            "line 2: resolution: expected the side of a pixel in m, as 0.05, found `five`",
        ),
        (
            YAML.replace("[-1.0, 2.0, 0.5]", "[-1.0, 2.0]"),
            "line 3: origin: expected [x, y, yaw] in m and rad, found `[-1.0, 2.0]`",
        ),
        (YAML.replace("negate: 0", "negate: 2"), "line 4: negate: expected 0, 1, true or false, found `2`"),
        (
            YAML.replace("0.65", "1.65"),
            "line 5: occupied_thresh: expected a number from 0 to 1, found `1.65`",
        ),
        (YAML.replace("0.65", "0.1"), "free_thresh 0.196 is above occupied_thresh 0.1"),
        (format!("{YAML}mode: grey"), "line 7: mode: expected trinary, scale or raw, found `grey`"),
        (
            format!("{YAML}speed: 1"),
            "line 7: no key of a map is called `speed`: there are image, resolution, origin, occupied_thresh, free_thresh, negate, mode",
        ),
        (format!("{YAML}negate: 0"), "line 7: negate stands there twice"),
        (format!("{YAML}nothing"), "line 7: expected `key: value`, found `nothing`"),
        ("image: a.pgm".into(), "resolution is missing: expected `resolution: 0.05`"),
        (YAML.replace("0.05", "1e9"), ""),
    ] {
        match Settings::parse(&text) {
            Err(error) => assert_eq!(error.to_string(), expected),
            Ok(settings) => {
                let image = Image { width: 1, height: 1, pixels: vec![grey(0)] };
                let error = Map::of_image(&settings, &image, Unknown::Blocked).unwrap_err().to_string();
                assert_eq!(error, "side of a cell: expected 0.0001 m to 10 m, found 1000000000 m");
            }
        }
    }
}

#[test]
fn modes_make_of_grey_what_map_server_makes() {
    let mut settings = Settings::parse(YAML).unwrap();
    // Black, the greys around the thresholds, white: occupancy is 1 - grey/255.
    assert_eq!(settings.cell(grey(0)), Cell::Occupancy(100));
    assert_eq!(settings.cell(grey(89)), Cell::Occupancy(100));
    assert_eq!(settings.cell(grey(90)), Cell::Unknown);
    assert_eq!(settings.cell(grey(205)), Cell::Unknown);
    assert_eq!(settings.cell(grey(206)), Cell::Occupancy(0));
    settings.negate = settings::Negate::WhiteIsOccupied;
    assert_eq!(settings.cell(grey(255)), Cell::Occupancy(100));
    assert_eq!(settings.cell(grey(0)), Cell::Occupancy(0));
    settings.negate = settings::Negate::BlackIsOccupied;
    settings.mode = Mode::Scale;
    // (1 - 150/255 - 0.196) / (0.65 - 0.196) = 47.5 %.
    assert_eq!(settings.cell(grey(150)), Cell::Occupancy(48));
    assert_eq!(settings.cell(Pixel { grey: 0, alpha: 254 }), Cell::Unknown);
    settings.mode = Mode::Raw;
    assert_eq!(settings.cell(grey(70)), Cell::Occupancy(70));
    assert_eq!(settings.cell(grey(101)), Cell::Unknown);
}

#[test]
fn plain_and_raw_pgm_and_png_are_the_same_picture_and_the_first_row_is_the_farthest() {
    let plain = Image::read(b"P2 # by hand\n3 2\n# two rows\n255\n0 128 255\n255 255 0\n").unwrap();
    let raw = Image::read(b"P5\n3 2\n255\n\x00\x80\xff\xff\xff\x00").unwrap();
    let wide = Image::read(b"P5 3 2 65535\n\x00\x00\x80\x80\xff\xff\xff\xff\xff\xff\x00\x00").unwrap();
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 3, 2);
    encoder.set_color(png::ColorType::Rgb);
    let bytes: Vec<u8> = [0, 128, 255, 255, 255, 0].iter().flat_map(|grey| [*grey; 3]).collect();
    encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
    assert_eq!(plain, raw);
    assert_eq!(plain, wide);
    assert_eq!(plain, Image::read(&png).unwrap());
    let settings = Settings::parse(&YAML.replace("0.5]", "0.0]")).unwrap();
    let map = Map::of_image(&settings, &plain, Unknown::Free).unwrap();
    assert_eq!(map.blocked, [false, false, true, true, false, false]);
    let unknown = Map::of_image(&settings, &plain, Unknown::Blocked).unwrap();
    assert_eq!(unknown.blocked, [false, false, true, true, true, false]);
    // The lower left corner of the lower left pixel is the origin.
    let [x_m, y_m] = map.centre_m(2, 1);
    assert!((x_m - (-1.0 + 0.125)).abs() < 1e-12 && (y_m - (2.0 + 0.075)).abs() < 1e-12, "{x_m} {y_m}");
    // Turned by a quarter, x goes where y went.
    let turned = Settings::parse(&YAML.replace("0.5]", "1.5707963267948966]")).unwrap();
    let [x_m, y_m] = Map::of_image(&turned, &plain, Unknown::Free).unwrap().centre_m(2, 1);
    assert!((x_m - (-1.0 - 0.075)).abs() < 1e-12 && (y_m - (2.0 + 0.125)).abs() < 1e-12, "{x_m} {y_m}");
}

#[test]
fn bad_images_are_told_with_what_where_expected_and_found() {
    for (bytes, expected) in [
        (
            &b"GIF89a"[..],
            "expected a PGM file (P2 or P5) or a PNG file, found a file that begins with \"GIF8\"",
        ),
        (b"", "expected a PGM file (P2 or P5) or a PNG file, found a file that begins with nothing"),
        (b"P2\n3 x", "byte 5: height: expected 1 to 16777216, found \"x\""),
        (b"P2\n3 2\n255\n0 1 2", "expected 6 pixels of 3 by 2, found 3"),
        (b"P2\n3 1\n255\n0 1 256", "byte 15: grey: expected 0 to 255, found \"256\""),
        (b"P5\n3 2\n255\n\x00\x01", "expected 6 pixels of 3 by 2, found 2"),
        (b"P5\n2 1\n100\n\x00\xff", "byte 12: grey: expected 0 to 100, found 255"),
        (b"P5\n16777216 16777216\n255\n", "expected 1 to 16777216 pixels, found 16777216 by 16777216"),
        (b"P5\n3", "byte 4: height: expected 1 to 16777216, found the end of the file"),
    ] {
        let error = Image::read(bytes).unwrap_err().to_string();
        assert_eq!(error, expected);
    }
    let png = Image::read(b"\x89PNG\r\n\x1a\n\x00\x00").unwrap_err().to_string();
    assert!(png.starts_with("PNG: "), "{png}");
}

/// Whether a cell is blocked by dense looking: many places in it.
fn touches(map: &Map, at: usize, holds: impl Fn(Point) -> bool) -> bool {
    let (column, row) = ((at % map.width) as f64, (at / map.width) as f64);
    let parts = (0..=20).map(|part| (f64::from(part) / 20.0).clamp(1e-6, 1.0 - 1e-6));
    parts
        .clone()
        .any(|px| parts.clone().any(|py| holds([(column + px) * map.cell_m, (row + py) * map.cell_m])))
}

#[test]
fn circles_and_polygons_block_each_cell_that_they_touch() {
    let empty = Map::empty([30, 20], 0.1).unwrap();
    let mut circle = empty.clone();
    circle.block_circle([1.23, 0.71], 0.34);
    let mut polygon = empty.clone();
    let corners = [[0.31, 0.27], [2.2, 0.4], [1.1, 0.93], [1.9, 1.7]];
    polygon.block_polygon(&corners);
    let polygon = polygon.touched().into_owned();
    let mut room = empty.clone();
    room.keep_inside(&corners);
    let is_inside = |[x, y]: Point| {
        let crosses = |number: usize| {
            let (from, to): (Point, Point) = (corners[number], corners[(number + 1) % 4]);
            (from[1] > y) != (to[1] > y)
                && x < from[0] + (y - from[1]) / (to[1] - from[1]) * (to[0] - from[0])
        };
        (0..4).filter(|number| crosses(*number)).count() % 2 == 1
    };
    let mut wrong = 0;
    for (at, polygon) in polygon.iter().enumerate() {
        // Dense looking misses what only just touches: it must never see more.
        let seen = touches(&empty, at, |[x, y]| (x - 1.23).hypot(y - 0.71) <= 0.34);
        assert!(circle.blocked[at] || !seen, "circle, cell {at}");
        wrong += usize::from(circle.blocked[at] && !seen);
        let (inside, outside) =
            (touches(&empty, at, is_inside), touches(&empty, at, |place| !is_inside(place)));
        assert!(*polygon || !inside, "polygon, cell {at}");
        wrong += usize::from(*polygon && !inside);
        assert!(room.blocked[at] || !outside, "room, cell {at}");
        wrong += usize::from(room.blocked[at] && !outside);
    }
    assert!(wrong <= 5, "{wrong} cells are blocked without need");
}

#[test]
fn a_room_of_whole_cells_is_free_up_to_its_walls() {
    let map = Map::of_room(&[[-1.0, -0.5], [1.0, -0.5], [1.0, 0.5], [-1.0, 0.5]], 0.1).unwrap();
    let free = map.blocked.iter().filter(|blocked| !**blocked).count();
    assert_eq!((map.width, map.height, free), (22, 12, 200));
    let [x_m, y_m] = map.centre_m(1, 1);
    assert!((x_m + 0.95).abs() < 1e-9 && (y_m + 0.45).abs() < 1e-9);
}

#[test]
fn rectangles_are_all_occupied_cells_and_where_they_would_be_many_larger_ones_that_hold_them() {
    let mut map = Map::empty([37, 23], 0.5).unwrap();
    map.map_from_grid = Pose2::new(-3.0, 2.0, 0.0);
    map.block_circle([5.0, 8.0], 2.3);
    map.block_circle([1.0, 3.2], 0.8);
    let covers = |rectangles: &[[Point; 4]], at: usize| {
        let [x, y] = map.centre_m(at % map.width, at / map.width);
        rectangles
            .iter()
            .filter(|[low, _, high, _]| (low[0]..high[0]).contains(&x) && (low[1]..high[1]).contains(&y))
            .count()
    };
    let all = map.rectangles(1000);
    assert!(all.len() < 40, "{}", all.len());
    let few = map.rectangles(6);
    assert!((1..=6).contains(&few.len()));
    for at in 0..map.blocked.len() {
        assert_eq!(covers(&all, at), usize::from(map.blocked[at]), "cell {at}");
        assert!(covers(&few, at) <= 1 && (covers(&few, at) == 1 || !map.blocked[at]), "cell {at}");
    }
    assert!(Map::empty([5, 5], 0.1).unwrap().rectangles(10).is_empty());
}

#[test]
fn of_a_convex_polygon_the_distance_is_that_of_its_nearest_side() {
    let mut state = 2_u64;
    let mut next = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 33) as f64 / (1_u64 << 31) as f64
    };
    let mut inside = 0;
    for _ in 0..300 {
        let turn = next(0.0, 6.0);
        let mut corners: Vec<Point> = [0.0, 1.3, 2.9, 4.4]
            .map(|part: f64| [3.0 * (turn + part).cos(), 2.0 * (turn + part).sin()])
            .to_vec();
        let convex = Solid::new(corners.clone());
        assert_eq!(convex.normals().len(), 4);
        // Either way around, and with a corner twice, which makes it one that isn't known to be convex.
        let reversed = Solid::new(corners.iter().rev().copied().collect());
        corners.push(corners[3]);
        let other = Solid::new(corners);
        assert!(other.normals().is_empty());
        for _ in 0..30 {
            let place = [next(-5.0, 5.0), next(-4.0, 4.0)];
            let expected = other.distance(place, 9.0);
            for (solid, enough) in [(&convex, 9.0), (&reversed, 9.0), (&convex, 0.5)] {
                let found = solid.distance(place, enough);
                assert!(
                    (found.min(enough) - expected.min(enough)).abs() < 1e-9,
                    "{place:?}: {found}, {expected}"
                );
            }
            inside += usize::from(expected == 0.0);
        }
    }
    assert!(inside > 500, "{inside}");
}
