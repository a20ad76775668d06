//! The table of the simulated robot: what contradicts itself, its patches, and what happens by time.

use super::kind_keys::Given;
use super::{Check, ReadFile};
use crate::config::*;
use crate::registry::Registry;

/// What happens to the robot, in the order of time.
pub(super) fn resolve(
    check: &mut Check,
    table: &SimulationTable,
    drives: &[DriveTable],
    registry: &Registry,
    read_file: ReadFile<'_>,
) -> Option<Vec<EventPlan>> {
    check.simulation(table, drives.len());
    let drives: Vec<&str> = drives.iter().map(|drive| drive.name.as_deref().unwrap_or_default()).collect();
    check.wires(table, &drives);
    let own = Events { tables: &table.event, list: "simulation.event", drives: &drives };
    let mut events = own.resolve(check, registry);
    if let Some(name) = &table.events_file {
        events = events
            .zip(events_of_file(check, name, &drives, registry, read_file))
            .map(|(own, others)| [own, others].concat());
    }
    let mut steps = events?;
    // What begins when another ends isn't ended by it.
    steps.sort_by_key(|step| (step.plan.at_ns, step.begins));
    Some(steps.into_iter().map(|step| step.plan).collect())
}

/// The begin or the end of an event.
#[derive(Clone)]
struct Step {
    begins: bool,
    plan: EventPlan,
}

/// The events of a file of their own.
fn events_of_file(
    check: &mut Check,
    name: &str,
    drives: &[&str],
    registry: &Registry,
    read_file: ReadFile<'_>,
) -> Option<Vec<Step>> {
    let text = match read_file(name) {
        Ok(text) => text,
        Err(reason) => {
            let problem = check.report(ProblemKind::File, "simulation.events_file", reason);
            problem.value = Some(format!("\"{name}\""));
            return None;
        }
    };
    let Source { file, locations, problems } = Source::<EventsFile>::read(&text, Some(name));
    let mut beside = Check { locations, problems };
    let events = Events { tables: &file.event, list: "event", drives };
    let events = events.resolve(&mut beside, registry).filter(|_| beside.problems.is_empty());
    check.problems.append(&mut beside.problems);
    events
}

/// A list of events.
struct Events<'a> {
    tables: &'a [EventTable],
    /// Its name in its file.
    list: &'a str,
    drives: &'a [&'a str],
}

impl Events<'_> {
    fn resolve(&self, check: &mut Check, registry: &Registry) -> Option<Vec<Step>> {
        let each = self.tables.iter().enumerate();
        let resolved: Vec<_> = each.map(|(index, table)| self.one(check, index, table, registry)).collect();
        Some(resolved.into_iter().collect::<Option<Vec<_>>>()?.concat())
    }

    /// What begins, and what ends.
    fn one(
        &self,
        check: &mut Check,
        index: usize,
        table: &EventTable,
        registry: &Registry,
    ) -> Option<Vec<Step>> {
        let name = format!("{}[{index}]", self.list);
        let kinds = &registry.events;
        let at_s = check.need(table.at_s, &format!("{name}.at_s"), "it says when");
        let setting = format!("{name}.kind");
        let kind = check.need(table.kind.as_deref(), &setting, "it says what happens")?;
        let (kind, make) = check.known(kinds, &setting, Some(kind))?;
        let given = Given::of(table);
        check.kind_reads(kind, &given, &|key| format!("{name}.{key}"));
        check.nobody_reads(&[kind], &given, &kinds.sort, &name);
        if !check.is_sound(&name) {
            return None;
        }
        let course = check.made(make(table, self.drives).map_err(|error| error.under(&name)))?;
        let at_s = at_s?;
        let ns = |at_s: f64| (at_s * 1e9).round() as u64;
        let step = |begins, at_ns, happening| Step { begins, plan: EventPlan { at_ns, happening } };
        let begin_ns = ns(at_s);
        let end = table.duration_s.zip(course.end).map(|(duration_s, end)| {
            let end_ns = ns(at_s + duration_s).max(begin_ns + 1);
            step(false, end_ns, end)
        });
        Some(std::iter::once(step(true, begin_ns, course.begin)).chain(end).collect())
    }
}

impl Check {
    fn simulation(&mut self, table: &SimulationTable, wheels: usize) {
        if let (Some(sticking), Some(sliding)) = (table.static_friction, table.sliding_friction)
            && sliding > sticking
        {
            let reason = "a wheel slides more easily than it breaks away";
            let problem = self.report(ProblemKind::Contradiction, "simulation.sliding_friction", reason);
            problem.value = Some(sliding.to_string());
            problem.limit = Some(format!("at most static_friction = {sticking}"));
        }
        if table.tread_damping_ratio.is_some() && table.tread_stiffness_n_m.is_none() {
            let reason = "must be given: tread_damping_ratio is an elastic tread's";
            self.report(ProblemKind::Missing, "simulation.tread_stiffness_n_m", reason);
        }
        if let (Some(rated), Some(greatest)) =
            (table.motor_rated_speed_rad_s, table.motor_greatest_speed_rad_s)
            && greatest <= rated
        {
            let reason = "the torque falls from the rated speed on";
            let problem =
                self.report(ProblemKind::Contradiction, "simulation.motor_greatest_speed_rad_s", reason);
            problem.value = Some(greatest.to_string());
            problem.limit = Some(format!("above motor_rated_speed_rad_s = {rated}"));
        }
        for (values, name) in
            [(&table.torque_ratio, "torque_ratio"), (&table.clock_drift_ppm, "clock_drift_ppm")]
        {
            if let Some(values) = values
                && values.len() != wheels
            {
                let reason = "one for each wheel";
                let problem = self.report(ProblemKind::WrongType, &format!("simulation.{name}"), reason);
                (problem.value, problem.limit) =
                    (Some(format!("{} values", values.len())), Some(format!("{wheels} values")));
            }
        }
        for (amplitude, order, name) in [
            (table.cogging_nm, table.cogging_per_turn, "cogging_nm"),
            (table.torque_ripple, table.torque_ripple_per_turn, "torque_ripple"),
        ] {
            if amplitude.is_none() && order.is_some() {
                self.need(amplitude, &format!("simulation.{name}"), "its number per turn alone does nothing");
            }
        }
        if table.slope_direction_rad.is_some() {
            self.need(table.slope_rad, "simulation.slope_rad", "a level floor has no direction");
        }
        for (index, patch) in table.patch.iter().enumerate() {
            self.patch(patch, &format!("simulation.patch[{index}]"));
        }
    }

    fn patch(&mut self, patch: &PatchTable, name: &str) {
        let sticking = self.need(
            patch.static_friction,
            &format!("{name}.static_friction"),
            "it says how slippery it is",
        );
        if let (Some(sticking), Some(sliding)) = (sticking, patch.sliding_friction)
            && sliding > sticking
        {
            let reason = "a wheel slides more easily than it breaks away";
            let problem =
                self.report(ProblemKind::Contradiction, &format!("{name}.sliding_friction"), reason);
            problem.value = Some(sliding.to_string());
            problem.limit = Some(format!("at most static_friction = {sticking}"));
        }
        let is_disc = patch.centre_m.is_some() || patch.radius_m.is_some();
        match patch.rectangle_m {
            Some(_) if is_disc => {
                let reason = "a patch is a rectangle or a disc, not both";
                self.report(ProblemKind::Contradiction, &format!("{name}.rectangle_m"), reason);
            }
            Some([x_min, y_min, x_max, y_max]) if x_min >= x_max || y_min >= y_max => {
                let reason = "there is nothing in it";
                let problem = self.report(ProblemKind::OutOfRange, &format!("{name}.rectangle_m"), reason);
                problem.limit =
                    Some("x_min, y_min, x_max, y_max, the last two greater than the first two".into());
            }
            Some(_) => {}
            None => {
                self.need(
                    patch.centre_m,
                    &format!("{name}.centre_m"),
                    "a patch is a disc, or has a `rectangle_m`",
                );
                self.need(
                    patch.radius_m,
                    &format!("{name}.radius_m"),
                    "a patch is a disc, or has a `rectangle_m`",
                );
            }
        }
    }
}
