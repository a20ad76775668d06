//! A wheel that slips is told, and stops the robot; what doesn't slip isn't said to.

use omnibase_robot::signals::SafetyReason;
use omnibase_robot_sim::Tread;
use omnibase_trials::fast;
use omnibase_trials::laws::{ALL, OF_TORQUE};
use omnibase_trials::robots::{BMM, MECANUM};
use omnibase_trials::slip::{Case, Slid};

/// Told within 50 ms of the beginning of a slip of more than 10 mm, if it became one, and stopped by its name within 50 mm of the truth.
fn is_caught(slid: &Slid) -> bool {
    let in_time =
        slid.told.is_some_and(|(told, _)| slid.began.is_none_or(|began| told.saturating_sub(began) <= 50));
    in_time && slid.stopped == SafetyReason::WheelSlip && slid.run.true_final_m <= 0.05
}

#[test]
fn the_square_twice_as_fast_is_stopped_by_its_name() {
    for payload_kg in [0.0, 100.0] {
        let case = Case {
            faster: 2.0,
            payload_kg,
            off_centre_m: 0.2,
            ..Case::plain(BMM, "adaptive_torque", "square")
        };
        let slid = case.ride();
        println!("{}", case.row(&slid));
        assert!(is_caught(&slid), "{slid:?}");
    }
}

#[test]
fn the_square_on_a_slippery_floor_ends_near_the_truth() {
    for law in ["closed_loop_speed", "adaptive_torque"] {
        let case = Case { friction: 0.15, ..Case::plain(BMM, law, "square") };
        let slid = case.ride();
        println!("{}", case.row(&slid));
        assert!(slid.run.finished && slid.run.true_final_m <= 0.015, "{slid:?}");
    }
}

#[test]
fn a_slippery_patch_under_the_circle_stops_the_robot() {
    // As wide as the robot, under the second quarter of the circle.
    let more = "\n[[simulation.patch]]\ncentre_m = [0.5, 0.5]\nradius_m = 0.6\nstatic_friction = 0.08\n";
    for (law, gyro) in ALL.iter().flat_map(|&law| [(law, true), (law, false)]) {
        let case = Case { gyro, more: more.to_owned(), ..Case::plain(BMM, law, "circle") };
        let slid = case.ride();
        println!("{}", case.row(&slid));
        let is_stopped = slid.stopped == SafetyReason::WheelSlip;
        assert!(is_stopped && slid.run.true_final_m <= 0.07, "{}", case.row(&slid));
    }
}

#[test]
fn a_robot_whose_wheels_slipped_is_where_it_says_that_it_may_be() {
    let slippery =
        |friction: f64, path: &'static str, payload_kg: f64, law: &'static str, robot: &'static str| {
            let case = Case { friction, payload_kg, off_centre_m: 0.2, ..Case::plain(robot, law, path) };
            let slid = case.ride();
            let [x, y, heading] = slid.apart.error;
            println!(
                "{} {:.1} mm {:.1} mm {heading:.4} rad, {:.1} sigmas",
                case.row(&slid),
                1e3 * x,
                1e3 * y,
                slid.apart.most_sigmas()
            );
            // A loaded mecanum by speed slides for 0.1 s before that is told, by 70 mm and 0.15 rad: 12 before rims counted.
            let is_told_late = robot == MECANUM && law == "closed_loop_speed" && payload_kg > 0.0;
            (slid.apart.most_sigmas() > if is_told_late { 6.0 } else { 3.0 }).then(|| case.row(&slid))
        };
    let mut beyond = Vec::new();
    for law in ["closed_loop_speed", "adaptive_torque"] {
        for (robot, friction) in [(BMM, 0.08), (BMM, 0.15), (MECANUM, 0.08)] {
            for (path, payload_kg) in [("square", 0.0), ("square", 100.0), ("circle", 0.0)] {
                beyond.extend(slippery(friction, path, payload_kg, law, robot));
            }
        }
    }
    assert!(beyond.is_empty(), "{beyond:#?}");
}

#[test]
fn many_short_slips_are_a_long_one() {
    // Of a robot of 70 kg as its file says, which may weigh three times as much or a third.
    let text = Case::plain(BMM, "adaptive_torque", "square").text();
    let narrow = text.lines().filter(|line| line.contains("_bounds_kg")).map(|line| format!("{line}\n"));
    let wide = narrow.fold(text.clone(), |text, line| text.replace(&line, ""));
    assert_ne!(wide, text);
    let slippery = wide.replace("static_friction = 0.5", "static_friction = 0.08");
    let slippery = slippery.replace("sliding_friction = 0.45", "sliding_friction = 0.072");
    let slid = Slid::of(&slippery, false);
    println!("{slid:?}");
    assert_eq!(slid.stopped, SafetyReason::WheelSlip);
    assert!(slid.run.true_final_m < 0.05, "{slid:?}");
}

#[test]
fn what_grips_is_not_said_to_slip() {
    for robot in [BMM, MECANUM] {
        for &law in ALL.iter() {
            for path in ["square", "circle", "eight", "spiral"] {
                for (payload_kg, off_centre_m) in [(0.0, 0.0), (150.0, 0.0), (60.0, 0.15)] {
                    let case = Case { payload_kg, off_centre_m, ..Case::plain(robot, law, path) };
                    let slid = case.ride();
                    assert_eq!((slid.told, slid.began), (None, None), "{}", case.row(&slid));
                }
            }
        }
    }
}

/// On a floor with a slope.
fn on_a_slope(robot: &str, slope_rad: f64, direction_rad: f64) -> String {
    let slope = format!("[simulation]\nslope_rad = {slope_rad:?}\nslope_direction_rad = {direction_rad:?}\n");
    robot.replacen("[simulation]\n", &slope, 1)
}

/// By the files as they are shipped, which tell what the robots weigh.
#[test]
fn a_slope_is_not_said_to_make_wheels_slip() {
    for robot in [BMM, MECANUM] {
        for (slope_rad, direction_rad) in
            [(0.03, 0.0), (0.03, 1.6), (0.03, 3.1), (0.05, 1.6), (0.05, 4.0), (0.07, 0.1), (0.07, 5.6)]
        {
            for motion in [
                "kind = \"circle\"\nradius_m = 0.4\nduration_s = 6.3",
                "kind = \"circle\"\nradius_m = 0.4\nduration_s = 7.0",
                "kind = \"eight\"\nhalf_length_m = 0.8\ntiming = \"fastest\"",
            ] {
                let text = on_a_slope(robot, slope_rad, direction_rad);
                let slid = Slid::of(&format!("{text}\n[reference]\n{motion}\n"), false);
                let is_told = !slid.run.finished || slid.told.is_some();
                assert!(!is_told, "{slope_rad} towards {direction_rad} rad, {motion}: {slid:?}");
            }
        }
    }
}

#[test]
fn what_a_slope_takes_of_the_floor_is_not_driven_with() {
    // 49 and 39 mm of slip where motions are driven as on a level floor.
    let square =
        "kind = \"path\"\npoints = [[0, 0, 0, 0], [5, 2, 0, 0], [10, 2, 2, 0], [15, 0, 2, 0], [20, 0, 0, 0]]";
    let eight = "kind = \"eight\"\nhalf_length_m = 0.8";
    let by_torque = "kind = \"adaptive_torque\"\nmass_kg = 60.0\ninertia_kg_m2 = 4.0";
    let mecanum = MECANUM.replacen("kind = \"closed_loop_speed\"", by_torque, 1);
    // Downhill by torque it stood on less than the slope, and is told of no slip.
    let bmm = BMM.replacen("kind = \"closed_loop_speed\"", "kind = \"adaptive_torque\"", 1);
    for (robot, motion, direction_rad) in [(BMM, square, 3.24), (&bmm, square, 0.1), (&mecanum, eight, 1.67)]
    {
        let text = on_a_slope(robot, 0.07, direction_rad);
        // It stood with its drives enabled, as robots do before somebody tells them to go.
        let slid = Slid::of_rested(&format!("{text}\n[reference]\n{motion}\ntiming = \"fastest\"\n"), 300);
        println!("{motion}: {slid:?}");
        assert!(slid.run.finished && slid.told.is_none() && slid.way_m < 1e-3, "{motion}: {slid:?}");
    }
}

#[test]
fn half_of_the_friction_that_was_told_is_told_as_slip_on_a_slope_too() {
    for name in ["square", "circle"] {
        for direction_rad in [0.1, 3.2] {
            let text = on_a_slope(&on_less(BMM, name, [0.25, 0.2]).text(), 0.05, direction_rad);
            let slid = Slid::of(&text, false);
            println!("{name}, {direction_rad}: {slid:?}");
            let is_at_once = slid.told.is_some_and(|(told_ms, off_m)| told_ms < 150 && off_m < 0.01);
            assert!(is_at_once && slid.run.true_final_m < 0.1, "{name}, {direction_rad}: {slid:?}");
        }
    }
}

/// A floor of which the robot's file tells as much as a sliding wheel gets.
fn told(friction: f64) -> String {
    format!("\n[grip]\nfriction = {:?}\ncentre_of_mass_height_m = 0.6\n", 0.9 * friction)
}

#[test]
fn on_a_floor_that_is_told_nothing_slips_and_the_path_is_late_and_true() {
    for (robot, law, friction, faster) in [
        (BMM, "adaptive_torque", 0.5, 2.0),
        (BMM, "closed_loop_speed", 0.5, 2.0),
        (BMM, "adaptive_torque", 0.15, 1.0),
        (BMM, "closed_loop_speed", 0.15, 2.0),
        (BMM, "closed_loop_speed", 0.08, 1.0),
        (MECANUM, "adaptive_torque", 0.15, 1.0),
        (MECANUM, "adaptive_torque", 0.5, 2.0),
        (MECANUM, "closed_loop_speed", 0.5, 2.0),
    ] {
        let more = told(friction);
        let case = Case { friction, faster, payload_kg: 100.0, more, ..Case::plain(robot, law, "square") };
        let slid = case.ride();
        println!("{}", case.row(&slid));
        assert!(slid.run.finished && slid.run.true_final_m <= 0.015, "{}", case.row(&slid));
    }
}

/// The square with corners cut by 50 mm, as fast as physics allows where the floor has a friction of 0.5.
fn fast(law: &'static str, floor: [f64; 2]) -> Slid {
    let [_, (_, blended), ..] = fast::MOTIONS;
    fast::Case { robot: BMM, law, motion: blended.to_owned(), told: 0.5, floor }.ride()
}

#[test]
fn a_floor_that_was_told_is_driven_at_its_limit_and_no_wheel_slips() {
    for (law, most_mm) in [("closed_loop_speed", 1.0), ("adaptive_torque", 2.0)] {
        let slid = fast(law, [0.5, 0.45]);
        assert_eq!((slid.end(), slid.told), ("finished", None), "{law}");
        assert!((7.0..7.8).contains(&(slid.run.cycles as f64 * 1e-3)), "{law}: {} ms", slid.run.cycles);
        assert!(1e3 * slid.run.true_final_m < most_mm, "{law}: {} m", slid.run.true_final_m);
        assert!(slid.way_m < 1e-3, "{law}: {} m", slid.way_m);
    }
}

#[test]
fn who_is_thrown_off_a_fast_plan_gets_back_onto_it_by_another_one() {
    // What its rollers take is learnt as more than it was planned with: it leaves its plan at the third side.
    let (name, motion) = fast::MOTIONS[0];
    assert_eq!(name, "square");
    let (robot, law) = (MECANUM, "closed_loop_speed");
    let (motion, floor) = (motion.to_owned(), [0.5, 0.45]);
    let slid = fast::Case { robot, law, motion, told: 0.5, floor }.ride();
    assert_eq!(slid.end(), "finished");
    println!("mecanum's square: {:?}", slid.run);
    // 15.3 s and 457 mm behind where it is caught up with at a rate.
    assert!(slid.run.believed_greatest_m < 0.07 && slid.run.cycles < 10_600, "{:?}", slid.run);
    assert!(slid.run.true_final_m < 1e-3, "{:?}", slid.run);
}

#[test]
fn on_a_floor_that_has_half_of_what_was_told_the_robot_goes_gently_at_once() {
    // 0.61 m off, and stopped for that, where the file doesn't tell what it weighs.
    let slid = fast("closed_loop_speed", [0.25, 0.2]);
    let (told_ms, off_m) = slid.told.expect("slip is told");
    assert!(told_ms < 120 && off_m < 0.005, "{told_ms} ms, {off_m} m");
    assert!(slid.run.finished && slid.run.true_final_m < 0.05, "{}: {:?}", slid.end(), slid.run);
}

#[test]
fn by_speed_a_floor_that_has_less_than_was_told_is_told_in_the_first_millimetres() {
    // 211, 210, 56 and 108 mm off on 0.35 where the floor isn't asked, the BMM's first three stopped or told by then; 43 on 0.45, untold.
    for robot in [BMM, MECANUM] {
        for floor in [[0.45, 0.4], [0.35, 0.3]] {
            for (name, _) in fast::MOTIONS {
                let slid = on_less(robot, name, floor).ride();
                println!("{floor:?}, {name}: {slid:?}");
                assert!(
                    slid.run.finished && slid.run.true_final_m < 0.006,
                    "{name}: {}: {slid:?}",
                    slid.end()
                );
                assert!(
                    slid.way_m < 0.01 && (slid.told.is_some() || slid.began.is_none()),
                    "{name}: {slid:?}"
                );
                if let Some(friction) = slid.friction.filter(|_| robot == BMM) {
                    let is_near = (0.75 * floor[1]..1.1 * floor[0]).contains(&friction);
                    assert!(is_near, "{floor:?}, {name}: {friction}");
                }
            }
        }
    }
}

#[test]
fn by_speed_what_goes_gently_is_told_too_and_so_is_a_wheel_that_bears_little() {
    // 0.4 to 3.6 m off, the first four without a word, where gentle motions swing by a part of themselves alone, and only a wheel that gets
    // nothing is told.
    for (path, friction, payload_kg, off_centre_m) in [
        ("square", 0.08, 0.0, 0.0),
        ("square", 0.08, 100.0, 0.0),
        ("square", 0.08, 100.0, 0.2),
        ("square", 0.15, 100.0, 0.2),
        ("circle", 0.15, 100.0, 0.2),
        ("eight", 0.08, 100.0, 0.2),
        ("eight", 0.15, 100.0, 0.2),
    ] {
        for law in ["open_loop", "closed_loop_speed"] {
            let case = Case { friction, payload_kg, off_centre_m, ..Case::plain(BMM, law, path) };
            let slid = case.ride();
            println!("{} {:.1} mm apart", case.row(&slid), 1e3 * slid.apart.distance_m());
            assert!(slid.told.is_some() && slid.apart.distance_m() < 0.08, "{}: {slid:?}", case.row(&slid));
        }
    }
}

#[test]
fn by_speed_a_wheel_is_told_whose_load_swings_as_it_slides() {
    // Its floor gives it more where it is asked for more: 171 mm off without a word, where what its rim gains beyond that didn't count.
    let case =
        Case { payload_kg: 100.0, off_centre_m: 0.2, ..Case::plain(BMM, "closed_loop_speed", "spiral") };
    let slid = case.ride();
    println!("{} {:.1} mm apart", case.row(&slid), 1e3 * slid.apart.distance_m());
    let (told, way_m) = slid.told.expect("it slips");
    assert!(told < slid.began.unwrap() + 250 && way_m < 0.03 && slid.apart.distance_m() < 0.04, "{slid:?}");
}

#[test]
fn a_motor_at_its_limit_hides_no_slip_of_the_other_wheels() {
    // One of three is at 21 N·m for a second in which another slides: 113 mm off without a word, where all watches were deaf then.
    let case = Case { faster: 1.5, payload_kg: 100.0, ..Case::plain(BMM, "closed_loop_speed", "eight") };
    let slid = case.ride();
    println!("{} {:.1} mm apart", case.row(&slid), 1e3 * slid.apart.distance_m());
    assert!(slid.torque_nm > 20.9, "{slid:?}");
    let (told, way_m) = slid.told.expect("it slips");
    assert!(told < slid.began.unwrap() + 200 && way_m < 0.03 && slid.apart.distance_m() < 0.04, "{slid:?}");
}

#[test]
fn by_speed_what_grips_is_not_said_to_slip_where_its_encoders_count_coarsely() {
    for (robot, from, to, gear_ratio) in [
        (BMM, "device = \"sgdv\"", "device = \"sgdv\"\ncounts_per_revolution =", 1),
        (MECANUM, "counts_per_revolution = 1_048_576", "counts_per_revolution =", 10),
    ] {
        // Of a wheel, not of its motor.
        for counts in [20_000, 50_000] {
            for (path, stiffness_n_m) in [("square", None), ("circle", Some(6e5)), ("spiral", None)] {
                let tread = stiffness_n_m.map(|stiffness_n_m| Tread { stiffness_n_m, damping_ratio: 0.2 });
                let case = Case {
                    faster: 0.7,
                    friction: 0.9,
                    tread,
                    ..Case::plain(robot, "closed_loop_speed", path)
                };
                let text = case.text().replace(from, &format!("{to} {}", counts / gear_ratio));
                assert_ne!(text, case.text());
                let slid = Slid::of(&text, false);
                assert!(slid.told.is_none() && slid.run.finished, "{counts}: {}", case.row(&slid));
            }
        }
    }
}

#[test]
fn by_speed_gentle_motions_of_four_wheels_are_told_once_their_wires_are_shown() {
    // 3.8 and 0.4 m off without a word where four wheels swing by a part of what they ask alone; 0.2 m where the third one is told late.
    for (path, friction) in [("square", 0.08), ("square", 0.15), ("eight", 0.08)] {
        let case = Case {
            friction,
            payload_kg: 100.0,
            off_centre_m: 0.2,
            ..Case::plain(MECANUM, "closed_loop_speed", path)
        };
        let slid = case.ride();
        println!("{} {:.1} mm apart", case.row(&slid), 1e3 * slid.apart.distance_m());
        assert!(slid.told.is_some() && slid.apart.distance_m() < 0.1, "{}: {slid:?}", case.row(&slid));
    }
}

#[test]
fn a_floor_that_has_half_of_what_was_told_is_not_forgotten_before_it_is_felt_again() {
    // 294 mm off, and stopped for that, where what is counted on grows back on ways that ask for none of it.
    let slid = on_less(MECANUM, "blended", [0.25, 0.2]).ride();
    println!("{slid:?}");
    assert!(slid.told.is_some() && slid.run.finished && slid.run.true_final_m < 0.015, "{slid:?}");
}

#[test]
fn wheels_of_four_that_run_ahead_of_the_others_slip() {
    // By torque two of them do: 0.12 and 0.16 m off, the first without a word, where only forces tell.
    for name in ["circle", "eight"] {
        let law = "adaptive_torque";
        let slid = fast::Case { law, ..on_less(MECANUM, name, [0.25, 0.2]) }.ride();
        println!("{name}: {slid:?}");
        assert!(slid.told.is_some() && slid.run.finished, "{name}: {}", slid.end());
        assert!(slid.run.true_final_m < 0.015, "{name}: {slid:?}");
    }
}

#[test]
fn a_floor_is_not_taken_for_ice_where_a_slide_ends() {
    // 0.5 m behind its path, and stopped for that, where the last forces of a slide count most.
    for name in ["square", "blended"] {
        let law = "adaptive_torque";
        let slid = fast::Case { law, ..on_less(MECANUM, name, [0.25, 0.2]) }.ride();
        println!("{name}: {slid:?}");
        assert!(slid.run.finished && slid.run.true_final_m < 0.015, "{name}: {slid:?}");
    }
}

/// A motion as fast as a floor of 0.5 allows, on another floor.
fn on_less(robot: &'static str, name: &str, floor: [f64; 2]) -> fast::Case {
    let (_, motion) = fast::MOTIONS.into_iter().find(|(each, _)| *each == name).expect("a motion");
    fast::Case { robot, law: "closed_loop_speed", motion: motion.to_owned(), told: 0.5, floor }
}

#[test]
fn slip_in_a_steady_motion_is_told_where_the_file_says_what_the_robot_weighs() {
    // Its true final error, m: 72, 295 and 722 mm where the file doesn't tell the mass.
    for (robot, name, most_m) in [(BMM, "circle", 0.015), (BMM, "eight", 0.03), (MECANUM, "eight", 0.06)] {
        let slid = on_less(robot, name, [0.25, 0.2]).ride();
        println!("{name}: {slid:?}");
        let (told_ms, off_m) = slid.told.expect("slip is told");
        let is_at_once = robot == MECANUM || told_ms < 120 && off_m < 0.005;
        assert!(is_at_once && told_ms < 800, "{name}: {told_ms} ms, {off_m} m");
        assert!(slid.run.true_final_m < most_m, "{name}: {} m", slid.run.true_final_m);
    }
}

#[test]
fn by_speed_slip_is_told_where_nobody_knows_what_the_robot_weighs() {
    // Stopped by its name after 2 s, and 295 mm off, where the floor isn't asked: they look light.
    for robot in [BMM, MECANUM] {
        let text = on_less(robot, "eight", [0.25, 0.2]).text();
        let platform = text.split_once("[limits]").map_or("", |(platform, _)| platform);
        let weighed = platform.lines().find(|line| line.starts_with("mass_kg")).expect("what it weighs");
        let slid = Slid::of(&text.replacen(&format!("{weighed}\n"), "", 1), false);
        println!("{slid:?}");
        assert!(slid.told.is_some() && slid.run.finished && slid.run.true_final_m < 0.015, "{slid:?}");
    }
}

#[test]
fn by_torque_a_floor_that_has_less_than_was_told_is_told_in_the_first_millimetres() {
    // 71 to 785 mm off where a wheel that turns alone isn't told: the floor gives what a lighter platform would need.
    for robot in [BMM, MECANUM] {
        for &law in OF_TORQUE.iter() {
            for (name, _) in fast::MOTIONS {
                let slid = fast::Case { law, ..on_less(robot, name, [0.35, 0.3]) }.ride();
                println!("{law}, {name}: {slid:?}");
                let (_, way_m) = slid.told.expect("slip is told");
                assert!(way_m < 0.005 && slid.run.finished, "{law}, {name}: {}: {slid:?}", slid.end());
                assert!(slid.run.true_final_m < 0.01, "{law}, {name}: {slid:?}");
            }
        }
    }
}

#[test]
fn by_torque_half_of_the_friction_that_was_told_is_told_on_a_slope_too() {
    for &law in OF_TORQUE.iter() {
        for name in ["square", "circle", "eight"] {
            for direction_rad in [0.1, 1.7, 3.2, 4.8] {
                let level = fast::Case { law, ..on_less(BMM, name, [0.25, 0.2]) };
                let slid = Slid::of_rested(&on_a_slope(&level.text(), 0.05, direction_rad), 300);
                println!("{law}, {name}, {direction_rad}: {slid:?}");
                // Uphill some are stopped for a path that they can't keep to: they are where they believe to be.
                assert!(slid.told.is_some() && slid.apart.distance_m() < 0.05, "{law}, {name}: {slid:?}");
            }
        }
    }
}
