//! The page of a run: what it shows, of whole, odd and hostile recordings.

mod made_up;

use made_up::{BELIEVED_OFF_M, HEADING_OFF_RAD, TRUE_OFF_M, square};
use omnibase_record::report::{Digest, TrackingFigures, html};
use omnibase_record::run::{McapRun, RecordedRun, RunEvent};
use std::io::Cursor;

/// One lap of the square with its rests, in cycles.
const LAP: usize = 18_000;

/// As a browser shows them: the words of a page without its tags.
fn words(html: &str) -> String {
    let body = html.split("</style>").nth(1).unwrap();
    let pieces = body.split('<').map(|piece| piece.split_once('>').map_or(piece, |(_, text)| text));
    pieces.collect::<Vec<_>>().join(" ").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The curves of the class below a heading, as the points of their paths.
fn curve(html: &str, caption: &str, class: &str) -> Vec<(f64, f64)> {
    let figure = html.split("<figcaption>").find(|figure| figure.starts_with(caption)).expect("the figure");
    let data = figure.split("class=\"data\"").nth(1).unwrap();
    let path = data.split(&format!("<path class=\"{class}\" d=\"")).nth(1).expect("the curve");
    let path = path.split('"').next().unwrap();
    let numbers: Vec<f64> = path
        .split(|c: char| "MLHVhZ ".contains(c))
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().unwrap())
        .collect();
    numbers.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect()
}

#[test]
fn figures_are_those_of_the_run() {
    let figures = TrackingFigures::of(&square(3, LAP));
    let close = |found: Option<f64>, expected: f64| {
        let found = found.unwrap();
        assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
    };
    close(figures.final_error_m.believed, BELIEVED_OFF_M);
    close(figures.rms_error_m.believed, BELIEVED_OFF_M);
    close(figures.max_error_m.believed, BELIEVED_OFF_M);
    close(figures.final_heading_error_rad.believed, -HEADING_OFF_RAD);
    close(figures.final_error_m.truth, TRUE_OFF_M);
    close(figures.final_heading_error_rad.truth, 2.0 * HEADING_OFF_RAD);
    // A true error that grows in step with time, sampled at n instants: 1/n² (0² + 1² + … + (n-1)²) of its end's square.
    let n = 16_000.0_f64;
    close(figures.rms_error_m.truth, TRUE_OFF_M * ((n - 1.0) * (2.0 * n - 1.0) / 6.0).sqrt() / n);
    close(figures.max_error_m.truth, TRUE_OFF_M * (n - 1.0) / n);
}

#[test]
fn walls_fence_and_obstacles_lie_where_the_description_says() {
    let mut run = square(3, LAP);
    let bare = html(&run);
    for (key, text) in [
        ("fence_m", "-3 -3; 3 -3; 3 3; -3 3"),
        ("walls_m", "1 1; 2 1; 2 1.5 | -2 0; -1 0; -1 3; -2 3"),
        ("obstacles_m", "0 1.5 0.3"),
    ] {
        run.description.insert(key.to_owned(), text.to_owned());
    }
    let page = html(&run);
    let fence = curve(&page, "Path from above", "fence");
    // From the drawing to the floor: two opposite corners of the fence.
    let [(left, low), (right, high)] = [fence[0], fence[2]];
    let floor = |(x, y): (f64, f64)| {
        [-3.0 + 6.0 * (x - left) / (right - left), -3.0 + 6.0 * (y - low) / (high - low)]
    };
    let expected = [[1.0, 1.0], [2.0, 1.0], [2.0, 1.5], [-2.0, 0.0], [-1.0, 0.0], [-1.0, 3.0], [-2.0, 3.0]];
    let walls = curve(&page, "Path from above", "wall");
    assert_eq!(walls.len(), expected.len());
    for (wall, [x, y]) in walls.into_iter().map(floor).zip(expected) {
        assert!((wall[0] - x).abs() < 0.01 && (wall[1] - y).abs() < 0.01, "{wall:?} for {x} {y}");
    }
    for [x, y] in curve(&page, "Path from above", "obstacle").into_iter().map(floor) {
        assert!((x.hypot(y - 1.5) - 0.3).abs() < 0.01, "{x} {y}");
    }
    for word in ["walls", "fence", "obstacles"] {
        assert!(words(&page).contains(word) && !words(&bare).contains(word), "{word}");
    }
}

#[test]
fn the_page_tells_figures_limits_events_and_phases() {
    let run = square(3, LAP);
    let words = words(&html(&run));
    let latest = run.column("/timing", "round_trip_ns").unwrap().fold(0.0, f64::max);
    let latest = format!("max {:.0} us", latest / 1000.0);
    for expected in [
        &latest,
        "bmm: square of 2 m",
        "controller closed_loop_speed",
        "Final position 0.300 mm 2.000 mm",
        "Greatest position 0.300 mm 2.000 mm",
        "Final heading −1.000 mrad (−0.0573°) 2.000 mrad (0.1146°)",
        "Cycles 18 000",
        "Times real time 412",
        "limit ±15.0 rad/s",
        "rated ±7.00 N·m",
        "1.000 tracking square",
        "Phase error of the frames by the distributed clock phase",
        "Phase: enabling holding tracking",
        "Frames: complete lost",
    ] {
        assert!(words.contains(expected), "`{expected}` is missing in\n{words}");
    }
}

#[test]
fn wheels_are_measured_against_their_limits() {
    let run = square(3, LAP);
    let words = words(&html(&run));
    let speed =
        run.column("/wheel_2", "speed_rad_s").unwrap().fold(0.0, |most: f64, next| most.max(next.abs()));
    let torques: Vec<f64> = run.column("/wheel_2", "torque_nm").unwrap().collect();
    let torque = torques.iter().fold(0.0, |most: f64, next| most.max(next.abs()));
    let rms = (torques.iter().map(|torque| torque * torque).sum::<f64>() / LAP as f64).sqrt();
    // The limits of the made-up robot: 15 rad/s, 21 N·m, and 7 N·m for ever.
    let share = |value: f64, limit: f64| format!("{value:.2} ({:.0} %)", 100.0 * value / limit);
    let row = format!("wheel_2 {} {} {}", share(speed, 15.0), share(torque, 21.0), share(rms, 7.0));
    assert!(words.contains(&row), "`{row}` is missing in\n{words}");
}

#[test]
fn a_run_that_ended_early_says_why() {
    let mut run = square(3, LAP);
    assert!(!words(&html(&run)).contains("ended early"));
    run.description.insert("ended_early".to_owned(), "the robot stopped: a drive has a fault".to_owned());
    assert!(words(&html(&run)).contains("The run ended early: the robot stopped: a drive has a fault"));
}

#[test]
fn curves_are_drawn_where_the_values_are() {
    let page = html(&square(3, LAP));
    // The believed error is constant: a straight line from edge to edge.
    let believed = curve(&page, "Position error: distance", "believed");
    assert!(believed.windows(2).all(|pair| (pair[0].1 - pair[1].1).abs() <= 1.0), "{believed:?}");
    // The true one grows from nothing: downward is 1000, upward 0.
    let truth = curve(&page, "Position error: distance", "true");
    assert!(truth[0].1 > 990.0 && truth[truth.len() - 1].1 < 60.0, "{truth:?}");
    // Drives are up after 0.4 s of 18 s: before, nothing kept the platform at its plan.
    assert_eq!((truth[0].0, truth[truth.len() - 1].0), ((1600.0 * 0.4 / 17.999_f64).round(), 1600.0));
    // The path is the square: its corners stand at the four corners of the drawing's own square.
    let planned = curve(&page, "Path from above", "planned");
    assert_eq!(planned.len(), 5, "{planned:?}");
    assert_eq!(planned[0], planned[4]);
    assert!(page.matches("class=\"platform\"").count() > 4 && page.contains("class=\"wheel\""));
}

#[test]
fn an_hour_is_as_large_as_a_minute_and_keeps_its_extremes() {
    let minute = html(&square(3, 60_000));
    let mut hour = square(3, 60_000);
    // An hour by its times: one row a minute stands for all between, but for one torque beyond all others.
    for (row, time) in hour.times_ns.iter_mut().enumerate() {
        *time = 60_000_000 * row as u64;
    }
    let torque = hour.schema.column("/wheel_1", "torque_nm").unwrap();
    let width = hour.schema.width();
    hour.values[31_415 * width + torque] = 19.5;
    let hour = html(&hour);
    assert!(
        hour.len() < minute.len() * 11 / 10 && hour.len() < 600_000,
        "{} and {}",
        hour.len(),
        minute.len()
    );
    let peak =
        |page: &str| curve(page, "Wheel torque", "w1").into_iter().map(|point| point.1).fold(1e9, f64::min);
    // Limits of ±21 and a margin of a twentieth make a drawing from -23.1 to 23.1 N·m.
    assert_eq!(peak(&hour), (1000.0 * (23.1 - 19.5) / 46.2_f64).round());
}

/// The recording of a run.
fn recorded(run: &RecordedRun) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut recording = McapRun::create(&mut file, &run.schema, &run.description).unwrap();
    for (row, time_ns) in run.values.chunks_exact(run.schema.width()).zip(&run.times_ns) {
        let words: Vec<u64> = row.iter().map(|value| value.to_bits()).collect();
        recording.write_row(*time_ns, &words).unwrap();
    }
    run.events.iter().for_each(|event| recording.write_event(event).unwrap());
    recording.finish().unwrap();
    file.into_inner()
}

#[test]
fn a_page_needs_no_more_of_a_recording_than_what_it_shows() {
    let run = beside();
    let file = recorded(&run);
    let digest = Digest::read(|| Ok(file.as_slice())).unwrap();
    assert!(digest.run.schema.width() < run.schema.width() && digest.run.raw.is_empty());
    assert_eq!(digest.html(), html(&run));
}

/// A section of a page.
fn section<'a>(page: &'a str, id: &str) -> &'a str {
    page.split("<section ").find(|section| section.starts_with(&format!("id=\"{id}\""))).expect("the section")
}

#[test]
fn a_page_made_while_reading_shows_what_one_of_all_rows_does() {
    // 120 s: 150 rows in a column of a chart, with sensors and what stands beside the drives.
    let run = sensed(120_000);
    let file = recorded(&run);
    let digest = Digest::read(|| Ok(file.as_slice())).unwrap();
    let rows = digest.run.times_ns.len();
    assert!(digest.cycles() == 120_000 && rows < 70_000, "{rows}");
    let (whole, made) = (html(&run), digest.html());
    for id in ["summary", "errors", "speeds", "wheels", "phases", "sensors", "timing", "estimates", "events"]
    {
        assert_eq!(section(&made, id), section(&whole, id), "{id}");
    }
    // Of the path, points that shape nothing are left out.
    let (whole, made) = ((section(&whole, "path")), section(&made, "path"));
    for class in ["planned", "true", "believed"] {
        let [whole, made] = [whole, made].map(|path| curve(path, "Path from above", class));
        let off = made.iter().map(|point| distance(*point, &whole)).fold(0.0, f64::max);
        let lacking = whole.iter().map(|point| distance(*point, &made)).fold(0.0, f64::max);
        assert!(off < 2.0 && lacking < 2.0, "{class}: {off} {lacking}");
    }
}

/// Of a point from a path.
fn distance(point: (f64, f64), path: &[(f64, f64)]) -> f64 {
    let from_line = |ends: &[(f64, f64)]| {
        let (along, across) = (ends[1].0 - ends[0].0, ends[1].1 - ends[0].1);
        let (x, y) = (point.0 - ends[0].0, point.1 - ends[0].1);
        let part = ((x * along + y * across) / (along * along + across * across).max(1e-9)).clamp(0.0, 1.0);
        (x - part * along).hypot(y - part * across)
    };
    path.windows(2).map(from_line).fold(f64::INFINITY, f64::min)
}

/// A run with an axis, a terminal of two inputs and a gate that another program knows of.
fn beside() -> RecordedRun {
    let plain = square(4, 3000);
    let mut run = RecordedRun { values: Vec::new(), ..plain.clone() };
    run.schema.push("lift", ["age_s", "position_m", "set_point_m", "state"]);
    run.schema.push("buttons", ["age_s", "stop", "released"]);
    run.schema.push("gate", ["age_s", "instant_ns", "angle_rad"]);
    for (cycle, row) in plain.values.chunks_exact(plain.schema.width()).enumerate() {
        run.values.extend(row);
        let part = cycle as f64 / 3000.0;
        run.values.extend([0.0, 0.5 * part, 0.5 * part + 0.01, if cycle < 1000 { 0.0 } else { 1.0 }]);
        run.values.extend([0.0, f64::from(u8::from(cycle >= 1500)), 1.0]);
        run.values.extend(if cycle < 1500 { [f64::INFINITY, 0.0, f64::NAN] } else { [0.1, 1.0, 0.7] });
    }
    run
}

#[test]
fn what_stands_beside_the_drives_is_plotted() {
    let page = html(&beside());
    for caption in ["lift: position, set_point", "lift: state", "gate: angle", "Switched on and off"] {
        assert!(page.contains(&format!("<figcaption>{caption}")), "{caption}");
    }
    // From 0 to 0.5 m in a drawing that holds 0.51 too: upwards, along the whole of it.
    let rise = curve(&page, "lift: position", "w1");
    assert!(rise.first().unwrap().1 > 900.0 && rise.last().unwrap().1 < 100.0, "{rise:?}");
    let words = words(&page);
    assert!(words.contains("buttons: stop") && words.contains("buttons: released"), "{words}");
    assert!(!words.contains("lift: age") && !words.contains("instant"), "{words}");
    assert!(!html(&square(4, 3000)).contains("id=\"beside\""), "nothing is said of what isn't there");
}

#[test]
fn nothing_is_fetched_and_nothing_runs() {
    let page = html(&square(4, LAP));
    for forbidden in ["<script", "http:", "https:", "<link", "<img", "@import", "url(", "href=", "src="] {
        assert!(!page.contains(forbidden), "{forbidden}");
    }
    assert_eq!(page, html(&square(4, LAP)), "the same run, the same page");
}

#[test]
fn hostile_names_are_shown_as_they_are() {
    let hostile = "</td><script>alert('1')</script>\"&\u{0}";
    let mut run = square(3, 2000);
    for key in ["robot", "reference", "mode", "version", "date", "wheel_names"] {
        run.description.insert(key.to_owned(), hostile.replace(' ', ""));
    }
    run.description.insert(hostile.to_owned(), hostile.to_owned());
    run.events.push(RunEvent { time_ns: 0, text: hostile.to_owned() });
    run.truncated = Some(hostile.to_owned());
    run.schema.topics.last_mut().unwrap().name = format!("/wheel_{hostile}");
    let page = html(&run);
    assert!(!page.contains("<script") && !page.contains("alert('") && !page.contains('\u{0}'));
    let shown = "&lt;/td&gt;&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt;&quot;&amp;\u{FFFD}";
    assert!(page.matches(shown).count() >= 8, "{}", page.matches(shown).count());
}

#[test]
fn what_is_missing_is_told_in_a_word() {
    let page = html(&RecordedRun::default());
    assert!(words(&page).contains("The recording holds no cycle"), "{page}");

    // Hardware: no truth.
    let mut run = square(3, LAP);
    for topic in &mut run.schema.topics {
        topic.name = topic.name.replace("/truth", "/elsewhere");
    }
    let page = html(&run);
    assert!(words(&page).contains("Final position 0.300 mm RMS"), "{}", words(&page));
    assert!(!page.contains("d=\"M0 5H26\"/></svg>true"), "no curve that isn't there stands in a legend");
    assert_eq!(TrackingFigures::of(&run).final_error_m.truth, None);

    // Nothing but wheels: the other sections say why they are empty.
    for topic in &mut run.schema.topics {
        topic.name = topic.name.replace("/state", "/x").replace("/wished", "/y").replace("/cycle", "/z");
    }
    let words = words(&html(&run));
    for expected in ["Path: the run has no poses", "Errors: the run lacks the planned pose", "Wheel speed"] {
        assert!(words.contains(expected), "`{expected}` is missing in\n{words}");
    }
}

#[test]
fn a_run_cut_off_says_so_and_odd_values_draw_nothing_odd() {
    let mut run = square(3, LAP);
    run.truncated = Some("unexpected end of file".to_owned());
    // Half a row too much, and values of every kind.
    run.values.truncate(run.values.len() - 5);
    for (number, odd) in
        [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308, -1e308, 1e-310].into_iter().enumerate()
    {
        let width = run.schema.width();
        for column in 0..width {
            run.values[(100 * number + column) * width + column] = odd;
        }
    }
    // Times that run backwards.
    run.times_ns.swap(700, 900);
    let page = html(&run);
    assert!(words(&page).contains("The recording ends early (unexpected end of file)"));
    for odd in ["NaN", "inf"] {
        let found = page.split_once(odd).map(|(before, _)| &before[before.len() - 200..]);
        assert_eq!(found, None, "no number that isn't one is drawn");
    }
}

#[test]
fn a_run_that_never_tracked_has_no_error() {
    let figures = TrackingFigures::of(&square(3, 900));
    assert_eq!(figures, TrackingFigures::default());
    let words = words(&html(&square(3, 1)));
    assert!(words.contains("Cycles 1 "), "{words}");
}

/// A run with a gyro and a tracker: the tracker contradicts for a quarter of it, and one gyro reading in ten is beyond its gate.
fn sensed(cycles: usize) -> RecordedRun {
    let plain = square(3, cycles);
    let mut run = RecordedRun { values: Vec::new(), ..plain.clone() };
    let pose = ["pose_x_m", "pose_y_m", "pose_heading_rad"];
    run.schema
        .push("/map", [&pose[..], &["covariance_xx_m2", "covariance_yy_m2", "covariance_hh_rad2"]].concat());
    run.schema.push("/sensor", ["gyro_verdict", "gyro_nis", "mocap_verdict", "mocap_nis"]);
    run.description.insert("sensor_gates".into(), "gyro 10.83; mocap 5.42".into());
    let truth = ["pose.x", "pose.y", "pose.heading"];
    let truth = truth.map(|name| plain.column("/truth", name).unwrap().collect::<Vec<f64>>());
    let rows = plain.values.chunks_exact(plain.schema.width());
    for (row, values) in rows.enumerate() {
        run.values.extend(values);
        run.values.extend([truth[0][row] + 0.002, truth[1][row], truth[2][row]]);
        run.values.extend([1e-6, 4e-6, 1e-6]);
        let gyro = if row % 10 == 9 { 11.0 + row as f64 * 1e-6 } else { 0.5 + row as f64 * 1e-6 };
        run.values.extend([1.0, gyro, if row < 500 { 4.0 } else { 1.0 }, 0.25]);
    }
    run
}

#[test]
fn sensors_are_shown_with_their_gates_and_how_well_the_place_is_known() {
    let page = html(&sensed(2000));
    let text = words(&page);
    for expected in [
        "Sensors and the place in map",
        "good gyro good contradicts mocap",
        "mocap: good contradicts",
        // Of 2000 readings 200 are beyond the gate; the mocap said the same all the time.
        "gyro 100.0 % 2 000 10.00 %",
        "mocap 75.0 % 1 0.00 % 0.250",
        "gyro: innovation over its standard deviation",
        "gate ±3.29 σ",
        "Place in map: how well it was known",
    ] {
        assert!(text.contains(expected), "`{expected}` is missing in\n{text}");
    }
    // Three times the greater sigma lies at 6 mm, the true error at 2.
    let known = curve(&page, "Place in map", "limit");
    let truly = curve(&page, "Place in map", "true");
    let height = |points: &[(f64, f64)]| 1000.0 - points[0].1;
    assert!((height(&known) / height(&truly) - 3.0).abs() < 0.05, "{known:?} {truly:?}");
    assert!(!html(&square(3, 2000)).contains("id=\"sensors\""), "nothing is said of what isn't there");
}
