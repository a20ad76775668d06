//! The thread that reads the joystick and tells the robot what it wishes; the cycle never waits for it.

use crate::joystick::{JoystickOptions, Source};
use crate::progress::note;
use omnibase_joystick::Map;
use omnibase_joystick::port::Happened;
use omnibase_robot::RobotPlan;
use omnibase_run::live::{Ask, Client, JoystickDriver, Live};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Between two looks at the joystick. The operator takes a joystick that is silent for the command age as lost.
const TURN: Duration = Duration::from_millis(5);

/// Reads a joystick as long as it lives.
pub struct JoystickThread {
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl JoystickThread {
    /// Starts it; a device that is named must be there, otherwise the first one that fits is awaited.
    pub fn start(path: Option<&Path>, plan: &RobotPlan, live: Live) -> anyhow::Result<Self> {
        let options = JoystickOptions { path: path.map(Path::to_owned), table: plan.joystick.clone() };
        let source = Source::open(&options)?;
        if let Source::Installed(finder) = &source
            && finder.path().is_none()
        {
            note(
                "joystick: none that a map fits is there yet; plug one in (`omnibase joystick --list` shows all)",
            );
        }
        let (mut port, mut driver) = (source.port(&options.table), JoystickDriver::new(plan));
        let ends = Arc::new(AtomicBool::new(false));
        let is_over = ends.clone();
        let thread = std::thread::Builder::new().name("joystick".into()).spawn(move || {
            let began = Instant::now();
            let (mut tickets, mut event) = (Vec::new(), 0);
            while !is_over.load(Ordering::Relaxed) {
                let seen = live.snapshot();
                driver.agree(port.joystick_mut(), &seen);
                let (command, happened) = port.turn(began.elapsed().as_nanos() as u64);
                match (happened, port.joystick().map()) {
                    (Some(Happened::Plugged(..)), Some(map)) => tell(map),
                    (Some(Happened::Unplugged), _) => note("joystick: gone"),
                    _ => {}
                }
                let changes = driver.changes();
                if !changes.is_empty() {
                    tickets.extend(live.set(Client::Joystick, &changes));
                }
                if command.requests.teach_point {
                    match live.remember_point() {
                        Ok(count) => note(format_args!("joystick: remembered point {count}")),
                        Err(why) => note(format_args!("joystick: {why}")),
                    }
                }
                for ask in driver.asks(&command, &seen) {
                    let is_asked_once = !matches!(ask, Ask::Stick(_));
                    let ticket = live.send(Client::Joystick, ask);
                    tickets.extend(ticket.filter(|_| is_asked_once));
                }
                tickets.retain(|ticket| {
                    let answer = live.answer(*ticket);
                    if let Some(answer) = answer.filter(|answer| !answer.is_done()) {
                        note(format_args!("joystick: {}", answer.text()));
                    }
                    answer.is_none()
                });
                for happened in live.events_after(event) {
                    event = happened.number;
                    note(format_args!("{:>9.3} s  {}", happened.time_s, happened.text));
                }
                std::thread::sleep(TURN);
            }
        })?;
        Ok(JoystickThread { ends, thread: Some(thread) })
    }
}

impl Drop for JoystickThread {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic of that thread was reported by itself, and the operator stopped for its silence.
            let _ = thread.join();
        }
    }
}

/// What a person must know to drive.
fn tell(map: &Map) {
    let hold = map.dead_man.map(|button| format!("hold {} to drive, ", button.name()));
    let stop = map.stop.map(|button| format!(", {} to stop", button.name()));
    note(format_args!(
        "joystick: {}: {}{} to enable{}",
        map.device.name,
        hold.unwrap_or_default(),
        map.enable.name(),
        stop.unwrap_or_default()
    ));
}
