//! Who set which output, and moved which axis: what a page asked for ends with it. And whose axis shall stop.

use omnibase_robot::RequestKind;
use omnibase_robot::signals::{AxisAsk, MAX_DEVICES, MAX_SIGNALS};

use crate::live::command::Client;

/// The authors of outputs and of the motions of axes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Authors {
    outputs: Works<MAX_SIGNALS>,
    axes: Works<MAX_DEVICES>,
    /// Who asked last that an axis stops, and by which ticket.
    stops: [Option<(Client, u64)>; MAX_DEVICES],
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

    /// Somebody stops an axis: that waits for nothing else; the ticket of who asked for it before. An error where there is
    /// no such axis.
    pub(super) fn stop(&mut self, device: u32, client: Client, ticket: u64) -> Result<Option<u64>, ()> {
        let stop = self.stops.get_mut(device as usize).ok_or(())?;
        Ok(stop.replace((client, ticket)).map(|(_, ticket)| ticket))
    }

    /// What to ask because somebody wants it, or is gone, one a cycle: axes first.
    pub(super) fn next_end(&mut self) -> Option<(Client, u64, RequestKind)> {
        let stop = |device| RequestKind::Axis { device, ask: AxisAsk::Stop };
        let asked = self.stops.iter_mut().zip(0..).find_map(|(asked, device)| Some((asked.take()?, device)));
        if let Some(((client, ticket), device)) = asked {
            return Some((client, ticket, stop(device)));
        }
        let left = self.axes.next().map(stop);
        let left = left.or_else(|| self.outputs.next().map(|index| RequestKind::ResetOutput { index }));
        left.map(|kind| (Client::Command, 0, kind))
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
