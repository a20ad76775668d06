//! Homing by limit switches, and without.

use super::*;
use crate::device::axis::LimitSwitches;

/// Bits 10, 12 and 13: what homing shows.
const BITS: u16 = 1 << 10 | 1 << 12 | 1 << 13;
const ATTAINED: u16 = 1 << 10 | 1 << 12;

/// An axis between two switches, rad.
struct Between(SingleAxis, [f64; 2]);

impl Axis for Between {
    fn advance(&mut self, now: HostTime) -> AxisState {
        let state = self.0.advance(now);
        let [negative, positive] = self.1.map(|at| at - state.position_rad);
        AxisState {
            switches: LimitSwitches { negative: negative >= 0.0, positive: positive <= 0.0 },
            ..state
        }
    }

    fn apply(&mut self, torque_n_m: f64) {
        self.0.apply(torque_n_m);
    }

    fn nominal_inertia_kg_m2(&self) -> f64 {
        self.0.nominal_inertia_kg_m2()
    }
}

/// In hm by a method, from 0 between switches at -1 rad and 2 rad, its home offset 500.
fn bench(method: i8) -> Bench {
    let axis = Between(SingleAxis::new(Load::default()), [-1.0, 2.0]);
    let mut bench = Bench::on(ServoConfig::default(), Box::new(axis));
    let field: Field<i8> = bench.dictionary.field(0x6098, 0).unwrap();
    bench.dictionary.set(field, method);
    for (subindex, speed) in [(1, REVOLUTION / 4), (2, REVOLUTION / 100)] {
        let field: Field<u32> = bench.dictionary.field(0x6099, subindex).unwrap();
        bench.dictionary.set(field, speed as u32);
    }
    bench.set_i32(0x607C, 500);
    bench.set_mode(6);
    bench.enable();
    bench
}

/// Homed, in so many cycles: where the axis truly is then, rad.
fn homed(bench: &mut Bench) -> f64 {
    bench.control(0x1F);
    for _ in 0..5000 {
        if bench.status() & BITS == ATTAINED {
            return bench.servo.axis.advance(bench.now).position_rad;
        }
        bench.run(1);
    }
    panic!("{:04x}", bench.status());
}

#[test]
fn the_home_is_where_the_switch_is_left() {
    for (method, home_rad) in [(17, -1.0), (18, 2.0)] {
        let mut bench = bench(method);
        assert_eq!(bench.status() & BITS, 1 << 10, "not begun");
        let at_rad = homed(&mut bench);
        assert!((at_rad - home_rad).abs() < 0.01, "{method}: {at_rad}");
        let passed = (at_rad - home_rad) / core::f64::consts::TAU * f64::from(REVOLUTION);
        assert!((f64::from(bench.i32(0x6064)) - 500.0 - passed).abs() < 50.0, "{}", bench.i32(0x6064));
        // It stays attained, also when hm is left and comes back, until homing begins again.
        bench.set_mode(8);
        bench.control(0x0F);
        bench.set_mode(6);
        bench.run(2);
        assert_eq!(bench.status() & BITS, ATTAINED);
        bench.control(0x1F);
        assert_eq!(bench.status() & BITS, 0);
    }
}

#[test]
fn a_home_can_be_where_it_stands_and_unknown_methods_fail() {
    let mut here = bench(35);
    assert!(homed(&mut here).abs() < 1e-3);
    assert!((here.i32(0x6064) - 500).abs() < 50);
    let mut unknown = bench(99);
    unknown.control(0x1F);
    assert_eq!(unknown.status() & BITS, 1 << 13 | 1 << 10);
}

#[test]
fn a_halt_interrupts_it() {
    let mut bench = bench(17);
    bench.control(0x1F);
    bench.run(300);
    assert_eq!(bench.status() & BITS, 0);
    bench.control(0x11F);
    bench.run(500);
    assert_eq!(bench.status() & BITS, 1 << 10);
    assert!(bench.i32(0x606C).abs() < 100, "{}", bench.i32(0x606C));
}
