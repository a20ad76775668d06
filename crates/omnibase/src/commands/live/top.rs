//! The terminal view of a running robot.

use super::Line as Wire;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Cell, Paragraph, Row, Table};
use serde_json::{Value, json};
use std::time::Duration;

/// Between two views.
const TICK: Duration = Duration::from_millis(100);
/// Size of a view that is printed once.
const PRINTED: (u16, u16) = (100, 30);

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

/// One view as text.
pub fn text(view: &View) -> String {
    let backend = TestBackend::new(PRINTED.0, PRINTED.1);
    let Ok(mut terminal) = Terminal::new(backend);
    let Ok(_) = terminal.draw(|frame| draw(frame, view));
    let buffer = terminal.backend().buffer();
    let rows = buffer.content().chunks(usize::from(PRINTED.0));
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
                    view.said = match line.call(&json!({"do": "emergency_stop"})) {
                        Ok((_, text)) => format!("emergency stop: {text}"),
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
    let drives = view.now["drives"].as_array().map_or(0, Vec::len) as u16;
    let [head, middle, timing, events, foot] = Layout::vertical([
        Constraint::Length(5),
        Constraint::Length(drives + 3),
        Constraint::Length(7),
        Constraint::Min(3),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    let [pose, wheels] =
        Layout::horizontal([Constraint::Percentage(42), Constraint::Percentage(58)]).areas(middle);
    frame.render_widget(state(view), head);
    frame.render_widget(platform(view), pose);
    frame.render_widget(table(view), wheels);
    frame.render_widget(times(view), timing);
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

fn state(view: &View) -> Paragraph<'_> {
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
    let second = if stopped.is_empty() { String::new() } else { format!("last stop: {stopped}") };
    let third = Span::styled(joystick(now), Style::new().fg(Color::Yellow));
    Paragraph::new(vec![Line::from(first), Line::from(second), Line::from(third)])
        .block(block(word(&view.robot["name"])))
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

fn platform(view: &View) -> Paragraph<'_> {
    let speed_m_s = view.value("state/twist_in_body_x_m_s").hypot(view.value("state/twist_in_body_y_m_s"));
    let lines = [
        format!("x {:>9.4} m    y {:>9.4} m", view.value("state/pose_x_m"), view.value("state/pose_y_m")),
        format!(
            "heading {:>7.2}°   speed {speed_m_s:.3} m/s",
            view.value("state/pose_heading_rad").to_degrees()
        ),
        format!("error {:.3} mm", 1e3 * view.value("error/believed_m")),
        floor(view),
    ];
    Paragraph::new(lines.map(Line::from).to_vec()).block(block("platform"))
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
        let number = |what: &str| format!("{:>8.2}", view.value(&format!("wheel_{}/{what}", n + 1)));
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

fn times(view: &View) -> Paragraph<'_> {
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
    Paragraph::new(lines.into_iter().map(Line::from).collect::<Vec<_>>()).block(block("cycle"))
}

fn happened(view: &View, height: u16) -> Paragraph<'_> {
    let last = view.events.iter().rev().take(usize::from(height.saturating_sub(2)));
    let line = |event: &Value| {
        Line::from(format!("{:>9.3} s  {}", event["time_s"].as_f64().unwrap_or(0.0), word(&event["text"])))
    };
    Paragraph::new(last.map(line).collect::<Vec<_>>()).block(block("events"))
}
