//! Recordings of a simulated robot, read into a page and computed again, by their length.

use std::fs::File;
use std::path::Path;

use omnibase_record::report::Digest;
use omnibase_robot::Registry;
use omnibase_trials::{core_s, framed, robots};

use super::Growth;

/// By minutes.
pub(super) fn growth(folder: &Path, hours: f64) -> Growth {
    let file = folder.join("growth.mcap");
    let all = [1.0, 3.0, 10.0, 30.0, 60.0, 180.0, 600.0];
    let minutes = all.into_iter().filter(|minutes| *minutes <= 60.0 * hours);
    let rows = minutes.map(|minutes| {
        let (seconds, turns) = (60.0 * minutes, 6.0 * minutes);
        let circle = format!(
            "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = {seconds:?}\nturns = {turns:?}\n"
        );
        let (ran, recorded) = framed::record(&format!("{}{circle}", robots::BMM), &file);
        assert!(ran.finished && recorded.failure.is_none(), "{:?} {recorded:?}", ran.ended);
        let megabytes = std::fs::metadata(&file).map_or(0.0, |told| told.len() as f64 * 1e-6);
        let (page_s, page_mb) = cost(|| {
            let digest = Digest::read(|| File::open(&file)).expect("a recording");
            assert_eq!(digest.cycles(), recorded.written);
            assert!(digest.html().len() > 1000);
        });
        let (replay_s, replay_mb) = cost(|| {
            let input = File::open(&file).expect("a recording");
            let again = omnibase_run::replay_from(input, &Registry::with_built_in()).expect("replayed");
            assert_eq!(again.replayed.difference.map(|found| found.channel), None);
        });
        (minutes, vec![megabytes, page_s, page_mb, replay_s, replay_mb])
    });
    let rows = rows.collect();
    let _ = std::fs::remove_file(&file);
    Growth {
        title: "Recordings of a robot with three wheels at 1 kHz",
        across: "minutes",
        curves: vec!["MB", "page, s", "page, MB of memory", "replay, s", "replay, MB of memory"],
        rows,
    }
}

/// Time of a core, s, and the most memory that this process had meanwhile, MB.
fn cost(work: impl FnOnce()) -> (f64, f64) {
    std::fs::write("/proc/self/clear_refs", "5").expect("Linux");
    let began_s = core_s();
    work();
    let took_s = core_s() - began_s;
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let most = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("the most memory");
    let kilobytes: f64 = most.trim().trim_end_matches(" kB").parse().expect("kB");
    (took_s, kilobytes / 1000.0)
}
