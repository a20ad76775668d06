//! A joystick as a person or a program reads it.

use omnibase_joystick::port::Happened;
use omnibase_joystick::{
    Block, Description, Hold, Joystick, JoystickCommand, JoystickFrame, JoystickMapError, Map, Presence,
};
use omnibase_robot::config::{AxisCode, ButtonCode, Limits};
use serde_json::{Value, json};
use std::io::{self, Write};
use std::path::Path;

/// The axes that drive, in the order of a twist.
const AXES: [&str; 3] = ["forward", "left", "turn"];

/// Shows maps and values.
pub struct View {
    limits: Option<Limits>,
    as_json: bool,
    as_picture: bool,
    /// Lines of the last picture, over which the next one is drawn.
    drawn: usize,
    last: Option<JoystickCommand>,
    asked: &'static str,
}

/// A device and its map as one line of JSON.
pub fn device_json(
    path: Option<&Path>,
    device: &Description,
    map: &Result<Map, Vec<JoystickMapError>>,
) -> Value {
    let axes: serde_json::Map<String, Value> = device
        .axes
        .iter()
        .map(|(code, range)| {
            let range =
                json!({"min": range.minimum, "max": range.maximum, "flat": range.flat, "fuzz": range.fuzz});
            (AxisCode(*code).name().into_owned(), range)
        })
        .collect();
    let buttons: Vec<_> = device.buttons.iter().map(|code| ButtonCode(*code).name()).collect();
    json!({
        "path": path,
        "name": device.name,
        "vendor_id": format!("{:#06x}", device.vendor_id),
        "product_id": format!("{:#06x}", device.product_id),
        "axes": axes,
        "buttons": buttons,
        "map": map.as_ref().map(map_json).ok(),
        "problems": map.as_ref().err().map(|list| list.iter().map(ToString::to_string).collect::<Vec<_>>()),
    })
}

fn map_json(map: &Map) -> Value {
    let axes: serde_json::Map<String, Value> = AXES
        .iter()
        .zip(map.axes)
        .filter_map(|(name, axis)| {
            let axis = axis?;
            let shaping = axis.shaping;
            let value = json!({
                "axis": axis.axis.name(), "direction": direction(shaping.sign), "offset": shaping.shape.offset,
                "dead_zone": shaping.shape.dead_zone, "gain": shaping.shape.gain, "expo": shaping.shape.expo,
            });
            Some(((*name).to_owned(), value))
        })
        .collect();
    let slider = map.slider.map(|slider| {
        json!({"axis": slider.axis.name(), "direction": direction(slider.sign), "least": slider.least})
    });
    let buttons: serde_json::Map<String, Value> = buttons(map)
        .into_iter()
        .filter_map(|(name, button, _)| Some((name.to_owned(), json!(button?.name()))))
        .collect();
    json!({"ready": map.ready.name(), "axes": axes, "speed": slider, "buttons": buttons})
}

fn direction(sign: f64) -> &'static str {
    if sign < 0.0 { "reversed" } else { "normal" }
}

/// All tasks of buttons, with what they are for.
fn buttons(map: &Map) -> [(&'static str, Option<ButtonCode>, &'static str); 8] {
    [
        ("dead_man", map.dead_man, "held while driving"),
        ("stop", map.stop, "stop, and give the command back"),
        ("enable", Some(map.enable), "enable a blocked joystick, and the drives"),
        ("platform_frame", map.platform_frame, "drive in the platform's frame"),
        ("fixed_frame", map.fixed_frame, "drive in the fixed frame"),
        ("toggle_frame", map.toggle_frame, "change the frame"),
        ("reset_frame", map.reset_frame, "the fixed frame becomes the platform's present one"),
        ("teach_point", map.teach_point, "remember where the robot stands, while points are taught"),
    ]
}

impl View {
    /// Nothing shown yet.
    pub fn new(limits: Option<Limits>, as_json: bool, as_picture: bool) -> Self {
        View { limits, as_json, as_picture, drawn: 0, last: None, asked: "" }
    }

    /// The map of a device that came.
    pub fn map(&mut self, map: &Map, output: &mut dyn Write) -> io::Result<()> {
        self.drawn = 0;
        if self.as_json {
            return writeln!(output, "{}", device_json(None, &map.device, &Ok(map.clone())));
        }
        let device = &map.device;
        writeln!(
            output,
            "{} ({:04x}:{:04x}), map {}",
            device.name,
            device.vendor_id,
            device.product_id,
            map.ready.name()
        )?;
        for (name, axis) in AXES.iter().zip(map.axes) {
            let Some(axis) = axis else {
                writeln!(output, "  {name:<15} -")?;
                continue;
            };
            let (shaping, range) = (axis.shaping, axis.range);
            writeln!(
                output,
                "  {name:<15} {:<16} {} to {}, {}, offset {:.3}, dead zone {:.3}, gain {}, expo {}",
                axis.axis.name(),
                range.minimum,
                range.maximum,
                direction(shaping.sign),
                shaping.shape.offset,
                shaping.shape.dead_zone,
                shaping.shape.gain,
                shaping.shape.expo
            )?;
        }
        if let Some(slider) = map.slider {
            writeln!(
                output,
                "  {:<15} {:<16} {} to {}, {}, at least {}",
                "speed",
                slider.axis.name(),
                slider.range.minimum,
                slider.range.maximum,
                direction(slider.sign),
                slider.least
            )?;
        }
        for (name, button, what) in buttons(map) {
            if let Some(button) = button {
                writeln!(output, "  {name:<15} {:<16} {what}", button.name())?;
            }
        }
        if map.dead_man.is_none() {
            writeln!(output, "  NO DEAD-MAN BUTTON: the robot moves as soon as an axis does")?;
        }
        writeln!(output)
    }

    /// A line, where something changed.
    pub fn line(
        &mut self,
        now_ns: u64,
        command: &JoystickCommand,
        joystick: &Joystick,
        happened: Option<&Happened>,
        output: &mut dyn Write,
    ) -> io::Result<()> {
        let ageless = JoystickCommand { age_ns: None, ..*command };
        if self.last == Some(ageless) && !matches!(happened, Some(Happened::Events(_))) {
            return Ok(());
        }
        self.last = Some(ageless);
        let time_s = now_ns as f64 * 1e-9;
        if !self.as_json {
            return writeln!(
                output,
                "{time_s:>9.3} s  {}  {}{}",
                self.twist_text(command.twist),
                state_text(command),
                asked(command).map(|asked| format!("  {asked}")).unwrap_or_default()
            );
        }
        let state = joystick.state();
        let raw: serde_json::Map<String, Value> = state
            .into_iter()
            .flat_map(|state| &state.axes)
            .map(|(code, value)| (AxisCode(*code).name().into_owned(), json!(value)))
            .collect();
        let pressed: Vec<_> =
            state.into_iter().flat_map(|state| &state.pressed).map(|code| ButtonCode(*code).name()).collect();
        let shaped = joystick
            .map()
            .zip(state)
            .map(|(map, state)| json!({"twist": map.twist(state), "speed_factor": map.speed_factor(state)}));
        let speeds =
            self.speeds(command.twist).map(|[x, y, w]| json!({"vx_m_s": x, "vy_m_s": y, "w_rad_s": w}));
        let line = json!({
            "time_s": time_s,
            "raw": raw,
            "pressed": pressed,
            "shaped": shaped,
            "twist": command.twist,
            "speeds": speeds,
            "frame": frame(command),
            "hold": hold(command),
            "presence": presence(command),
            "block": block(command),
            "asked": asked(command),
        });
        writeln!(output, "{line}")
    }

    /// A picture of now, over the last one.
    pub fn picture(
        &mut self,
        command: &JoystickCommand,
        joystick: &Joystick,
        output: &mut dyn Write,
    ) -> io::Result<()> {
        if let Some(asked) = asked(command) {
            self.asked = asked;
        }
        let mut lines = Vec::new();
        if let (Some(map), Some(state)) = (joystick.map(), joystick.state()) {
            for (name, axis) in AXES.iter().zip(map.axes) {
                let Some(axis) = axis else { continue };
                let raw = state.axes.get(&axis.axis.0).copied().unwrap_or_default();
                let shaped = axis.shaping.shape(raw, axis.range);
                lines.push(format!("  {name:<8} raw {raw:>7}  shaped {shaped:>7.3}  {}", bar(shaped)));
            }
            lines.push(format!("  speed    {:>5.1} %", map.speed_factor(state) * 100.0));
            let pressed: Vec<_> = state.pressed.iter().map(|code| ButtonCode(*code).name()).collect();
            lines.push(format!("  pressed  {}", pressed.join(" ")));
        } else {
            lines.push("  waiting for a joystick".to_owned());
        }
        lines.push(format!("  wish     {}", self.twist_text(command.twist)));
        lines.push(format!("  state    {}", state_text(command)));
        lines.push(format!("  asked    {}", self.asked));
        if self.as_picture && self.drawn > 0 {
            // Up over the last picture, and away with it.
            write!(io::stdout(), "\x1b[{}A\x1b[J", self.drawn)?;
        }
        for line in &lines {
            writeln!(output, "{line}")?;
        }
        self.drawn = lines.len();
        output.flush()
    }

    fn speeds(&self, [x, y, turn]: [f64; 3]) -> Option<[f64; 3]> {
        let limits = self.limits.as_ref()?;
        Some([x * limits.speed_m_s, y * limits.speed_m_s, turn * limits.turn_speed_rad_s])
    }

    fn twist_text(&self, twist: [f64; 3]) -> String {
        match self.speeds(twist) {
            Some([x, y, w]) => format!("x {x:>7.3} m/s  y {y:>7.3} m/s  turn {w:>7.3} rad/s"),
            None => {
                let [x, y, turn] = twist.map(|part| part * 100.0);
                format!("x {x:>6.1} %  y {y:>6.1} %  turn {turn:>6.1} %")
            }
        }
    }
}

fn bar(value: f64) -> String {
    const HALF: i32 = 10;
    let at = (value * f64::from(HALF)).round() as i32;
    let cell = |place: i32| match place {
        0 => '|',
        place if (0 < place && place <= at) || (at <= place && place < 0) => '#',
        _ => '.',
    };
    (-HALF..=HALF).map(cell).collect()
}

fn state_text(command: &JoystickCommand) -> String {
    let block = block(command).map(|why| format!(", blocked ({why}): press the enable button"));
    format!("{}, {}, {} frame{}", presence(command), hold(command), frame(command), block.unwrap_or_default())
}

fn asked(command: &JoystickCommand) -> Option<&'static str> {
    let requests = command.requests;
    match (requests.stop, requests.enable, requests.reset_frame) {
        (true, _, _) => Some("stop"),
        (_, true, _) => Some("enable"),
        (_, _, true) => Some("reset_frame"),
        _ => None,
    }
}

fn frame(command: &JoystickCommand) -> &'static str {
    match command.frame {
        JoystickFrame::Platform => "platform",
        JoystickFrame::Fixed => "fixed",
    }
}

fn hold(command: &JoystickCommand) -> &'static str {
    match command.hold {
        Hold::Held => "held",
        Hold::Released => "released",
    }
}

fn presence(command: &JoystickCommand) -> &'static str {
    match command.presence {
        Presence::Present => "present",
        Presence::Absent => "absent",
    }
}

fn block(command: &JoystickCommand) -> Option<&'static str> {
    command.block.map(|block| match block {
        Block::Lost => "lost",
        Block::Stopped => "stopped",
    })
}
