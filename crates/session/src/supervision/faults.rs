//! Which fault a drive has: by its process data, by its emergency, or asked by SDO where neither said it.

use omnibase_cia402::ErrorCode;
use omnibase_ethercat::cyclic::{AcyclicRequest, AcyclicWork, CyclicBus, Health};
use omnibase_ethercat::mailbox::MailboxRequest;
use omnibase_ethercat::wire::Link;
use omnibase_ethercat::wire::coe::ObjectAddress;

use super::{MOST_WAITING, Supervisor};

/// The object that says which fault it is.
const ERROR_CODE: ObjectAddress = ObjectAddress::new(0x603F, 0);
/// Its length.
pub(super) const ERROR_CODE_BYTES: usize = 2;
/// By that its answer is known among others.
const ASKED: u64 = 0x603F;

/// What is known of a drive's fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Fault {
    /// None, or it is known.
    #[default]
    Told,
    /// It shows one, and didn't say which.
    Untold,
    /// It was asked.
    Asked,
}

impl Supervisor {
    /// Asks one drive at a time; one that is in OP alone has time for it.
    pub(super) fn ask_for_faults<L: Link>(&mut self, bus: &mut CyclicBus<L>) {
        if self.all.iter().any(|one| one.fault == Fault::Asked) {
            return;
        }
        let untold = |one: &&mut super::Supervised| {
            one.fault == Fault::Untold && one.health == Health::Operational && !one.is_away()
        };
        let Some(one) = self.all.iter_mut().find(untold) else { return };
        let upload = MailboxRequest::upload(ERROR_CODE, std::mem::take(&mut self.error_code));
        let position = one.subdevice.position;
        let work = AcyclicWork::Mailbox(upload);
        match bus.submit(AcyclicRequest { tag: ASKED, position, work }) {
            Ok(()) => one.fault = Fault::Asked,
            Err(AcyclicRequest { work: AcyclicWork::Mailbox(upload), .. }) => self.error_code = upload.data,
            Err(_) => {}
        }
    }

    /// An answer by SDO came, or failed: then it stays unknown.
    pub(super) fn answered(&mut self, is_there: bool, answer: MailboxRequest) {
        let Some(number) = self.all.iter().position(|one| one.fault == Fault::Asked) else { return };
        self.all[number].fault = Fault::Told;
        if is_there && let [low, high] = answer.data[..] {
            let error = ErrorCode(u16::from_le_bytes([low, high]));
            self.tell(number, format_args!("asked by SDO, it says error code {error}"));
            self.drive_says(number, error);
        }
        self.error_code = answer.data;
        self.error_code.clear();
    }

    /// A drive said what is wrong with it.
    pub(super) fn drive_says(&mut self, number: usize, error: ErrorCode) {
        let one = &mut self.all[number];
        if error == ErrorCode::NONE {
            return;
        }
        if one.fault == Fault::Untold {
            one.fault = Fault::Told;
        }
        if let Some(wheel) = one.wheel
            && self.said.len() < MOST_WAITING
        {
            self.said.push_back((wheel, error));
        }
    }
}
