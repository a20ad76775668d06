//! Motions that a page loads: registered ones like built-in ones, and what nobody reads is refused.

mod bench;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use bench::{Bench, Page, TOKEN};
use omnibase_platform::Pose2;
use omnibase_robot::registry::{Kind, needed};
use omnibase_robot::signals::{Course, CycleRecord, Phase, RequestAnswer, Setpoint};
use omnibase_robot::stages::Reference;
use omnibase_robot::{Registry, RequestKind};
use omnibase_run::live::{LiveEnd, Snapshot};
use serde_json::{Value, json};

/// Goes one step ahead with each sample, and forgets nothing at its start: who sampled it before sees it.
struct Steps {
    step_m: f64,
    steps: f64,
}

impl Reference for Steps {
    fn sample(&mut self, _: f64) -> Setpoint {
        self.steps += 1.0;
        Setpoint::at_rest(Pose2 { x_m: self.step_m * self.steps, ..Pose2::default() })
    }

    fn duration_s(&self) -> Option<f64> {
        Some(4.0)
    }
}

/// A robot that would go such steps.
fn bench() -> Bench {
    let mut registry = Registry::with_built_in();
    let keys = vec![needed("step_m").number("From sample to sample, m", 0.0..=1.0)];
    registry.references.add(Kind { name: "steps", meaning: "Step by step", keys }, |table, _| {
        Ok(Steps { step_m: table.custom.number("step_m")?, steps: 0.0 })
    });
    Bench::with(registry, &["reference.kind = \"steps\"", "reference.custom.step_m = 0.25"])
}

/// A page that may command.
fn page(bench: &mut Bench) -> Page {
    let mut page = bench.page();
    assert_eq!(page.hear("may")["may"], "command");
    bench.until("its cycle takes it in", |_, _| Some(()));
    page
}

#[test]
fn a_registered_motion_is_drawn_and_its_cycle_gets_one_that_nobody_used() {
    let mut bench = bench();
    let planned: Value = {
        let asked = ureq::get(format!("http://{}/api/planned", bench.dashboard.address));
        let mut answer = asked.header("Authorization", format!("Bearer {TOKEN}")).call().unwrap();
        serde_json::from_str(&answer.body_mut().read_to_string().unwrap()).unwrap()
    };
    assert_eq!((&planned["name"], &planned["duration_s"]), (&json!("steps"), &json!(4.0)));
    assert_eq!((&planned["poses"][0][0], &planned["poses"][400][0]), (&json!(0.25), &json!(100.25)));
    let mut page = page(&mut bench);
    page.send(&json!({"do": "load", "reference": {"kind": "steps", "custom": {"step_m": 0.5}}, "stamp": 0}));
    let begin = Instant::now();
    let mut offered = loop {
        bench.cycle += 1;
        if let Some((_, offered)) = bench.end.turn(bench.cycle, &CycleRecord::default(), Phase::Holding).offer
        {
            break offered;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "it was never offered");
        std::thread::yield_now();
    };
    offered.start(&Setpoint::default());
    assert_eq!(offered.sample(0.0).odom_from_body.x_m, 0.5, "somebody sampled it before");
}

#[test]
fn what_nobody_reads_of_a_loaded_motion_is_refused_with_what_is_expected_and_found() {
    let mut bench = bench();
    let mut page = page(&mut bench);
    let folder = bench.folder.path();
    std::fs::write(folder.join("odd.toml"), "kind = \"path\"\npoints_fil = \"odd.dat\"\n").unwrap();
    std::fs::write(folder.join("odd.dat"), "0 0 0 0\n4 0.5 0 0\n").unwrap();
    let reference = |keys: Value| json!({"number": 1, "do": "load", "reference": keys, "stamp": 0});
    for (call, words) in [
        (
            reference(json!({"kind": "circle", "radius_m": 0.3, "duratoin_s": 5})),
            &["reference.duratoin_s: no setting has this name; did you mean `duration_s`?", "turns"][..],
        ),
        (
            reference(json!({"kind": "circle", "radius_m": 0.3, "step_m": 1})),
            &["reference.step_m = 1.0: the reference `circle` doesn't read it", "radius_m"],
        ),
        (
            reference(json!({"kind": "circle", "radius_m": "big"})),
            &["reference.radius_m = \"big\": the value has another type than number"],
        ),
        (reference(json!({"kind": "circle"})), &["reference.radius_m: must be given: `circle` needs it"]),
        (
            reference(json!({"kind": "circl", "radius_m": 0.3})),
            &["reference.kind = \"circl\"", "did you mean `circle`?", "steps"],
        ),
        (
            reference(json!({"kind": "steps", "custom": {"steps_m": 0.1}})),
            &[
                "reference.custom.step_m: must be given",
                "reference.custom.steps_m = 0.1: the reference `steps` doesn't read it; did you mean `custom.step_m`?",
            ],
        ),
        (
            reference(json!({"kind": "steps", "custom": {"step_m": 2}})),
            &["reference.custom.step_m = 2: expected a number within its bounds (allowed: 0 to 1)"],
        ),
        (
            reference(json!({"kind": "path", "points_file": "/etc/passwd"})),
            &["reference.points_file = \"/etc/passwd\": names a file of this computer: expected `points`"],
        ),
        (
            json!({"number": 1, "do": "load_saved", "name": "odd", "stamp": 0}),
            &["odd.toml:2:1: reference.points_fil: no setting has this name; did you mean `points_file`?"],
        ),
    ] {
        page.send(&call);
        let said = page.hear("answer");
        let text = said["text"].as_str().unwrap();
        assert_eq!(said["done"], false, "{call}: {text}");
        assert!(words.iter().all(|word| text.contains(word)), "{call}: {text}");
    }
    std::fs::write(folder.join("odd.toml"), "kind = \"path\"\npoints_file = \"odd.dat\"\n").unwrap();
    page.send(&json!({"number": 2, "do": "load_saved", "name": "odd", "stamp": 0}));
    bench.until("the saved path", |_, request| {
        matches!(request?.kind, RequestKind::UseReference { .. }).then_some(())
    });
}

struct Over<'a>(&'a AtomicBool);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A robot that follows what it is told to, or refuses all of it, until it is over.
fn obey(mut end: LiveEnd, refuses: &AtomicBool, is_over: &AtomicBool) {
    let mut seen = Snapshot { phase: Phase::Holding, ..Snapshot::default() };
    seen.record.course = Course::Reference;
    let mut loaded = 0;
    while !is_over.load(Ordering::Relaxed) {
        // Nothing grows old, however long it is planned.
        seen.record.time.now_ns += 1;
        let turn = end.turn(seen.record.time.now_ns, &seen.record, seen.phase);
        if let Some((number, reference)) = turn.offer {
            loaded = number;
            end.give_back(reference);
        }
        seen.record.request = turn.request;
        seen.record.answer = match turn.request.map(|request| request.kind) {
            Some(RequestKind::Track) if refuses.load(Ordering::Relaxed) => RequestAnswer::OutsideFence,
            Some(kind) => {
                if kind == RequestKind::Track {
                    (seen.phase, seen.record.reference) = (Phase::Tracking, loaded.into());
                }
                RequestAnswer::Taken
            }
            None => RequestAnswer::None,
        };
        end.show(&seen);
        std::thread::yield_now();
    }
}

#[test]
fn a_drive_that_the_robot_itself_refuses_leaves_it_on_the_one_before_or_where_it_stands() {
    let Bench { dashboard, end, folder, .. } = Bench::new();
    let (refuses, is_over) = (AtomicBool::new(true), AtomicBool::new(false));
    std::thread::scope(|scope| {
        // Whatever fails here, the robot's thread ends.
        let _over = Over(&is_over);
        scope.spawn(|| obey(end, &refuses, &is_over));
        let mut page = Page::at(dashboard.address);
        assert_eq!(page.hear("may")["may"], "command");
        let mut drive_to = |x_m: f64| {
            // The robot may not have been seen yet.
            let said = loop {
                let stamp = page.hear("stamp")["stamp"].clone();
                page.send(&json!({"number": 1, "do": "drive_to", "pose": [x_m, 0, 0], "stamp": stamp}));
                let said = page.hear("answer");
                if !said["text"].as_str().unwrap().contains("enable it first") {
                    break said;
                }
            };
            let begin = Instant::now();
            let way = loop {
                assert!(begin.elapsed() < Duration::from_secs(60), "{said}, and nothing of the way");
                let heard = page.hear("drive_to")["drive_to"].clone();
                // What it says of the way comes once somebody has looked after it.
                if heard["text"]
                    .as_str()
                    .is_some_and(|text| text.contains("fence") != said["done"].as_bool().unwrap())
                {
                    break heard;
                }
            };
            (said, way)
        };
        let (said, way) = drive_to(1.0);
        assert_eq!(said["done"], false, "{said}");
        assert_eq!((&way["under_way"], &way["failed"]), (&json!(false), &json!(true)), "{way}");
        refuses.store(false, Ordering::Relaxed);
        let (said, way) = drive_to(2.0);
        assert_eq!(
            (&said["done"], &way["goal"][0], &way["under_way"]),
            (&json!(true), &json!(2.0), &json!(true))
        );
        refuses.store(true, Ordering::Relaxed);
        let (said, way) = drive_to(3.0);
        assert_eq!(said["done"], false, "{said}");
        assert_eq!(
            (&way["goal"][0], &way["under_way"], &way["failed"]),
            (&json!(2.0), &json!(true), &json!(false))
        );
        // A pause ends it whatever the robot does meanwhile, and nobody goes on with it.
        let mut ask = |call: &str| {
            let stamp = page.hear("stamp")["stamp"].clone();
            page.send(&json!({"number": 1, "do": call, "stamp": stamp}));
            page.hear("answer")
        };
        assert_eq!(ask("pause")["done"], true);
        let said = ask("resume");
        assert!(said["text"].as_str().unwrap().contains("drive there again"), "{said}");
        let begin = Instant::now();
        while page.hear("drive_to")["drive_to"]["under_way"] != false {
            assert!(begin.elapsed() < Duration::from_secs(60), "it is still looked after");
        }
    });
    drop((dashboard, folder));
}
