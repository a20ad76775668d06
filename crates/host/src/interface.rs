//! Which network interfaces there are, and the state of their links.

use std::ffi::{CStr, CString};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};

/// Whether frames can pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkState {
    /// The interface is up and sees a partner.
    Up,
    /// The interface is up, but nothing is at the other end of the cable.
    NoCarrier,
    /// The interface is switched off (`ip link set <interface> up` switches it on).
    Off,
    /// There is no such interface (any more).
    Missing,
}

/// The names of the interfaces that exist, in the kernel's order, without the loopback.
///
/// Empty where the kernel gives no list.
pub fn names() -> Vec<String> {
    let mut names = Vec::new();
    // SAFETY: if_nameindex returns null or an array that ends with index 0 and a null name; each other name is a
    // terminated string. The array is read before it is freed, and freed once.
    unsafe {
        let list = libc::if_nameindex();
        if list.is_null() {
            return names;
        }
        let mut entry = list;
        while (*entry).if_index != 0 && !(*entry).if_name.is_null() {
            let name = CStr::from_ptr((*entry).if_name).to_string_lossy().into_owned();
            if name != "lo" {
                names.push(name);
            }
            entry = entry.add(1);
        }
        libc::if_freenameindex(list);
    }
    names
}

/// A way to ask for links again and again without a new socket each time.
#[derive(Debug)]
pub struct LinkWatch(OwnedFd);

impl LinkWatch {
    /// A way into this thread's network.
    ///
    /// # Errors
    ///
    /// The kernel gives no socket.
    pub fn new() -> std::io::Result<Self> {
        // SAFETY: socket has no memory arguments; a negative result is no descriptor and isn't wrapped.
        unsafe {
            let descriptor = libc::socket(libc::AF_INET, libc::SOCK_DGRAM | libc::SOCK_CLOEXEC, 0);
            if descriptor < 0 {
                return Err(std::io::Error::last_os_error());
            }
            Ok(LinkWatch(OwnedFd::from_raw_fd(descriptor)))
        }
    }

    /// The state of the link of the interface `name`. Needs no rights.
    pub fn state(&self, name: &str) -> LinkState {
        link_state_with(self.0.as_raw_fd(), name)
    }
}

/// The state of the link of the interface `name`. Needs no rights.
pub fn link_state(name: &str) -> LinkState {
    LinkWatch::new().map_or(LinkState::Missing, |links| links.state(name))
}

/// As [`link_state`], with a socket that is there already.
pub(crate) fn link_state_with(socket: i32, name: &str) -> LinkState {
    let Some(request) = request(name) else { return LinkState::Missing };
    let mut request = request;
    // SAFETY: SIOCGIFFLAGS reads the name and writes the flags of the ifreq that it is given; the union member
    // read afterwards is the one that it wrote.
    let flags = unsafe {
        if libc::ioctl(socket, libc::SIOCGIFFLAGS as _, &mut request) != 0 {
            return LinkState::Missing;
        }
        i32::from(request.ifr_ifru.ifru_flags)
    };
    if flags & libc::IFF_UP == 0 {
        LinkState::Off
    } else if flags & libc::IFF_RUNNING == 0 {
        LinkState::NoCarrier
    } else {
        LinkState::Up
    }
}

/// The index of the interface `name`; `None` where there is none of this name. Needs no rights.
pub fn index_of(name: &str) -> Option<u32> {
    let name = CString::new(name).ok()?;
    // SAFETY: the argument is a terminated string that lives through the call.
    let index = unsafe { libc::if_nametoindex(name.as_ptr()) };
    (index != 0).then_some(index)
}

/// The interface's index; `None` where there is none of this name.
pub(crate) fn index(socket: i32, name: &str) -> Option<i32> {
    let mut request = request(name)?;
    // SAFETY: SIOCGIFINDEX reads the name and writes the index of the ifreq that it is given; the union member
    // read afterwards is the one that it wrote.
    unsafe {
        if libc::ioctl(socket, libc::SIOCGIFINDEX as _, &mut request) != 0 {
            return None;
        }
        Some(request.ifr_ifru.ifru_ifindex)
    }
}

/// An interface request with this name; `None` for a name that no interface can have.
pub(crate) fn request(name: &str) -> Option<libc::ifreq> {
    let bytes = name.as_bytes();
    if bytes.is_empty() || bytes.len() >= libc::IFNAMSIZ || bytes.contains(&0) {
        return None;
    }
    // SAFETY: ifreq is plain data for which zero bytes are valid.
    let mut request: libc::ifreq = unsafe { std::mem::zeroed() };
    for (to, from) in request.ifr_name.iter_mut().zip(bytes) {
        *to = *from as libc::c_char;
    }
    Some(request)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_cannot_exist_are_missing() {
        for name in ["", "no-such-interface-here", "nul\0", "nope0"] {
            assert_eq!(link_state(name), LinkState::Missing, "{name:?}");
        }
    }

    #[test]
    fn the_loopback_is_known_but_not_offered() {
        assert_ne!(link_state("lo"), LinkState::Missing);
        assert!(!names().contains(&"lo".to_owned()));
    }
}
