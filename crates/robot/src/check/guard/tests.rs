//! Files with fences and obstacles that can't be, and what is said about them.

use crate::config::{Problem, ProblemKind, RobotPlan};
use crate::obstacle::MAX_OBSTACLES;
use crate::registry::Registry;

const BMM: &str = include_str!("../../../../../robots/bmm.toml");

fn check(tables: &str) -> Result<RobotPlan, Vec<Problem>> {
    let no_files = |name: &str| Err(format!("no file {name}"));
    RobotPlan::from_toml(&format!("{BMM}\n{tables}"), &Registry::with_built_in(), &no_files)
}

/// The only problem of a file: its setting, kind, and its words with value and limit.
fn problem(tables: &str) -> (String, ProblemKind, String) {
    let problems = check(tables).expect_err(tables);
    let [problem] = &problems[..] else { panic!("{tables}: {problems:#?}") };
    let first = BMM.lines().count() + 2;
    let place = problem.place.as_ref().unwrap_or_else(|| panic!("{tables}: no place"));
    let lines = first..first + tables.lines().count();
    assert!(lines.contains(&place.line), "{tables}: line {} of {lines:?}", place.line);
    (problem.setting.clone(), problem.kind, problem.to_string())
}

fn assert_refused(tables: &str, setting: &str, kind: ProblemKind, words: &[&str]) {
    let (found, found_kind, text) = problem(tables);
    assert_eq!((found.as_str(), found_kind), (setting, kind), "{tables}: {text}");
    for word in words {
        assert!(text.contains(word), "{tables}: {text} says nothing of {word}");
    }
}

#[test]
fn a_fence_and_obstacles_that_can_be_are_taken() {
    let plan = check(
        "[fence]\npolygon_m = [[-2, -2], [2, -2], [2, 2], [0.0, 1.0], [-2, 2]]\nmargin_m = 0.1\n\
         [avoidance]\nkind = \"circulate\"\ndistance_m = 0.2\ncirculate_1_s = 0.7\n\
         [[obstacle]]\ncentre_m = [1.2, 0.0]\nradius_m = 0.0\n\
         [[obstacle]]\ncentre_m = [5.0, 0.0]\nradius_m = 0.3\nvelocity_m_s = [-0.1, 0.2]\n",
    )
    .unwrap_or_else(|problems| panic!("{problems:#?}"));
    let fence = plan.guard.fence.expect("a fence");
    assert_eq!((fence.corners_m.len(), fence.margin_m), (5, 0.1));
    assert_eq!((plan.guard.distance_m, plan.guard.circulate_1_s), (0.2, 0.7));
    assert_eq!(plan.guard.obstacles.len(), 2);
    assert_eq!(plan.guard.obstacles[1].velocity_m_s, [-0.1, 0.2]);
}

#[test]
fn a_fence_is_a_polygon_around_the_robot_that_crosses_itself_nowhere() {
    use ProblemKind::{Contradiction, Missing, OutOfRange};
    let polygon = "fence.polygon_m";
    for (value, setting, kind, words) in [
        (
            "rectangle_m = [1, -1, -1, 1]",
            "fence.rectangle_m",
            Contradiction,
            &["[1, -1, -1, 1]", "x_min < x_max"][..],
        ),
        ("rectangle_m = [-1, 1, 1, 1]", "fence.rectangle_m", Contradiction, &["y_min < y_max"]),
        ("margin_m = 0.1", "fence", Missing, &["rectangle_m", "polygon_m"]),
        (
            "rectangle_m = [-1, -1, 1, 1]\npolygon_m = [[-1, -1], [1, -1], [0, 1]]",
            polygon,
            Contradiction,
            &["not both"],
        ),
        ("polygon_m = []", polygon, OutOfRange, &["0 corners", "3 to 32"]),
        ("polygon_m = [[-1, -1], [1, 1]]", polygon, OutOfRange, &["2 corners", "3 to 32"]),
        // A bow tie; a corner twice; a first corner that is given again at the end; a spike; no area at all.
        (
            "polygon_m = [[-2, -2], [2, 2], [2, -2], [-2, 2]]",
            polygon,
            Contradiction,
            &["sides 0 and 2", "cross"],
        ),
        ("polygon_m = [[-2, -2], [2, -2], [2, -2], [2, 2], [-2, 2]]", polygon, Contradiction, &["each once"]),
        (
            "polygon_m = [[-2, -2], [2, -2], [2, 2], [-2, 2], [-2, -2]]",
            polygon,
            Contradiction,
            &["each once"],
        ),
        (
            "polygon_m = [[-2, -2], [2, -2], [2, 2], [3, 3], [2, 2], [-2, 2]]",
            polygon,
            Contradiction,
            &["touch"],
        ),
        ("polygon_m = [[-2, 0], [0, 0], [2, 0]]", polygon, Contradiction, &["touch"]),
        (
            "polygon_m = [[-2, -2], [2, -2], [2e6, 2]]",
            "fence.polygon_m[2]",
            OutOfRange,
            &["2000000.0", "1000000.0"],
        ),
        // Smaller than the footprint; around another place; with a margin that leaves no room.
        (
            "rectangle_m = [-0.1, -0.1, 0.1, 0.1]",
            "fence.rectangle_m",
            Contradiction,
            &["m of room", "start", "margin_m = 0.05"],
        ),
        ("rectangle_m = [4, 4, 9, 9]", "fence.rectangle_m", Contradiction, &["m of room", "start"]),
        (
            "rectangle_m = [-1, -1, 1, 1]\nmargin_m = 0.9",
            "fence.rectangle_m",
            Contradiction,
            &["margin_m = 0.9"],
        ),
        ("rectangle_m = [-1, -1, 1, 1]\nmargin_m = -0.1", "fence.margin_m", OutOfRange, &["-0.1"]),
    ] {
        assert_refused(&format!("[fence]\n{value}\n"), setting, kind, words);
    }
    let many: Vec<String> = (0..33)
        .map(|number| {
            let angle = std::f64::consts::TAU * f64::from(number) / 33.0;
            format!("[{:.6}, {:.6}]", 3.0 * angle.cos(), 3.0 * angle.sin())
        })
        .collect();
    let polygon_of = |corners: &[String]| format!("[fence]\npolygon_m = [{}]\n", corners.join(", "));
    assert_refused(&polygon_of(&many), polygon, OutOfRange, &["33 corners", "3 to 32"]);
    assert!(check(&polygon_of(&many[..32])).is_ok());
}

#[test]
fn what_is_no_number_is_refused_where_it_stands() {
    for (tables, setting) in [
        ("[fence]\nrectangle_m = [-1, -1, nan, 1]\n", "fence.rectangle_m"),
        ("[fence]\npolygon_m = [[-1, -1], [1, -1], [0, inf]]\n", "fence.polygon_m"),
        ("[fence]\nrectangle_m = [-1, -1, 1, 1]\nmargin_m = nan\n", "fence.margin_m"),
        ("[avoidance]\ndistance_m = -inf\n", "avoidance.distance_m"),
        ("[[obstacle]]\ncentre_m = [2, nan]\nradius_m = 0.1\n", "obstacle[0].centre_m"),
        ("[[obstacle]]\ncentre_m = [2, 0]\nradius_m = nan\n", "obstacle[0].radius_m"),
        (
            "[[obstacle]]\ncentre_m = [2, 0]\nradius_m = 0.1\nvelocity_m_s = [inf, 0]\n",
            "obstacle[0].velocity_m_s",
        ),
    ] {
        let (found, kind, text) = problem(tables);
        assert!(found.starts_with(setting), "{tables}: {text}");
        assert_eq!(kind, ProblemKind::WrongType, "{tables}: {text}");
    }
}

#[test]
fn an_obstacle_is_a_circle_outside_of_the_robot() {
    use ProblemKind::{Contradiction, Missing, OutOfRange};
    for (tables, setting, kind, words) in [
        ("[[obstacle]]\nradius_m = 0.1\n", "obstacle[0].centre_m", Missing, &["circle"][..]),
        ("[[obstacle]]\ncentre_m = [2, 0]\n", "obstacle[0].radius_m", Missing, &["circle"]),
        ("[[obstacle]]\ncentre_m = [2, 0]\nradius_m = -0.1\n", "obstacle[0].radius_m", OutOfRange, &["-0.1"]),
        (
            "[[obstacle]]\ncentre_m = [2e6, 0]\nradius_m = 0.1\n",
            "obstacle[0]",
            OutOfRange,
            &["2000000.0", "1000000.0"],
        ),
        (
            "[[obstacle]]\ncentre_m = [2, 0]\nradius_m = 0.1\nvelocity_m_s = [0, 9e9]\n",
            "obstacle[0]",
            OutOfRange,
            &["9000000000.0"],
        ),
        (
            "[[obstacle]]\ncentre_m = [0.1, 0]\nradius_m = 0.1\n",
            "obstacle[0]",
            Contradiction,
            &["into the footprint"],
        ),
        ("[avoidance]\ndistance_m = 11.0\n", "avoidance.distance_m", OutOfRange, &["11"]),
        ("[avoidance]\ncirculate_1_s = 0.0\n", "avoidance.circulate_1_s", OutOfRange, &["0.01"]),
    ] {
        assert_refused(tables, setting, kind, words);
    }
    let one = "[[obstacle]]\ncentre_m = [3, 0]\nradius_m = 0.1\n";
    assert_eq!(check(&one.repeat(MAX_OBSTACLES)).expect("as many as there may be").guard.obstacles.len(), 16);
    let setting = format!("obstacle[{MAX_OBSTACLES}]");
    assert_refused(&one.repeat(MAX_OBSTACLES + 1), &setting, OutOfRange, &["17", "at most 16"]);
}

#[test]
fn a_footprint_covers_some_floor_in_order() {
    use ProblemKind::{Contradiction, OutOfRange};
    let text = BMM.replace("[platform]\n", "[platform]\nfootprint_m = [[1, 1], [0, nan], [-1, 1]]\n");
    let problems = RobotPlan::from_toml(&text, &Registry::with_built_in(), &|_| Err(String::new()));
    let problems = problems.expect_err("not a number");
    assert_eq!((problems.len(), problems[0].setting.as_str()), (1, "platform.footprint_m[1][1]"));
    for (corners, setting, kind, words) in [
        ("[]", "platform.footprint_m", Contradiction, &["0 corners", "at least 3"][..]),
        ("[[0.3, 0], [-0.3, 0], [0.1, 0]]", "platform.footprint_m", Contradiction, &["2 corners of a hull"]),
        (
            "[[0.3, 0.3], [-0.3, -0.3], [0.3, -0.3], [-0.3, 0.3]]",
            "platform.footprint_m",
            Contradiction,
            &["in order"],
        ),
        ("[[0.3, 0.3], [-0.3, 0.3], [1e7, 0]]", "platform.footprint_m[2]", OutOfRange, &["10000000.0"]),
    ] {
        let text = BMM.replace("[platform]\n", &format!("[platform]\nfootprint_m = {corners}\n"));
        let no_files = |name: &str| Err(format!("no file {name}"));
        let problems = RobotPlan::from_toml(&text, &Registry::with_built_in(), &no_files).expect_err(corners);
        let problem = problems.iter().find(|problem| problem.setting == setting);
        let problem = problem.unwrap_or_else(|| panic!("{corners}: {problems:#?}"));
        assert_eq!(problem.kind, kind, "{problem}");
        assert!(words.iter().all(|word| problem.to_string().contains(word)), "{problem}");
    }
}
