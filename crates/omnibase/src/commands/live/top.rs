//! The terminal view of a running robot.

use super::Line as Wire;
use crate::terminal::fixed;
use omnibase_platform::wrap_angle_rad;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Cell, Paragraph, Row, Table};
use serde_json::{Value, json};
use std::io::IsTerminal;
use std::time::Duration;

/// Between two views.
const TICK: Duration = Duration::from_millis(100);
/// Size of a view that is printed once where no terminal tells one.
const PRINTED: (u16, u16) = (100, 30);
/// In less than this what stands side by side stands below each other, and timing is told in one line.
const ROOMY: (u16, u16) = (80, 24);

/// What is shown.
pub struct View {
    robot: Value,
    now: Value,
    events: Vec<Value>,
    /// What the last key led to.
    said: String,
}

impl View {
    /// Reads it.
    pub fn read(line: &Wire) -> anyhow::Result<Self> {
        let mut view =
            View { robot: line.read("robot")?, now: Value::Null, events: Vec::new(), said: String::new() };
        view.update(line)?;
        Ok(view)
    }

    fn update(&mut self, line: &Wire) -> anyhow::Result<()> {
        self.now = line.read("now")?;
        self.events = line.read("events")?.as_array().cloned().unwrap_or_default();
        Ok(())
    }

    fn value(&self, name: &str) -> f64 {
        self.now["values"][name].as_f64().unwrap_or(f64::NAN)
    }
}

/// One view as text, as large as the terminal that shows it.
pub fn text(view: &View) -> String {
    let terminal = std::io::stdout().is_terminal().then(|| ratatui::crossterm::terminal::size().ok());
    let (width, height) = terminal.flatten().unwrap_or(PRINTED);
    text_of_size(view, width, height)
}

fn text_of_size(view: &View, width: u16, height: u16) -> String {
    let Ok(mut terminal) = Terminal::new(TestBackend::new(width, height));
    let Ok(_) = terminal.draw(|frame| draw(frame, view));
    let buffer = terminal.backend().buffer();
    let rows = buffer.content().chunks(usize::from(width));
    let rows = rows.map(|row| row.iter().map(|cell| cell.symbol()).collect::<String>().trim_end().to_owned());
    rows.collect::<Vec<_>>().join("\n").trim_end().to_owned()
}

/// Shows it until a person has seen enough.
pub fn show(line: &Wire) -> anyhow::Result<()> {
    let mut view = View::read(line)?;
    let mut terminal = ratatui::try_init()?;
    let result = loop {
        if let Err(error) = terminal.draw(|frame| draw(frame, &view)) {
            break Err(error.into());
        }
        match event::poll(TICK).and_then(|there| if there { event::read().map(Some) } else { Ok(None) }) {
            Ok(Some(Event::Key(key))) if key.kind == KeyEventKind::Press => match key.code {
                KeyCode::Char('q') | KeyCode::Esc => break Ok(()),
                KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => break Ok(()),
                KeyCode::Char(' ') => {
                    view.said = match line.ask(&json!({"do": "emergency_stop"})) {
                        Ok(said) => {
                            format!("emergency stop: {}", said["text"].as_str().unwrap_or("no answer"))
                        }
                        Err(error) => format!("emergency stop: {error:#}"),
                    };
                }
                _ => {}
            },
            Ok(_) => {}
            Err(error) => break Err(error.into()),
        }
        if let Err(error) = view.update(line) {
            break Err(error);
        }
    };
    ratatui::restore();
    result
}

fn draw(frame: &mut ratatui::Frame<'_>, view: &View) {
    let area = frame.area();
    let is_roomy = area.width >= ROOMY.0 && area.height >= ROOMY.1;
    let drives = view.now["drives"].as_array().map_or(0, Vec::len) as u16;
    let state = state(view);
    let (head_lines, times) = (state.len() as u16, times(view));
    let times = if is_roomy { times } else { times.into_iter().take(1).collect() };
    let pose = platform(view, is_roomy);
    let tall = pose.len() as u16 + 2;
    let (below, beside) = if is_roomy { (0, tall) } else { (tall, 0) };
    let [head, above, middle, timing, events, foot] = Layout::vertical([
        Constraint::Length(head_lines + 2),
        Constraint::Length(below),
        Constraint::Length((drives + 3).max(beside)),
        Constraint::Length(times.len() as u16 + 2),
        Constraint::Min(0),
        Constraint::Length(1),
    ])
    .areas(area);
    let side_by_side = Layout::horizontal([Constraint::Percentage(42), Constraint::Percentage(58)]);
    let [left, right] = if is_roomy { side_by_side.areas(middle) } else { [above, middle] };
    frame.render_widget(Paragraph::new(state).block(block(word(&view.robot["name"]))), head);
    frame.render_widget(Paragraph::new(pose).block(block("platform")), left);
    frame.render_widget(table(view), right);
    frame.render_widget(Paragraph::new(times).block(block("cycle")), timing);
    frame.render_widget(happened(view, events.height), events);
    let keys = if view.said.is_empty() { "space: emergency stop   q: leave" } else { &view.said };
    frame.render_widget(Paragraph::new(keys).style(Style::new().add_modifier(Modifier::DIM)), foot);
}

fn block(title: &str) -> Block<'_> {
    Block::bordered().title(Span::styled(format!(" {title} "), Style::new().add_modifier(Modifier::BOLD)))
}

fn word(value: &Value) -> &str {
    value.as_str().unwrap_or("?")
}

fn state(view: &View) -> Vec<Line<'_>> {
    let now = &view.now;
    let phase = word(&now["phase"]);
    let colour = match phase {
        "holding" | "tracking" => Color::Green,
        "fault" | "quick stopping" => Color::Red,
        "enabling" | "stopping" => Color::Yellow,
        _ => Color::Gray,
    };
    let how = if now["by_stick"] == true { " by hand" } else { "" };
    let mut first = vec![
        Span::styled(phase.to_uppercase(), Style::new().fg(colour).add_modifier(Modifier::BOLD)),
        Span::raw(format!("   commands: {}{how}", word(&now["commander"]))),
    ];
    if now["emergency_stop"] == true {
        let style = Style::new().fg(Color::White).bg(Color::Red).add_modifier(Modifier::BOLD);
        first.push(Span::styled("  EMERGENCY STOP  ", style));
    }
    let stopped = word(&now["stop_reason"]);
    let mut lines = vec![Line::from(first)];
    if !stopped.is_empty() {
        lines.push(Line::from(format!("last stop: {stopped}")));
    }
    let joystick = joystick(now);
    if !joystick.is_empty() {
        lines.push(Line::from(Span::styled(joystick, Style::new().fg(Color::Yellow))));
    }
    lines
}

/// What became of the joystick at the robot's computer, and what brings it back.
fn joystick(now: &Value) -> &'static str {
    match word(&now["joystick"]) {
        "present" => "joystick: present",
        "lost" => "joystick: lost; plug it in again, then `omnibase call enable_joystick` or its own button",
        "blocked" => "joystick: blocked; `omnibase call enable_joystick` or its own button, and let go of it",
        _ => "",
    }
}

fn platform(view: &View, is_roomy: bool) -> Vec<Line<'_>> {
    let speed_m_s = view.value("state/twist_in_body_x_m_s").hypot(view.value("state/twist_in_body_y_m_s"));
    let [x, y] = ["x", "y"].map(|axis| fixed(view.value(&format!("state/pose_{axis}_m")), 4));
    let place = format!("x {x:>9} m    y {y:>9} m");
    let heading_deg = wrap_angle_rad(view.value("state/pose_heading_rad")).to_degrees();
    let heading = format!("heading {:>7}°", fixed(heading_deg, 2));
    let speed = format!("speed {} m/s", fixed(speed_m_s, 3));
    let error = format!("error {} mm", fixed(1e3 * view.value("error/believed_m"), 3));
    let lines = if is_roomy {
        vec![place, heading, speed, error, floor(view)]
    } else {
        vec![place, format!("{heading}   {speed}   {error}")]
    };
    lines.into_iter().map(Line::from).collect()
}

/// The floor's friction as slipping wheels found it, and what it leaves of the accelerations.
fn floor(view: &View) -> String {
    let friction = view.value("estimate/floor_friction");
    let mut text = if friction.is_nan() {
        "floor: no slip yet".to_owned()
    } else {
        format!("floor: friction {friction:.3} ± {:.3}", view.value("estimate/floor_friction_sigma"))
    };
    let share = view.value("traction/share");
    if share < 1.0 {
        text += &format!(", {:.0} %", 100.0 * share);
    }
    text
}

fn table(view: &View) -> Table<'_> {
    let wheels = view.robot["wheels"].as_array().into_iter().flatten();
    let drives = view.now["drives"].as_array().into_iter().flatten();
    let rows = wheels.zip(drives).enumerate().map(|(n, (wheel, drive))| {
        let error = word(&drive["error"]);
        let state = if error.is_empty() { word(&drive["state"]) } else { error };
        let style = if error.is_empty() { Style::new() } else { Style::new().fg(Color::Red) };
        let number = |what: &str| format!("{:>8}", fixed(view.value(&format!("wheel_{}/{what}", n + 1)), 2));
        Row::new([
            Cell::from(word(&wheel["name"]).to_owned()),
            Cell::from(state.to_owned()).style(style),
            Cell::from(number("speed_rad_s")),
            Cell::from(number("torque_nm")),
        ])
    });
    let widths = [Constraint::Length(10), Constraint::Min(10), Constraint::Length(9), Constraint::Length(9)];
    let header = Row::new(["drive", "state", "   rad/s", "     N·m"]);
    Table::new(rows, widths)
        .header(header.style(Style::new().add_modifier(Modifier::DIM)))
        .block(block("drives"))
}

/// What is measured of cycles, as the API and as people call it.
const MEASURES: [(&str, &str); 4] = [
    ("wake_up", "wake-up late"),
    ("round_trip", "round trip"),
    ("compute", "compute"),
    ("dc_phase", "DC phase"),
];

fn times(view: &View) -> Vec<Line<'_>> {
    let count = |n: usize| view.now["counts"][n].as_u64().unwrap_or(0);
    let mut lines = vec![format!(
        "{:.1} s   {} cycles   {} frames lost   {} left out",
        view.now["time_s"].as_f64().unwrap_or(0.0),
        count(0),
        count(1),
        count(2),
    )];
    for (name, words) in MEASURES {
        let measured = &view.now["timing"][name];
        if measured.is_object() {
            let us = |what: &str| measured[what].as_f64().unwrap_or(f64::NAN) * 1e-3;
            lines.push(format!(
                "{words:13} half {:>7.1}   99 % {:>7.1}   most {:>7.1} us, in cycle {} at {:.2} s",
                us("p50_ns"),
                us("p99_ns"),
                us("max_ns"),
                measured["worst_cycle"],
                measured["worst_time_s"].as_f64().unwrap_or(f64::NAN),
            ));
        }
    }
    lines.into_iter().map(Line::from).collect()
}

fn happened(view: &View, height: u16) -> Paragraph<'_> {
    let last = view.events.iter().rev().take(usize::from(height.saturating_sub(2)));
    let line = |event: &Value| {
        Line::from(format!("{:>9.3} s  {}", event["time_s"].as_f64().unwrap_or(0.0), word(&event["text"])))
    };
    Paragraph::new(last.map(line).collect::<Vec<_>>()).block(block("events"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view() -> View {
        let wheels: Vec<Value> = (1..=4).map(|n| json!({"name": format!("wheel_{n}")})).collect();
        let drives: Vec<Value> = (0..4).map(|_| json!({"state": "running", "error": ""})).collect();
        let values = json!({
            "state/pose_x_m": -0.000_04, "state/pose_y_m": -12.5, "state/pose_heading_rad": 7.0 * std::f64::consts::FRAC_PI_2,
            "state/twist_in_body_x_m_s": 0.3, "state/twist_in_body_y_m_s": -0.4, "error/believed_m": -1e-9,
            "wheel_4/torque_nm": -0.001, "wheel_4/speed_rad_s": -3.25,
        });
        let now = json!({
            "phase": "tracking", "commander": "page 1", "stop_reason": "", "joystick": "none", "drives": drives,
            "counts": [81_230, 1, 2], "time_s": 81.23, "values": values,
            "timing": {"wake_up": {"p50_ns": 1e3, "p99_ns": 2e3, "max_ns": 3e3, "worst_cycle": 5, "worst_time_s": 0.1}},
        });
        let robot = json!({"name": "bmm", "wheels": wheels});
        View { robot, now, events: vec![json!({"time_s": 1.5, "text": "holding"})], said: String::new() }
    }

    #[test]
    fn all_that_matters_stands_in_sixty_by_twenty_and_nothing_is_cut() {
        for (width, height) in [(60, 20), (80, 24), (200, 50)] {
            let text = text_of_size(&view(), width, height);
            for word in [
                "TRACKING",
                "commands: page 1",
                "x    0.0000 m    y  -12.5000 m",
                "heading  -90.00°",
                "speed 0.500 m/s",
                "error 0.000 mm",
                "wheel_1",
                "wheel_4",
                "-3.25",
                "0.00",
                "81230 cycles",
                "1 frames lost",
                "q: leave",
            ] {
                assert!(text.contains(word), "{width}x{height}: {word}:\n{text}");
            }
            assert!(!text.contains("-0.00 "), "{text}");
            assert_eq!(text.contains("wake-up late"), width > 60, "{text}");
        }
    }
}
