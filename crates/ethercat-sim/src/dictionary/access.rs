//! Who may do what with an entry, and in which state.

use core::ops::BitOr;
use omnibase_ethercat_wire::AlState;
use omnibase_ethercat_wire::coe::AbortCode;

/// The object access word of an SDO Information entry description (ETG.1000.6, table "Obj. access").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Access(pub u16);

impl Access {
    /// Nothing is allowed.
    pub const NONE: Access = Access(0);
    /// Read in every state.
    pub const READ: Access = Access(0x07);
    /// Write in PRE-OP.
    pub const WRITE_PRE_OP: Access = Access(0x08);
    /// Write in SAFE-OP.
    pub const WRITE_SAFE_OP: Access = Access(0x10);
    /// Write in OP.
    pub const WRITE_OP: Access = Access(0x20);
    /// Write in every state.
    pub const WRITE: Access = Access(0x38);
    /// Read and write in every state.
    pub const READ_WRITE: Access = Access(0x3F);
    /// Read in every state, write in PRE-OP only.
    pub const READ_WRITE_PRE_OP: Access = Access(0x0F);
    /// Mappable into an RxPDO (outputs).
    pub const RX_PDO: Access = Access(0x40);
    /// Mappable into a TxPDO (inputs).
    pub const TX_PDO: Access = Access(0x80);
    /// Kept for device replacement.
    pub const BACKUP: Access = Access(0x100);
    /// A start-up parameter.
    pub const SETTING: Access = Access(0x200);

    /// Whether every bit of `other` is set here.
    pub fn contains(self, other: Access) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether an upload is allowed in `state`.
    pub fn check_read(self, state: AlState) -> Result<(), AbortCode> {
        if self.0 & Access::READ.0 == 0 {
            return Err(AbortCode::WRITE_ONLY);
        }
        if self.0 & state_bit(state) == 0 { Err(AbortCode::DEVICE_STATE) } else { Ok(()) }
    }

    /// Whether a download is allowed in `state`.
    pub fn check_write(self, state: AlState) -> Result<(), AbortCode> {
        if self.0 & Access::WRITE.0 == 0 {
            return Err(AbortCode::READ_ONLY);
        }
        if self.0 & state_bit(state) << 3 == 0 { Err(AbortCode::DEVICE_STATE) } else { Ok(()) }
    }
}

impl BitOr for Access {
    type Output = Access;
    fn bitor(self, rhs: Access) -> Access {
        Access(self.0 | rhs.0)
    }
}

fn state_bit(state: AlState) -> u16 {
    match state {
        AlState::SafeOp => 2,
        AlState::Op => 4,
        AlState::Init | AlState::PreOp | AlState::Bootstrap => 1,
    }
}
