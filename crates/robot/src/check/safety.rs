//! The table `safety`, with what it says by default.

use super::Check;
use crate::config::*;
use crate::signals::{SafetyAction, SignalLayout, StopCategory};

/// Lost exchanges in a row that are tolerated by default.
pub(super) const LOST_EXCHANGES_TOLERATED: u32 = 3;

impl Check {
    /// The place of an input that safety looks at.
    fn input(&mut self, name: Option<&String>, key: &str, signals: &SignalLayout) -> Option<usize> {
        let name = name?;
        let found = signals.input(name);
        if found.is_none() {
            let names: Vec<&str> = signals.inputs.iter().map(|signal| signal.name.as_str()).collect();
            let near = nearest(name, names.iter().copied());
            let near = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
            let reason = format!("no `[[device]]` or `[[source]]` has this input{near}");
            let problem = self.report(ProblemKind::UnknownName, &format!("safety.{key}"), reason);
            problem.value = Some(format!("\"{name}\""));
            problem.limit = Some(if names.is_empty() {
                "an input of a `[[device]]` or `[[source]]`".into()
            } else {
                names.join(", ")
            });
        }
        found
    }

    /// What inputs lead to: a hold isn't enough, for it goes on with the next command.
    fn input_stop(&mut self, table: &SafetyTable) -> StopCategory {
        let stop = table.input_stop.unwrap_or(StopName::Category1);
        if stop == StopName::Category2 {
            let reason = "a robot that an input stopped mustn't move with the next command";
            let problem = self.report(ProblemKind::OutOfRange, "safety.input_stop", reason);
            problem.value = Some("\"category_2\"".into());
            problem.limit = Some("category_0, category_1".into());
        }
        stop.into()
    }

    pub(super) fn safety(
        &mut self,
        table: &SafetyTable,
        signals: &SignalLayout,
        is_known: bool,
    ) -> SafetyPlan {
        // Where a `[[device]]` is wrong itself, its inputs aren't missing too.
        let wanted = |name: &Option<String>| name.clone().filter(|_| is_known);
        let enable_input = self.input(wanted(&table.enable_input).as_ref(), "enable_input", signals);
        let stop_input = self.input(wanted(&table.stop_input).as_ref(), "stop_input", signals);
        let gyro_input = self.input(wanted(&table.gyro_input).as_ref(), "gyro_input", signals);
        let input_stop = self.input_stop(table);
        let ns = |ms: Option<u32>, default_ms: u32| u64::from(ms.unwrap_or(default_ms)) * 1_000_000;
        let stop = |name: Option<StopName>, default: StopName| name.unwrap_or(default).into();
        SafetyPlan {
            lost_exchanges_tolerated: table.lost_exchanges_tolerated.unwrap_or(LOST_EXCHANGES_TOLERATED),
            lost_device_stop: match table.on_lost_device.unwrap_or(LostDeviceName::QuickStop) {
                LostDeviceName::QuickStop => SafetyAction::QuickStop,
                LostDeviceName::Ramp => SafetyAction::Stop(StopCategory::RampThenRemove),
                LostDeviceName::RemoveTorque => SafetyAction::Stop(StopCategory::RemoveTorque),
            },
            comeback: match table.after_lost_device.unwrap_or(ComebackName::Stay) {
                ComebackName::Stay => None,
                ComebackName::Hold => Some(ComebackEnd::Hold),
                ComebackName::MoveAgainUnattended => {
                    Some(ComebackEnd::MoveAgain { warning_ns: ns(table.move_again_warning_ms, 5000) })
                }
            }
            .map(|end| ComebackPlan {
                end,
                within_ns: ns(table.lost_device_wait_ms, 30_000),
                steady_ns: ns(table.steady_before_comeback_ms, 1000),
                lost_exchanges_tolerated: table.lost_exchanges_tolerated.unwrap_or(LOST_EXCHANGES_TOLERATED),
                enable_input,
                stop_input,
                bus_errors: Default::default(),
            }),
            command_age_ns: ns(table.command_age_ms, 200),
            enabling_timeout_ns: ns(table.enabling_timeout_ms, 5000),
            stop_timeout_ns: ns(table.stop_timeout_ms, 5000),
            tracking_error_m: table.tracking_error_m.unwrap_or(0.5),
            start_distance_m: table.start_distance_m.unwrap_or(0.05),
            start_heading_rad: table.start_heading_rad.unwrap_or(0.1),
            wheel_speed_stop: stop(table.wheel_speed_stop, StopName::Category1),
            reference_speed_stop: stop(table.reference_speed_stop, StopName::Category1),
            fence_stop: stop(table.fence_stop, StopName::Category2),
            tracking_error_stop: stop(table.tracking_error_stop, StopName::Category1),
            wheel_torque_stop: stop(table.wheel_torque_stop, StopName::Category1),
            wheel_torque_margin_nm: table.wheel_torque_margin_nm,
            wheel_torque_time_ns: ns(table.wheel_torque_time_ms, 50),
            oscillation_share: table.oscillation_share.unwrap_or(0.15),
            slip_m: table.slip_m.unwrap_or(0.01),
            slip_stop: stop(table.slip_stop, StopName::Category1),
            gyro_input,
            enable_input,
            stop_input,
            input_stop,
        }
    }
}
