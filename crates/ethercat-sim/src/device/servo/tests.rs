//! The servo without a bus.

mod homing;

use super::*;
use crate::device::axis::{Load, SingleAxis};
use crate::dictionary::Field;
use omnibase_ethercat_wire::sii::Identity;

const REVOLUTION: i32 = 1 << 20;

/// A servo without a bus, in cycles of 1 ms.
struct Bench {
    servo: Servo,
    dictionary: Dictionary,
    now: HostTime,
}

impl Bench {
    fn with(config: ServoConfig) -> Self {
        Bench::on(config, Box::new(SingleAxis::new(Load::default())))
    }

    fn on(config: ServoConfig, axis: Box<dyn Axis>) -> Self {
        let nameplate = Nameplate {
            device_type: 0,
            name: String::new(),
            hardware_version: String::new(),
            software_version: String::new(),
            identity: Identity::default(),
        };
        let (mut servo, mut dictionary) = Servo::new(config, &nameplate, &[], axis);
        servo.power_on(&mut dictionary, HostTime(0));
        servo.state_changed(&mut dictionary, AlState::Op, AlStatusCode::NO_ERROR);
        let mut bench = Bench { servo, dictionary, now: HostTime(0) };
        bench.set_u16(0x6072, 3000);
        bench.run(20);
        bench
    }

    fn new() -> Self {
        Bench::with(ServoConfig::default())
    }

    /// Enabled in this mode.
    fn enabled(mode: i8) -> Self {
        let mut bench = Bench::new();
        bench.set_mode(mode);
        bench.enable();
        bench
    }

    fn enable(&mut self) {
        for control in [0x06, 0x07, 0x0F] {
            self.control(control);
        }
        assert_eq!(self.state(), 0x27);
    }

    fn cycle(&mut self, outputs: Outputs) {
        self.now = HostTime(self.now.0 + 1_000_000);
        let moment = Moment { now: self.now, outputs, cycle_ns: Some(1_000_000) };
        self.servo.run(&mut self.dictionary, moment);
    }

    fn run(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.cycle(Outputs::New);
        }
    }

    fn control(&mut self, control: u16) {
        self.set_u16(0x6040, control);
        self.run(1);
    }

    fn status(&self) -> u16 {
        self.dictionary.get(self.servo.fields.status)
    }

    fn state(&self) -> u16 {
        match self.status() & 0x4F {
            masked @ (0x40 | 0x00 | 0x08 | 0x0F) => masked,
            _ => self.status() & 0x6F,
        }
    }

    fn set_mode(&mut self, mode: i8) {
        let field = self.servo.fields.mode;
        self.dictionary.set(field, mode);
    }

    fn set_i32(&mut self, index: u16, value: i32) {
        let field: Field<i32> = self.dictionary.field(index, 0).unwrap();
        self.dictionary.set(field, value);
    }

    fn set_u32(&mut self, index: u16, value: u32) {
        let field: Field<u32> = self.dictionary.field(index, 0).unwrap();
        self.dictionary.set(field, value);
    }

    fn set_i16(&mut self, index: u16, value: i16) {
        let field: Field<i16> = self.dictionary.field(index, 0).unwrap();
        self.dictionary.set(field, value);
    }

    fn set_u16(&mut self, index: u16, value: u16) {
        let field: Field<u16> = self.dictionary.field(index, 0).unwrap();
        self.dictionary.set(field, value);
    }

    fn i32(&self, index: u16) -> i32 {
        self.dictionary.get(self.dictionary.field(index, 0).unwrap())
    }

    fn i16(&self, index: u16) -> i16 {
        self.dictionary.get(self.dictionary.field(index, 0).unwrap())
    }

    fn u16(&self, index: u16) -> u16 {
        self.dictionary.get(self.dictionary.field(index, 0).unwrap())
    }
}

#[test]
fn the_state_machine_goes_every_way_of_the_standard() {
    let mut bench = Bench::new();
    assert_eq!(bench.state(), 0x40);
    for (control, state) in [
        (0x0F, 0x40), // not in one step
        (0x07, 0x40),
        (0x06, 0x21), // 2
        (0x06, 0x21),
        (0x07, 0x23), // 3
        (0x06, 0x21), // 6
        (0x00, 0x40), // 7
        (0x06, 0x21),
        (0x02, 0x40), // 7 by quick stop
        (0x06, 0x21),
        (0x0F, 0x23), // 3 and
        (0x0F, 0x27), // 4
        (0x07, 0x27), // 5, by a ramp that ends in the next cycle, as the motor stands
        (0x07, 0x23),
        (0x00, 0x40), // 10
        (0x06, 0x21),
        (0x07, 0x23),
        (0x0F, 0x27),
        (0x06, 0x21), // 8
        (0x07, 0x23),
        (0x0F, 0x27),
        (0x00, 0x40), // 9
    ] {
        bench.control(control);
        assert_eq!(bench.state(), state, "after 0x{control:02X}");
    }
}

#[test]
fn the_drive_needs_a_moment_after_power_on() {
    let mut bench = Bench::new();
    bench.servo.power_on(&mut bench.dictionary, bench.now);
    bench.run(5);
    assert_eq!(bench.status(), 0);
    bench.run(10);
    assert_eq!(bench.state(), 0x40);
}

#[test]
fn a_fault_wants_a_rising_edge_of_its_reset() {
    let mut bench = Bench::enabled(8);
    assert!(bench.servo.fault(&mut bench.dictionary, 0x4310));
    bench.run(1);
    assert_eq!((bench.state(), bench.u16(0x603F)), (0x08, 0x4310));
    assert_eq!(bench.servo.take_emergency().map(|emergency| emergency.code), Some(0x4310));
    for control in [0x0F, 0x06, 0x00] {
        bench.control(control);
        assert_eq!(bench.state(), 0x08);
    }
    bench.control(0x80);
    assert_eq!((bench.state(), bench.u16(0x603F)), (0x40, 0));
    assert!(bench.servo.fault(&mut bench.dictionary, 0x4310));
    bench.control(0x80);
    assert_eq!(bench.state(), 0x08, "the bit was set all the time");
}

#[test]
fn a_fault_reaction_may_brake_first() {
    let mut bench = Bench::enabled(9);
    bench.set_i16(0x605E, 2);
    bench.set_i32(0x60FF, REVOLUTION * 4);
    bench.run(300);
    bench.servo.fault(&mut bench.dictionary, 0x2310);
    bench.run(1);
    assert_eq!(bench.state(), 0x0F, "fault reaction active");
    bench.run(300);
    assert_eq!(bench.state(), 0x08);
    assert!(bench.i32(0x606C).abs() < REVOLUTION / 100);
}

#[test]
fn csp_follows_to_the_count() {
    let mut bench = Bench::enabled(8);
    // One revolution in a second, then rest.
    for step in 0..=1000 {
        bench.set_i32(0x607A, REVOLUTION / 1000 * step);
        bench.run(1);
    }
    let moving = bench.i32(0x6064);
    assert!((moving - REVOLUTION / 1000 * 1000).abs() < REVOLUTION / 500, "{moving}");
    let speed = bench.i32(0x606C);
    assert!((speed - REVOLUTION).abs() < REVOLUTION / 50, "{speed}");
    bench.run(1000);
    let error = bench.i32(0x6064) - REVOLUTION / 1000 * 1000;
    assert!(error.abs() <= 20, "{error} counts at rest");
    assert_eq!(bench.i32(0x60F4), -error);
    assert_eq!(bench.status() & 1 << 12, 1 << 12, "the drive follows");
}

#[test]
fn enabling_doesnt_jump() {
    let mut bench = Bench::with(ServoConfig { initial_position: 123_456, ..ServoConfig::default() });
    assert_eq!(bench.i32(0x6064), 123_456);
    bench.set_mode(8);
    bench.set_i32(0x607A, 123_456);
    bench.enable();
    bench.run(100);
    assert!((bench.i32(0x6064) - 123_456).abs() <= 2);
}

#[test]
fn the_encoder_wraps_at_32_bits() {
    let start = i32::MAX - 1000;
    let mut bench = Bench::with(ServoConfig { initial_position: start, ..ServoConfig::default() });
    bench.set_mode(8);
    bench.set_i32(0x607A, start);
    bench.enable();
    for step in 1..=500 {
        bench.set_i32(0x607A, start.wrapping_add(step * 100));
        bench.run(1);
    }
    bench.run(500);
    let error = bench.i32(0x6064).wrapping_sub(start.wrapping_add(50_000));
    assert!(bench.i32(0x6064) < 0 && error.abs() <= 20, "{} {error}", bench.i32(0x6064));
}

#[test]
fn csv_reaches_its_speed_and_limits_it() {
    let mut bench = Bench::enabled(9);
    bench.set_i32(0x60FF, REVOLUTION * 2);
    bench.run(500);
    assert!((bench.i32(0x606C) - REVOLUTION * 2).abs() < REVOLUTION / 500, "{}", bench.i32(0x606C));
    bench.set_u32(0x6080, REVOLUTION as u32);
    bench.run(500);
    assert!(bench.i32(0x606C) < REVOLUTION / 100 * 105, "{}", bench.i32(0x606C));
}

#[test]
fn cst_gives_its_torque_after_a_lag() {
    let mut bench = Bench::enabled(10);
    bench.set_i16(0x6071, 100);
    bench.run(1);
    assert_eq!(bench.i16(0x6077), 0, "not before the next cycle");
    bench.run(5);
    assert_eq!(bench.i16(0x6077), 100);
    let before = bench.i32(0x606C);
    bench.run(100);
    // 0.7 N·m less 0.1 of friction on 0.02 kg·m²: 30 rad/s² less a little viscous friction, in 0.1 s.
    let gained = f64::from(bench.i32(0x606C) - before) / f64::from(REVOLUTION) * TAU;
    assert!((2.8..3.01).contains(&gained), "{gained} rad/s");
}

#[test]
fn nothing_but_a_torque_is_held_between_beats() {
    // The current loop is the motor's.
    let config = ServoConfig { torque_time_constant_s: 0.0, ..ServoConfig::default() };
    for (mode, holds) in [(10, true), (4, false), (9, false), (8, false)] {
        let mut bench = Bench::with(config.clone());
        assert!(!bench.servo.holds_torque(), "without current");
        bench.set_mode(mode);
        bench.enable();
        assert_eq!(bench.servo.holds_torque(), holds, "mode {mode}");
        bench.control(0x02);
        assert!(!bench.servo.holds_torque(), "it brakes");
    }
    assert!(!Bench::enabled(10).servo.holds_torque(), "its current lags");
}

#[test]
fn torque_is_limited_and_says_so() {
    let mut bench = Bench::enabled(10);
    bench.set_i16(0x6071, 5000);
    bench.run(10);
    assert_eq!(bench.i16(0x6077), 3000, "the drive's peak");
    assert_eq!(bench.status() & 1 << 11, 1 << 11);
    bench.set_u16(0x6072, 500);
    bench.run(10);
    assert_eq!(bench.i16(0x6077), 500);
    bench.set_i16(0x6071, -5000);
    bench.run(10);
    assert_eq!(bench.i16(0x6077), -500);
}

#[test]
fn pp_moves_on_a_handshake() {
    let mut bench = Bench::enabled(1);
    bench.set_u32(0x6081, REVOLUTION as u32);
    bench.set_u32(0x6083, 4 * REVOLUTION as u32);
    bench.set_u32(0x6084, 4 * REVOLUTION as u32);
    bench.set_i32(0x607A, REVOLUTION / 2);
    bench.run(50);
    assert!(bench.i32(0x6064).abs() < 100, "nothing before the set point is new");
    bench.control(0x1F);
    assert_eq!(bench.status() & 1 << 12, 1 << 12, "acknowledged");
    bench.control(0x0F);
    assert_eq!(bench.status() & 1 << 12, 0);
    // 0.5 rev at 1 rev/s with ramps of 0.25 s: 0.75 s.
    bench.run(650);
    assert_eq!(bench.status() & 1 << 10, 0);
    bench.run(400);
    assert_eq!(bench.status() & 1 << 10, 1 << 10, "target reached");
    assert!((bench.i32(0x6064) - REVOLUTION / 2).abs() < 300, "{}", bench.i32(0x6064));
    // A relative one, halted on its way.
    bench.control(0x5F);
    bench.control(0x0F);
    bench.run(200);
    bench.control(0x10F);
    bench.run(500);
    let halted = bench.i32(0x6064);
    assert!(bench.i32(0x606C).abs() < REVOLUTION / 1000 && halted < REVOLUTION, "{halted}");
    bench.control(0x0F);
    bench.run(1500);
    assert!((bench.i32(0x6064) - REVOLUTION).abs() < 300, "{}", bench.i32(0x6064));
}

#[test]
fn pv_and_tq_have_ramps() {
    let mut bench = Bench::enabled(3);
    bench.set_u32(0x6083, REVOLUTION as u32);
    bench.set_i32(0x60FF, REVOLUTION);
    bench.run(500);
    assert!((bench.i32(0x606B) - REVOLUTION / 2).abs() < REVOLUTION / 100, "{}", bench.i32(0x606B));
    assert_eq!(bench.status() & 1 << 10, 0);
    bench.run(1000);
    assert_eq!(bench.status() & 1 << 10, 1 << 10);

    let mut bench = Bench::enabled(4);
    bench.set_u32(0x6087, 1000);
    bench.set_i16(0x6071, 100);
    bench.run(50);
    assert!((45..=52).contains(&bench.i16(0x6074)), "{}", bench.i16(0x6074));
    bench.run(100);
    assert_eq!(bench.i16(0x6077), 100);
}

#[test]
fn modes_change_while_running_and_unknown_ones_dont() {
    let mut bench = Bench::enabled(9);
    bench.set_i32(0x60FF, REVOLUTION);
    bench.run(300);
    let here = bench.i32(0x6064);
    bench.set_i32(0x607A, here);
    bench.set_mode(8);
    bench.run(1);
    assert_eq!(bench.dictionary.get(bench.servo.fields.mode_display), 8);
    bench.run(500);
    assert!((bench.i32(0x6064) - here).abs() < 50, "back to where it was asked to be");
    for mode in [2, 5, 7, 11, -1, 120] {
        bench.set_mode(mode);
        bench.run(1);
        assert_eq!(bench.dictionary.get(bench.servo.fields.mode_display), 8);
        assert_eq!(
            bench.servo.check_write(&bench.dictionary, ObjectAddress::new(0x6060, 0), &[mode as u8]),
            Err(AbortCode::VALUE_RANGE)
        );
    }
}

#[test]
fn quick_stop_follows_its_option_code() {
    let at_speed = |option| {
        let mut bench = Bench::enabled(9);
        bench.set_i16(0x605A, option);
        bench.set_u32(0x6084, 4 * REVOLUTION as u32);
        bench.set_u32(0x6085, 8 * REVOLUTION as u32);
        bench.set_i32(0x60FF, 2 * REVOLUTION);
        bench.run(500);
        bench.control(0x0B);
        bench
    };
    assert_eq!(at_speed(0).state(), 0x40, "let go at once");
    // 2 rev/s at 4 and 8 rev/s²: 0.5 and 0.25 s.
    for (option, early, late, end) in
        [(1, 450, 120, 0x40), (2, 200, 120, 0x40), (3, 0, 60, 0x40), (5, 450, 120, 0x07), (6, 200, 120, 0x07)]
    {
        let mut bench = at_speed(option);
        bench.run(early);
        assert_eq!(bench.state(), 0x07, "option {option} is still braking");
        bench.run(late);
        assert_eq!(bench.state(), end, "option {option}");
        assert!(bench.i32(0x606C).abs() < REVOLUTION / 20, "option {option}");
    }
    let mut bench = at_speed(6);
    bench.run(500);
    bench.control(0x0F);
    assert_eq!(bench.state(), 0x27, "16: back to operation");
    let mut bench = at_speed(2);
    bench.control(0x0F);
    assert_eq!(bench.state(), 0x07, "not from a stop that ends in switch on disabled");
}

#[test]
fn disable_operation_brakes_and_shutdown_lets_go() {
    let mut bench = Bench::enabled(9);
    bench.set_i32(0x60FF, REVOLUTION);
    bench.set_u32(0x6084, 4 * REVOLUTION as u32);
    bench.run(300);
    bench.control(0x07);
    assert_eq!(bench.state(), 0x27, "braking");
    bench.run(300);
    assert_eq!(bench.state(), 0x23);
    bench.control(0x0F);
    bench.run(300);
    bench.control(0x06);
    assert_eq!(bench.state(), 0x21);
    bench.run(5);
    assert_eq!(bench.i16(0x6077), 0);
}

#[test]
fn without_the_safety_inputs_consent_there_is_no_torque() {
    let mut bench = Bench::enabled(9);
    bench.set_i32(0x60FF, REVOLUTION);
    bench.run(2);
    assert!(bench.i16(0x6077) > 0);
    assert!(bench.servo.safe_torque_off(true));
    bench.run(2);
    assert_eq!((bench.state(), bench.u16(0x603F), bench.i16(0x6077)), (0x40, 0, 0));
    // Nothing that it is told switches it on.
    for control in [0x06, 0x07, 0x0F] {
        bench.control(control);
        bench.run(5);
    }
    assert_eq!((bench.state(), bench.i16(0x6077)), (0x21, 0));
    // The input back, nothing moves by itself before it is told again.
    bench.control(0x06);
    bench.servo.safe_torque_off(false);
    bench.run(5);
    assert_eq!(bench.state(), 0x21);
    for control in [0x07, 0x0F] {
        bench.control(control);
        bench.run(5);
    }
    assert_eq!(bench.state(), 0x27);
}

/// A hand that turns the shaft by a fifth of the rated torque for 100 ms: how far it came, counts.
fn turned_by_hand(bench: &mut Bench) -> i32 {
    let before = bench.i32(0x6064);
    assert!(bench.servo.push(200));
    bench.run(100);
    assert!(bench.servo.push(0));
    bench.i32(0x6064) - before
}

#[test]
fn a_brake_holds_while_the_motor_has_no_current_and_a_worn_one_slips() {
    for (per_mille, holds) in [(1500, true), (50, false), (0, false)] {
        let mut bench = Bench::new();
        bench.set_mode(9);
        assert!(bench.servo.brake(per_mille));
        let turned = turned_by_hand(&mut bench);
        assert_eq!(turned == 0, holds, "{per_mille}: {turned}");
        bench.run(1000);
        // Open while it is enabled: it turns as it is told; closed again behind it.
        bench.enable();
        bench.set_i32(0x60FF, REVOLUTION);
        let before = bench.i32(0x6064);
        bench.run(200);
        assert!(bench.i32(0x6064) - before > REVOLUTION / 10, "{per_mille}");
        bench.set_i32(0x60FF, 0);
        bench.run(200);
        bench.control(0);
        bench.run(1000);
        let turned = turned_by_hand(&mut bench);
        assert_eq!(turned == 0, holds, "{per_mille}: {turned}");
    }
}

#[test]
fn a_following_error_is_a_fault() {
    let mut bench = Bench::enabled(8);
    bench.set_u32(0x6065, 10_000);
    bench.set_u16(0x6072, 10);
    bench.set_i32(0x607A, REVOLUTION);
    bench.run(5);
    assert_eq!(bench.status() & 1 << 13, 1 << 13);
    bench.run(20);
    assert_eq!((bench.state(), bench.u16(0x603F)), (0x08, 0x8611));
}

#[test]
fn losing_op_does_what_0x6007_says() {
    let after = |option| {
        let mut bench = Bench::enabled(9);
        bench.set_i16(0x6007, option);
        bench.set_u32(0x6085, 4 * REVOLUTION as u32);
        bench.set_i32(0x60FF, REVOLUTION);
        bench.run(300);
        bench.servo.state_changed(&mut bench.dictionary, AlState::SafeOp, AlStatusCode::SM_WATCHDOG);
        bench.cycle(Outputs::Safe);
        bench
    };
    let fault = after(1);
    assert_eq!((fault.state(), fault.u16(0x603F)), (0x08, 0x7500));
    assert_eq!(after(2).state(), 0x40);
    let mut stopping = after(3);
    assert_eq!(stopping.state(), 0x07);
    for _ in 0..400 {
        stopping.cycle(Outputs::Safe);
    }
    assert_eq!(stopping.state(), 0x40);
    assert!(stopping.i32(0x606C).abs() < REVOLUTION / 20);
    assert_eq!(after(0).state(), 0x27, "nothing");
}

#[test]
fn held_outputs_keep_the_last_reference() {
    let mut bench = Bench::enabled(8);
    bench.set_i32(0x607A, 1000);
    bench.run(1);
    for _ in 0..200 {
        bench.cycle(Outputs::Held);
    }
    assert!((bench.i32(0x6064) - 1000).abs() <= 20);
}

#[test]
fn long_gaps_and_short_cycles_end_alike() {
    let run = |cycles: u32, step_ns: u64| {
        let mut bench = Bench::enabled(9);
        bench.set_i32(0x60FF, REVOLUTION);
        bench.run(1);
        for _ in 0..cycles {
            bench.now = HostTime(bench.now.0 + step_ns);
            let moment = Moment { now: bench.now, outputs: Outputs::Held, cycle_ns: None };
            bench.servo.run(&mut bench.dictionary, moment);
        }
        bench.i32(0x6064)
    };
    let (coarse, fine) = (run(1, 2_000_000_000), run(2000, 1_000_000));
    assert!((coarse - fine).abs() < REVOLUTION / 100, "{coarse} {fine}");
}

#[test]
fn halt_slows_down_by_its_option_code() {
    // 1 rev/s at 2 and 8 rev/s² and at once: the demand's speed 100 ms after the halt.
    for (option, left) in [(1, 0.8), (2, 0.2), (3, 0.0)] {
        let mut bench = Bench::enabled(3);
        bench.set_i16(0x605D, option);
        bench.set_u32(0x6084, 2 * REVOLUTION as u32);
        bench.set_u32(0x6085, 8 * REVOLUTION as u32);
        bench.set_i32(0x60FF, REVOLUTION);
        bench.run(500);
        bench.control(0x10F);
        bench.run(100);
        let demand = f64::from(bench.i32(0x606B)) / f64::from(REVOLUTION);
        assert!((demand - left).abs() < 0.02, "option {option}: {demand} rev/s");
        bench.control(0x0F);
        bench.run(1000);
        assert_eq!(bench.i32(0x606B), REVOLUTION, "on again");
    }
}
