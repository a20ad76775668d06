use super::*;

/// The shortest way, beside these obstacles alone.
fn shortest(from: Pose2, to: Pose2, obstacles: &[Obstacle]) -> WayRequest<'_> {
    WayRequest {
        from,
        lead: &[],
        to,
        obstacles,
        spread_m: 0.0,
        fence_m: &[],
        walls_m: &[],
        best: BestWay::Shortest,
        until: Until::default(),
    }
}

#[test]
fn maps_that_are_too_long_are_refused_with_what_was_expected_and_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.yaml");
    let read = |yaml: &[u8]| {
        std::fs::write(&path, yaml).unwrap();
        let text = read_map(&path, UnknownCells::Free).unwrap_err().to_string();
        text.replace(&folder.path().display().to_string(), "")
    };
    assert_eq!(
        read(&vec![b'#'; 64 * 1024 + 1]),
        "map.file /map.yaml: expected at most 65536 bytes, found more"
    );
    assert_eq!(read(b"image: \xff"), "map.file /map.yaml: byte 7: expected UTF-8");
    // As long as it may be for the disk, which stores nothing of it.
    let image = std::fs::File::create(folder.path().join("map.pgm")).unwrap();
    image.set_len(LONGEST_IMAGE + 1).unwrap();
    assert_eq!(
        read(b"image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n"),
        "map.file /map.yaml: map.pgm: expected at most 134217728 bytes, found more"
    );
}

#[test]
fn who_stands_too_near_to_an_obstacle_leaves_it_straight_and_keeps_off_it_then() {
    let (registry, obstacle) = (
        Registry::with_built_in(),
        Obstacle { centre_m: [0.85, 0.1], radius_m: 0.4, velocity_m_s: [0.0; 2] },
    );
    let plan =
        RobotPlan::from_toml(include_str!("../../../../robots/bmm.toml"), &registry, &|_| Err(String::new()));
    let plan = plan.unwrap();
    let (room, ability) = (Room::of(&plan, Path::new("")).unwrap(), Ability::of(&plan));
    let from = Pose2 { x_m: 0.04 - room.gap_m(&Pose2::default(), &obstacle), ..Pose2::default() };
    let from = Pose2 { x_m: -from.x_m, ..from };
    let begins_m = room.gap_m(&from, &obstacle);
    assert!((0.02..0.06).contains(&begins_m), "{begins_m} m");
    let way = shortest(from, Pose2::new(2.5, 0.1, 0.0), std::slice::from_ref(&obstacle));
    let timed = room.timed(&way, &ability, &registry).unwrap();
    let (mut gap_m, mut is_out) = (begins_m, false);
    for step in 0..=(timed.duration_s / 0.01) as u32 {
        let pose = timed.reference.preview(0.01 * f64::from(step)).unwrap().odom_from_body;
        let now_m = room.gap_m(&pose, &obstacle);
        assert!(
            now_m > if is_out { room.kept_m(0.0) } else { gap_m - 1e-6 },
            "{now_m} m at {pose:?}, {gap_m} m before"
        );
        (gap_m, is_out) = (now_m, is_out || now_m > room.kept_m(0.0));
    }
    assert!(is_out);
}

/// From the origin to (2.7, 1.0) through a door in a wall at x = 1.2 m to 1.3 m, so wide, m.
fn through_a_door(width_m: f64) -> (Ability, TimedWay) {
    let registry = Registry::with_built_in();
    let [low, high] = [1.0 - 0.5 * width_m, 1.0 + 0.5 * width_m];
    let footprint =
        "layout = \"bmm\"\nfootprint_m = [[0.5, -0.25], [0.5, 0.25], [-0.5, 0.25], [-0.5, -0.25]]";
    let bmm = include_str!("../../../../robots/bmm.toml").replace("layout = \"bmm\"", footprint);
    let walls = format!(
        "[map]\nblocked_m = [[[1.2, -5.0], [1.3, -5.0], [1.3, {low}], [1.2, {low}]],\
         [[1.2, {high}], [1.3, {high}], [1.3, 5.0], [1.2, 5.0]]]\n"
    );
    let plan = RobotPlan::from_toml(&format!("{bmm}\n{walls}"), &registry, &|_| Err(String::new()));
    let plan = plan.unwrap();
    let (room, ability) = (Room::of(&plan, Path::new("")).unwrap(), Ability::of(&plan));
    let way = shortest(Pose2::default(), Pose2::new(2.7, 1.0, 0.0), &[]);
    let timed = room.timed(&way, &ability, &registry).unwrap();
    (ability, timed)
}

#[test]
fn a_way_is_so_slow_that_no_stop_on_it_leads_into_a_wall() {
    for (width_m, is_slow) in [(2.4, false), (0.75, true), (0.7, false)] {
        let (Ability { limits, .. }, timed) = through_a_door(width_m);
        assert_eq!(timed.table.speed_m_s.is_some(), is_slow, "{width_m} m");
        let jambs = [1.2, 1.3].map(|x| [-0.5, 0.5].map(|share| [x, 1.0 + share * width_m]));
        for step in 0..=(timed.duration_s / 0.01) as u32 {
            let at = timed.reference.preview(0.01 * f64::from(step)).unwrap();
            let (pose, twist) = (at.odom_from_body, at.twist_in_odom);
            // With all of both accelerations at once: no stop is shorter.
            let straight_s = twist.speed_m_s() / limits.acceleration_m_s2;
            let turning_s = twist.w_rad_s.abs() / limits.turn_acceleration_rad_s2;
            for share in [0.25, 0.5, 0.75, 1.0] {
                let time_s = share * straight_s.max(turning_s);
                let of = |whole_s: f64| {
                    time_s.min(whole_s) * (1.0 - 0.5 * time_s.min(whole_s) / whole_s.max(1e-9))
                };
                let [along_s, round_s] = [straight_s, turning_s].map(of);
                let stopping = Pose2 {
                    x_m: pose.x_m + along_s * twist.vx_m_s,
                    y_m: pose.y_m + along_s * twist.vy_m_s,
                    heading_rad: pose.heading_rad + round_s * twist.w_rad_s,
                };
                for [x, y] in jambs.into_iter().flatten() {
                    let seen = stopping.inverse().then(Pose2::new(x, y, 0.0));
                    let is_off = seen.x_m.abs() > 0.5 || seen.y_m.abs() > 0.25;
                    assert!(is_off, "{width_m} m wide: a stop from {pose:?} leads into the door");
                }
            }
        }
    }
}
