//! `omnibase margins`: what a law of torque leaves of gain and phase on every tread that a robot may have.

mod plot;
#[cfg(test)]
mod tests;

use crate::Outcome;
use crate::robot_file::{Changes, RobotSource};
use anyhow::{Context, anyhow, bail};
use omnibase_robot::registry::Made;
use omnibase_robot::torque_loop::{LoopGains, Margins, Plant, TorqueDesign, TorqueLoop};
use omnibase_robot::{Registry, RobotPlan};
use serde_json::{Value, json};
use std::io::Write;
use std::path::PathBuf;

/// Treads that might be declared: least stiffness, N/m, and least damping; each up to the greatest that is known.
const DECLARED: [(f64, f64); 6] = [(1e5, 0.1), (1e5, 0.3), (3e5, 0.3), (1e6, 0.1), (1e6, 0.3), (2e6, 0.3)];
const STIFFEST_N_M: f64 = 4e6;
/// Damping ratios beside the least.
const DAMPING_RATIOS: [f64; 3] = [0.3, 0.6, 1.0];

/// Shows the gains of a law of torque with their margins on every tread, and what a declared tread buys.
///
/// The law is the first of the file's that has such gains, or else the first of all (`check --kinds`). [controller] must give mass_kg
/// and inertia_kg_m2.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase margins robots/bmm.toml
  omnibase margins robots/bmm.toml --set controller.tread_stiffness_n_m=[1e6,4e6] --plot margins.svg
  omnibase margins robots/mecanum.toml --set controller.mass_kg=60 --set controller.inertia_kg_m2=4 --json
  omnibase margins robots/bmm.toml --set controller.kind=disturbance_observer

Exit code 1 where the margins don't suffice: 6 dB and 30°.")]
pub struct Arguments {
    /// Robot file (TOML).
    robot: PathBuf,
    #[command(flatten)]
    changes: Changes,
    /// Draw the margins over the treads' stiffness, as one picture in SVG.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// One axis, looked at.
struct Axis<'a> {
    name: &'static str,
    one: &'a TorqueLoop,
    gains: LoopGains,
    damping_ratios: Vec<f64>,
    /// By stiffness, then by damping.
    table: Vec<(f64, Vec<Margins>)>,
    worst: Margins,
    declared: Vec<(f64, f64, Option<LoopGains>)>,
}

impl<'a> Axis<'a> {
    fn new(name: &'static str, one: &'a TorqueLoop, gains: LoopGains) -> Self {
        let least = one.damping_ratio;
        let others = DAMPING_RATIOS.into_iter().filter(|ratio| *ratio > least);
        let damping_ratios: Vec<f64> = std::iter::once(least).chain(others).collect();
        let row = |stiffness: f64| {
            let of = |ratio: &f64| worst_of_bodies(one, &gains, stiffness, *ratio);
            (stiffness, damping_ratios.iter().map(of).collect())
        };
        let table: Vec<(f64, Vec<Margins>)> = one.stiffnesses_n_m().into_iter().map(row).collect();
        let shown = table.iter().flat_map(|(_, row)| row).fold(Margins::ALL, |worst, one| worst.worse(*one));
        let declared = DECLARED.map(|(soft, damping_ratio)| {
            let declared = TorqueLoop { stiffness_n_m: [soft, STIFFEST_N_M], damping_ratio, ..one.clone() };
            (soft, damping_ratio, declared.design())
        });
        let worst = shown.worse(one.worst(&gains));
        Axis { name, one, gains, damping_ratios, table, worst, declared: declared.to_vec() }
    }

    fn is_turn(&self) -> bool {
        self.name == "heading"
    }

    fn json(&self) -> Value {
        let suffixes =
            if self.is_turn() { ["n_m_s_rad", "kg_m2", "mrad_per_n_m"] } else { ["n_s_m", "kg", "mm_per_n"] };
        let [damping_unit, body_unit, error_unit] = suffixes;
        let gains = |gains: &LoopGains| {
            json!({
                format!("damping_{damping_unit}"): gains.damping,
                "kp_1_s": gains.kp_1_s,
                "torque_filter_1_s": gains.filter_1_s,
                "observer_1_s": gains.observer_1_s,
                error_unit: per_force(gains),
            })
        };
        let table = self.table.iter().flat_map(|(stiffness, row)| {
            row.iter().zip(&self.damping_ratios).map(move |(found, ratio)| {
                let mut found = margins_json(found);
                found["tread_stiffness_n_m"] = json!(stiffness);
                found["tread_damping_ratio"] = json!(ratio);
                found
            })
        });
        let declared = self.declared.iter().map(|(soft, damping_ratio, found)| {
            json!({
                "tread_stiffness_n_m": [soft, STIFFEST_N_M],
                "tread_damping_ratio": damping_ratio,
                "gains": found.as_ref().map(&gains),
            })
        });
        json!({
            "axis": self.name,
            "gains": gains(&self.gains),
            format!("body_{body_unit}"): self.one.body,
            "margins": table.collect::<Vec<_>>(),
            "worst": margins_json(&self.worst),
            "declared_treads": declared.collect::<Vec<_>>(),
        })
    }

    fn print(&self, output: &mut dyn Write, body_is: &str) -> anyhow::Result<()> {
        let (body, damping, error) = if self.is_turn() {
            ("kg·m²", "N·m·s/rad", "mrad per N·m")
        } else {
            ("kg", "N·s/m", "mm per N")
        };
        let LoopGains { damping: k, kp_1_s, filter_1_s, observer_1_s } = self.gains;
        let observer =
            if observer_1_s > 0.0 { format!(", observer {observer_1_s} 1/s") } else { String::new() };
        let [light, heavy] = self.one.body;
        writeln!(output, "\n{}", self.name)?;
        writeln!(
            output,
            "  gains             K = {k:.0} {damping}, Kp = {kp_1_s} 1/s, low-pass {filter_1_s} 1/s{observer}"
        )?;
        writeln!(output, "  body              {light:.3} to {heavy:.3} {body} ({body_is})")?;
        writeln!(output, "  against a force   {:.4} {error}", per_force(&self.gains))?;
        writeln!(
            output,
            "  gain margin dB / phase margin ° / peak of the sensitivity; the worst of all bodies:"
        )?;
        write!(output, "  {:>10}", "N/m")?;
        for ratio in &self.damping_ratios {
            write!(output, "  {:>20}", format!("damping {ratio}"))?;
        }
        writeln!(output)?;
        for (stiffness, row) in &self.table {
            write!(output, "  {stiffness:>10.2e}")?;
            for found in row {
                write!(output, "  {:>20}", cell(found))?;
            }
            writeln!(output)?;
        }
        let verdict = if self.worst.suffice() { "suffices" } else { "DOES NOT SUFFICE" };
        writeln!(output, "  worst of each     {}: {verdict} (6 dB, 30°)", cell(&self.worst))?;
        writeln!(
            output,
            "  what a declared tread buys (up to {STIFFEST_N_M:.0e} N/m), stiffness against error:"
        )?;
        let [ratio, k, kp, filter, rate] = ["damping", "K", "Kp 1/s", "low-pass", "observer"];
        writeln!(
            output,
            "  {:>10}  {ratio:>8}  {k:>8}  {kp:>8}  {filter:>8}  {rate:>8}  {error:>12}",
            "N/m"
        )?;
        for (soft, ratio, found) in &self.declared {
            write!(output, "  {soft:>10.0e}  {ratio:>8}")?;
            match found {
                Some(gains) => {
                    let LoopGains { damping, kp_1_s, filter_1_s, observer_1_s } = gains;
                    let error = per_force(gains);
                    let rates = format!("{kp_1_s:>8}  {filter_1_s:>8}  {observer_1_s:>8}");
                    writeln!(output, "  {damping:>8.0}  {rates}  {error:>12.4}")?;
                }
                None => writeln!(output, "  no gains leave the margins")?,
            }
        }
        Ok(())
    }
}

/// Runs the command.
pub fn run(arguments: &Arguments, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let source = RobotSource::read(&arguments.robot, &arguments.changes)?;
    let plan = source.load_or_explain(registry)?.plan;
    let file = arguments.robot.display();
    let table = &plan.controller;
    let needed = [("mass_kg", table.mass_kg), ("inertia_kg_m2", table.inertia_kg_m2)];
    let missing: Vec<&str> =
        needed.iter().filter(|(_, value)| value.is_none()).map(|(key, _)| *key).collect();
    if !missing.is_empty() {
        bail!(
            "{file}: [controller] gives no {}: gains of torque are designed by mass and moment of inertia (--set \
             controller.mass_kg=70 --set controller.inertia_kg_m2=7)",
            missing.join(" and no ")
        );
    }
    let (law, design) = designed(&plan, registry)
        .with_context(|| format!("{file}: [controller]"))?
        .ok_or_else(|| anyhow!("no law of torque is registered whose gains are designed by margins"))?;
    let [along, across, turn] = &design.loops;
    let [along_gains, across_gains, turn_gains] = design.gains;
    let axes = [
        Axis::new("x", along, along_gains),
        Axis::new("y", across, across_gains),
        Axis::new("heading", turn, turn_gains),
    ];
    if let Some(picture) = &arguments.plot {
        std::fs::write(picture, plot::svg(&plan.name, &axes))
            .with_context(|| format!("writing `{}`", picture.display()))?;
    }
    let suffices = axes.iter().all(|axis| axis.worst.suffice());
    if arguments.json {
        let told: Vec<Value> = axes.iter().map(Axis::json).collect();
        let assumptions: serde_json::Map<String, Value> = known(&plan, along)
            .into_iter()
            .map(|known| (known.key.to_owned(), json!({ "value": known.value, "from_file": known.is_given })))
            .collect();
        let all = json!({ "robot": plan.name, "law": law, "known": assumptions, "axes": told, "suffices": suffices });
        writeln!(output, "{}", serde_json::to_string_pretty(&all)?)?;
    } else {
        let whose = match plan.controllers().any(|one| one == law) {
            true => "",
            false => " (no law of the file has such gains)",
        };
        writeln!(output, "{file}: gains of {law} with their margins{whose}")?;
        for Known { name, words, is_given, .. } in known(&plan, along) {
            writeln!(output, "  {name:<17} {words} ({})", origin(is_given))?;
        }
        for axis in &axes {
            let bounds =
                if axis.is_turn() { table.inertia_bounds_kg_m2 } else { table.mass_bounds_kg }.is_some();
            let body_is = if bounds { "from the file" } else { "assumed: a third to three times the file's" };
            axis.print(output, body_is)?;
        }
    }
    Ok(if suffices { Outcome::Done } else { Outcome::Failed })
}

/// The first law whose gains are designed by margins: of the file's, then of all that are registered.
fn designed<'a>(plan: &'a RobotPlan, registry: &'a Registry) -> Made<Option<(&'a str, TorqueDesign)>> {
    for law in plan.controllers().chain(registry.controllers.names()) {
        let (_, make) = registry.controllers.find(Some(law))?;
        if let Some(design) = make(plan)?.design() {
            return Ok(Some((law, design.clone())));
        }
    }
    Ok(None)
}

/// What is known of a robot's treads, wheels and delay.
struct Known {
    key: &'static str,
    name: &'static str,
    value: Value,
    words: String,
    is_given: bool,
}

fn known(plan: &RobotPlan, one: &TorqueLoop) -> Vec<Known> {
    let table = &plan.controller;
    let [soft, stiff] = one.stiffness_n_m;
    let (ratio, wheel_kg, filter) = (one.damping_ratio, one.wheel_kg, one.speed_filter_1_s);
    let (period_ms, lag_ms) = (one.period_s * 1e3, one.lag_s * 1e3);
    let entry = |key, name, value, words, is_given| Known { key, name, value, words, is_given };
    vec![
        entry(
            "tread_stiffness_n_m",
            "tread",
            json!([soft, stiff]),
            format!("{soft:.1e} to {stiff:.1e} N/m a wheel"),
            table.tread_stiffness_n_m.is_some(),
        ),
        entry(
            "tread_damping_ratio",
            "damping",
            json!(ratio),
            format!("at least {ratio} of the critical"),
            table.tread_damping_ratio.is_some(),
        ),
        entry(
            "wheel_kg",
            "wheel",
            json!(wheel_kg),
            format!("{wheel_kg:.3} kg at its rim, with rotor and gear"),
            table.wheel_inertia_kg_m2.is_some(),
        ),
        entry(
            "torque_lag_us",
            "drive's lag",
            json!(lag_ms * 1e3),
            format!("{lag_ms:.3} ms"),
            table.torque_lag_us.is_some(),
        ),
        entry(
            "delay_ms",
            "delay",
            json!(2.0 * period_ms),
            format!("{:.3} ms: two cycles, then held for one", 2.0 * period_ms),
            true,
        ),
        entry(
            "speed_filter_1_s",
            "speed filter",
            json!(filter),
            format!("{filter} 1/s"),
            plan.estimator.speed_filter_1_s.is_some(),
        ),
    ]
}

fn origin(is_given: bool) -> &'static str {
    if is_given { "from the file" } else { "assumed" }
}

/// By how much a force moves what is held, mm per N (mrad per N·m), before the slow force takes it.
fn per_force(gains: &LoopGains) -> f64 {
    1000.0 / gains.stiffness()
}

fn worst_of_bodies(one: &TorqueLoop, gains: &LoopGains, stiffness_n_m: f64, damping_ratio: f64) -> Margins {
    let of = |(shares, body)| one.margins(gains, &Plant { shares, body, stiffness_n_m, damping_ratio });
    let corners = one.directions().iter().flat_map(|shares| one.bodies().map(|body| (*shares, body)));
    corners.map(of).fold(Margins::ALL, Margins::worse)
}

fn cell(found: &Margins) -> String {
    if !found.is_stable {
        return "unstable".to_owned();
    }
    format!("{:.1} / {:.1} / {:.2}", found.gain_db, found.phase_deg, found.sensitivity)
}

fn margins_json(found: &Margins) -> Value {
    json!({
        "is_stable": found.is_stable,
        "gain_db": found.gain_db,
        "phase_deg": found.phase_deg,
        "sensitivity": found.sensitivity,
        "suffices": found.suffice(),
    })
}
