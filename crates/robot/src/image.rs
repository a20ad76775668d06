//! The edge between the cycle and the bus: each wheel's process data as bytes.

use crate::config::RobotPlan;

/// The process data of all wheels' drives. A bus fills the inputs and sends the outputs; the cycle knows no bus.
pub trait ProcessImage {
    /// What the drive of a wheel sent; empty where there is no such wheel.
    fn inputs(&self, wheel: usize) -> &[u8];

    /// What the drive of a wheel will be sent; empty where there is no such wheel.
    fn outputs(&mut self, wheel: usize) -> &mut [u8];

    /// What a SubDevice without a wheel sent; empty where nothing of it is read, and where its process data didn't go in
    /// this cycle. `None` where it isn't there.
    fn device_inputs(&self, device: usize) -> Option<&[u8]>;

    /// What a SubDevice without a wheel will be sent; empty where nothing is written to it.
    fn device_outputs(&mut self, device: usize) -> &mut [u8];
}

/// A process image in memory, for buses that keep their own, for replay and for tests.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageBuffer {
    /// Inputs, wheel by wheel.
    pub inputs: Vec<Vec<u8>>,
    /// Outputs, wheel by wheel.
    pub outputs: Vec<Vec<u8>>,
    /// Inputs of the SubDevices without a wheel.
    pub device_inputs: Vec<Vec<u8>>,
    /// Outputs of the SubDevices without a wheel.
    pub device_outputs: Vec<Vec<u8>>,
    /// Which of these are there.
    pub devices_there: Vec<bool>,
}

impl ImageBuffer {
    /// A buffer as long as a plan's drives need it, all zero.
    pub fn new(plan: &RobotPlan) -> Self {
        ImageBuffer {
            inputs: plan.drives.iter().map(|drive| vec![0; drive.input_bytes()]).collect(),
            outputs: plan.drives.iter().map(|drive| vec![0; drive.output_bytes()]).collect(),
            device_inputs: plan.devices.iter().map(|device| vec![0; device.input_bytes()]).collect(),
            device_outputs: plan.devices.iter().map(|device| vec![0; device.output_bytes()]).collect(),
            devices_there: vec![true; plan.devices.len()],
        }
    }
}

impl ProcessImage for ImageBuffer {
    fn inputs(&self, wheel: usize) -> &[u8] {
        self.inputs.get(wheel).map_or(&[], Vec::as_slice)
    }

    fn outputs(&mut self, wheel: usize) -> &mut [u8] {
        self.outputs.get_mut(wheel).map_or(&mut [], Vec::as_mut_slice)
    }

    fn device_inputs(&self, device: usize) -> Option<&[u8]> {
        let is_there = self.devices_there.get(device).is_some_and(|is_there| *is_there);
        self.device_inputs.get(device).filter(|_| is_there).map(Vec::as_slice)
    }

    fn device_outputs(&mut self, device: usize) -> &mut [u8] {
        self.device_outputs.get_mut(device).map_or(&mut [], Vec::as_mut_slice)
    }
}
