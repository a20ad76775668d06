//! What a network card says of itself, and the settings that it takes: SIOCETHTOOL.
//!
//! Layouts and numbers are those of `linux/ethtool.h`.

use crate::doctor::NicSetting;
use crate::interface;
use std::ffi::CStr;
use std::io;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};

const GET_DRIVER: u32 = 0x03;
const GET_COALESCE: u32 = 0x0E;
const SET_COALESCE: u32 = 0x0F;
const GET_FLAGS: u32 = 0x25;
const SET_FLAGS: u32 = 0x26;
const GET_GRO: u32 = 0x2B;
const SET_GRO: u32 = 0x2C;
const GET_EEE: u32 = 0x44;
const SET_EEE: u32 = 0x45;

/// Of the flags: large receive offload.
const FLAG_LRO: u32 = 1 << 15;

/// Words of `ethtool_coalesce`, and where in it stand the delays (us) and the adaptive switches.
const COALESCE_WORDS: usize = 23;
const RECEIVE_DELAY: usize = 1;
const SEND_DELAY: usize = 5;
const ADAPTIVE_RECEIVE: usize = 10;
const ADAPTIVE_SEND: usize = 11;

/// Words of `ethtool_eee`, and where in it stands the switch.
const EEE_WORDS: usize = 10;
const EEE_ENABLED: usize = 5;

/// A command or a setting that the driver doesn't take.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EthtoolError {
    /// The driver has no such setting.
    #[error("the driver of `{interface}` has no setting `{setting:?}`")]
    Unsupported {
        /// The interface.
        interface: String,
        /// The setting.
        setting: NicSetting,
    },
    /// Another refusal.
    #[error("`{setting:?}` of `{interface}`: {}", io::Error::from_raw_os_error(*.code))]
    Refused {
        /// The interface.
        interface: String,
        /// The setting.
        setting: NicSetting,
        /// `errno`.
        code: i32,
    },
}

/// The name of the interface's driver; `None` where it has none to tell.
pub(crate) fn driver(interface: &str) -> Option<String> {
    /// `ethtool_drvinfo`: the command, then six fields of text and five numbers; the driver's name comes first.
    #[repr(C)]
    struct DriverInfo {
        command: u32,
        driver: [u8; 32],
        rest: [u8; 160],
    }
    const { assert!(size_of::<DriverInfo>() == 196) };
    let mut info = DriverInfo { command: GET_DRIVER, driver: [0; 32], rest: [0; 160] };
    // SAFETY: the structure is plain data of the size that GET_DRIVER writes.
    unsafe { ask(interface, &mut info) }.ok()?;
    let name = CStr::from_bytes_until_nul(&info.driver).ok()?;
    Some(name.to_string_lossy().into_owned())
}

/// The value of a setting: microseconds, or 0 and 1.
pub(crate) fn get(interface: &str, setting: NicSetting) -> Result<u32, EthtoolError> {
    let value = match place(setting) {
        SettingSource::Coalesce(word) => {
            words::<COALESCE_WORDS>(interface, GET_COALESCE).map(|words| words[word])
        }
        SettingSource::Eee => words::<EEE_WORDS>(interface, GET_EEE).map(|words| words[EEE_ENABLED]),
        SettingSource::Gro => words::<2>(interface, GET_GRO).map(|words| words[1]),
        SettingSource::Flag(flag) => {
            words::<2>(interface, GET_FLAGS).map(|words| u32::from(words[1] & flag != 0))
        }
    };
    value.map_err(|error| refusal(interface, setting, &error))
}

/// Gives a setting a value and leaves the others as they are.
pub(crate) fn set(interface: &str, setting: NicSetting, value: u32) -> Result<(), EthtoolError> {
    let result = match place(setting) {
        SettingSource::Coalesce(word) => {
            change::<COALESCE_WORDS>(interface, [GET_COALESCE, SET_COALESCE], |words| words[word] = value)
        }
        SettingSource::Eee => {
            change::<EEE_WORDS>(interface, [GET_EEE, SET_EEE], |words| words[EEE_ENABLED] = value)
        }
        SettingSource::Gro => change::<2>(interface, [GET_GRO, SET_GRO], |words| words[1] = value),
        SettingSource::Flag(flag) => change::<2>(interface, [GET_FLAGS, SET_FLAGS], |words| {
            words[1] = if value == 0 { words[1] & !flag } else { words[1] | flag };
        }),
    };
    result.map_err(|error| refusal(interface, setting, &error))
}

/// Where a setting stands.
enum SettingSource {
    Coalesce(usize),
    Eee,
    Gro,
    Flag(u32),
}

fn place(setting: NicSetting) -> SettingSource {
    match setting {
        NicSetting::ReceiveDelay => SettingSource::Coalesce(RECEIVE_DELAY),
        NicSetting::SendDelay => SettingSource::Coalesce(SEND_DELAY),
        NicSetting::AdaptiveReceive => SettingSource::Coalesce(ADAPTIVE_RECEIVE),
        NicSetting::AdaptiveSend => SettingSource::Coalesce(ADAPTIVE_SEND),
        NicSetting::ReceiveOffload => SettingSource::Gro,
        NicSetting::LargeReceiveOffload => SettingSource::Flag(FLAG_LRO),
        NicSetting::EnergyEfficient => SettingSource::Eee,
    }
}

fn refusal(interface: &str, setting: NicSetting, error: &io::Error) -> EthtoolError {
    let interface = interface.to_owned();
    match error.raw_os_error().unwrap_or(0) {
        libc::EOPNOTSUPP => EthtoolError::Unsupported { interface, setting },
        code => EthtoolError::Refused { interface, setting, code },
    }
}

/// A structure that consists of words, the command first.
fn words<const N: usize>(interface: &str, command: u32) -> io::Result<[u32; N]> {
    let mut words = [0; N];
    words[0] = command;
    // SAFETY: each command that is passed here reads and writes a structure of N words.
    unsafe { ask(interface, &mut words) }?;
    Ok(words)
}

fn change<const N: usize>(
    interface: &str,
    [get, set]: [u32; 2],
    edit: impl FnOnce(&mut [u32; N]),
) -> io::Result<()> {
    let mut words = words::<N>(interface, get)?;
    edit(&mut words);
    words[0] = set;
    // SAFETY: as in `words`.
    unsafe { ask(interface, &mut words) }
}

/// Passes a command with its data to the interface's driver.
///
/// # Safety
///
/// `data` is plain data that begins with the command, and as large as the command's structure.
unsafe fn ask<T>(interface: &str, data: &mut T) -> io::Result<()> {
    let Some(mut request) = interface::request(interface) else {
        return Err(io::Error::from_raw_os_error(libc::ENODEV));
    };
    request.ifr_ifru.ifru_data = (data as *mut T).cast();
    // SAFETY: socket has no memory arguments; a negative result is no descriptor and isn't wrapped.
    let socket = unsafe {
        let descriptor = libc::socket(libc::AF_INET, libc::SOCK_DGRAM | libc::SOCK_CLOEXEC, 0);
        if descriptor < 0 {
            return Err(io::Error::last_os_error());
        }
        OwnedFd::from_raw_fd(descriptor)
    };
    // SAFETY: the ifreq names the interface and points to the caller's live structure.
    if unsafe { libc::ioctl(socket.as_raw_fd(), libc::SIOCETHTOOL as _, &mut request) } == 0 {
        return Ok(());
    }
    Err(io::Error::last_os_error())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Namespace;

    #[test]
    fn a_virtual_cable_tells_its_driver_and_takes_settings() {
        let Some(namespace) = Namespace::for_test("a_virtual_cable_tells_its_driver") else { return };
        namespace.run(|| {
            assert_eq!(driver(Namespace::NEAR).as_deref(), Some("veth"));
            for value in [1, 0, 1] {
                set(Namespace::NEAR, NicSetting::ReceiveOffload, value).unwrap();
                assert_eq!(get(Namespace::NEAR, NicSetting::ReceiveOffload), Ok(value));
            }
            let refused = get(Namespace::NEAR, NicSetting::EnergyEfficient);
            assert!(matches!(refused, Err(EthtoolError::Unsupported { .. })), "{refused:?}");
        });
    }

    #[test]
    fn an_interface_that_is_not_there_is_refused() {
        assert_eq!(driver("nope0"), None);
        assert!(get("nope0", NicSetting::ReceiveDelay).is_err());
    }
}
