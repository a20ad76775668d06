//! Who set which output: what a page set ends with it.

use omnibase_robot::RequestKind;
use omnibase_robot::signals::MAX_SIGNALS;

use crate::live::command::Client;

/// The authors of the outputs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Authors {
    by: [Option<Client>; MAX_SIGNALS],
    /// Outputs whose authors are gone, and that are to be reset: bit n for output n.
    left: u64,
}

impl Default for Authors {
    fn default() -> Self {
        Authors { by: [None; MAX_SIGNALS], left: 0 }
    }
}

impl Authors {
    /// An output was set.
    pub(super) fn set(&mut self, index: u32, client: Client) {
        if let Some(by) = self.by.get_mut(index as usize) {
            *by = Some(client);
        }
    }

    /// A client is gone.
    pub(super) fn gone(&mut self, client: Client) {
        for (output, by) in self.by.iter_mut().enumerate() {
            if by.take_if(|by| *by == client).is_some() {
                self.left |= 1 << output;
            }
        }
    }

    /// What to ask because somebody is gone, one output a cycle.
    pub(super) fn next_reset(&mut self) -> Option<RequestKind> {
        let index = (self.left != 0).then(|| self.left.trailing_zeros())?;
        self.left &= self.left - 1;
        Some(RequestKind::ResetOutput { index })
    }
}
