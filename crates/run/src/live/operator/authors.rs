//! Who set which output, and moved which axis: what a page asked for ends with it.

use omnibase_robot::RequestKind;
use omnibase_robot::signals::{AxisAsk, MAX_DEVICES, MAX_SIGNALS};

use crate::live::command::Client;

/// The authors of outputs and of the motions of axes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Authors {
    outputs: Works<MAX_SIGNALS>,
    axes: Works<MAX_DEVICES>,
}

impl Authors {
    /// Something was done that ends with whoever asked for it.
    pub(super) fn note(&mut self, kind: &RequestKind, client: Client) {
        match *kind {
            RequestKind::SetOutput { index, .. } => self.outputs.set(index, client),
            RequestKind::Axis { device, ask: AxisAsk::Home | AxisAsk::Move { .. } | AxisAsk::Run { .. } } => {
                self.axes.set(device, client);
            }
            _ => {}
        }
    }

    /// A client is gone.
    pub(super) fn gone(&mut self, client: Client) {
        self.outputs.gone(client);
        self.axes.gone(client);
    }

    /// What to ask because somebody is gone, one a cycle: axes first.
    pub(super) fn next_end(&mut self) -> Option<RequestKind> {
        let axis = self.axes.next().map(|device| RequestKind::Axis { device, ask: AxisAsk::Stop });
        axis.or_else(|| self.outputs.next().map(|index| RequestKind::ResetOutput { index }))
    }
}

/// By whom each of so many is as it is.
#[derive(Clone, Copy, Debug)]
struct Works<const COUNT: usize> {
    by: [Option<Client>; COUNT],
    /// Those whose authors are gone: bit n for the n-th.
    left: u64,
}

impl<const COUNT: usize> Default for Works<COUNT> {
    fn default() -> Self {
        Works { by: [None; COUNT], left: 0 }
    }
}

impl<const COUNT: usize> Works<COUNT> {
    fn set(&mut self, index: u32, client: Client) {
        if let Some(by) = self.by.get_mut(index as usize) {
            *by = Some(client);
        }
    }

    fn gone(&mut self, client: Client) {
        for (index, by) in self.by.iter_mut().enumerate() {
            if by.take_if(|by| *by == client).is_some() {
                self.left |= 1 << index;
            }
        }
    }

    fn next(&mut self) -> Option<u32> {
        let index = (self.left != 0).then(|| self.left.trailing_zeros())?;
        self.left &= self.left - 1;
        Some(index)
    }
}
