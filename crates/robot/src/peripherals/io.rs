//! Inputs and outputs whose place and scale the robot's file gives.

use crate::config::{Coding, DevicePlan, Problem};
use crate::registry::Made;
use crate::signals::CycleTime;
use crate::stages::Peripheral;

/// Numbers at their places in the process data.
#[derive(Clone, Debug, PartialEq)]
pub struct Io {
    inputs: Vec<Coding>,
    outputs: Vec<Coding>,
}

impl Io {
    /// The inputs and outputs of a plan; each says how it stands in the process data.
    pub fn new(plan: &DevicePlan) -> Made<Self> {
        let coded = |coding: Option<Coding>, setting: String| {
            coding.ok_or_else(|| Problem::missing(format!("{setting}.object"), "it has a place").into())
        };
        let inputs = plan.input.iter().enumerate();
        let outputs = plan.output.iter().enumerate();
        Ok(Io {
            inputs: inputs.map(|(n, one)| coded(one.coding, format!("input[{n}]"))).collect::<Made<_>>()?,
            outputs: outputs
                .map(|(n, one)| coded(one.coding, format!("output[{n}]")))
                .collect::<Made<_>>()?,
        })
    }
}

impl Peripheral for Io {
    fn read(&mut self, _: &CycleTime, bytes: &[u8], inputs: &mut [f64]) {
        for (coding, value) in self.inputs.iter().zip(inputs) {
            *value = coding.read(bytes);
        }
    }

    fn write(&mut self, _: &CycleTime, outputs: &[f64], bytes: &mut [u8]) {
        for (coding, value) in self.outputs.iter().zip(outputs) {
            coding.write(*value, bytes);
        }
    }

    fn takes(&self, output: usize, value: f64) -> bool {
        self.outputs.get(output).is_some_and(|coding| coding.holds(value))
    }
}
