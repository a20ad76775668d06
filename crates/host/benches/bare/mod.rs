//! Loops without any of the ports' checks: the floor that a port can be measured against.

use std::sync::atomic::{AtomicU32, Ordering};

/// Bytes of a ring's slot.
const SLOT: usize = 2048;
const SLOTS: usize = 256;

/// A packet socket with mapped rings and nothing else: no bounds, no deadline, no drop counts.
pub struct BareRing {
    socket: i32,
    map: *mut u8,
    receive: usize,
    send: usize,
}

fn bare_socket(interface: &str, rings: bool) -> (i32, *mut u8) {
    let name = std::ffi::CString::new(interface).unwrap();
    // SAFETY: plain system calls on a socket of our own with live values; each result is checked.
    unsafe {
        let socket = libc::socket(libc::AF_PACKET, libc::SOCK_RAW, 0);
        assert!(socket >= 0);
        let set = |name: i32, value: *const libc::c_void, length: usize| {
            assert_eq!(libc::setsockopt(socket, libc::SOL_PACKET, name, value, length as u32), 0);
        };
        set(libc::PACKET_QDISC_BYPASS, (&raw const ONE).cast(), 4);
        let mut map: *mut u8 = std::ptr::null_mut();
        if rings {
            set(libc::PACKET_VERSION, (&raw const ONE).cast(), 4);
            let ring = libc::tpacket_req {
                tp_block_size: 65536,
                tp_block_nr: (SLOTS * SLOT / 65536) as u32,
                tp_frame_size: SLOT as u32,
                tp_frame_nr: SLOTS as u32,
            };
            set(libc::PACKET_RX_RING, (&raw const ring).cast(), size_of_val(&ring));
            set(libc::PACKET_TX_RING, (&raw const ring).cast(), size_of_val(&ring));
            let protection = libc::PROT_READ | libc::PROT_WRITE;
            let length = 2 * SLOTS * SLOT;
            map = libc::mmap(std::ptr::null_mut(), length, protection, libc::MAP_SHARED, socket, 0).cast();
            assert_ne!(map.cast::<libc::c_void>(), libc::MAP_FAILED);
        }
        let mut address: libc::sockaddr_ll = std::mem::zeroed();
        address.sll_family = libc::AF_PACKET as u16;
        address.sll_protocol = 0x88A4u16.to_be();
        address.sll_ifindex = libc::if_nametoindex(name.as_ptr()) as i32;
        let length = size_of::<libc::sockaddr_ll>() as u32;
        assert_eq!(libc::bind(socket, (&raw const address).cast(), length), 0);
        (socket, map)
    }
}

static ONE: i32 = 1;

impl BareRing {
    /// Opens `interface` with both rings.
    pub fn open(interface: &str) -> Self {
        let (socket, map) = bare_socket(interface, true);
        BareRing { socket, map, receive: 0, send: 0 }
    }

    fn slot(&self, number: usize) -> (*mut u8, &AtomicU32) {
        // SAFETY: numbers are below the slots that were mapped; the status word stands first and is aligned.
        unsafe {
            let start = self.map.add(number * SLOT);
            (start, AtomicU32::from_ptr(start.cast()))
        }
    }

    /// Sends a frame of at most [`SLOT`] bytes less the header.
    pub fn send(&mut self, frame: &[u8]) {
        let (start, status) = self.slot(SLOTS + self.send);
        // SAFETY: the slot was given back by the kernel many sends ago; the frame fits.
        unsafe {
            (&raw mut (*start.cast::<libc::tpacket2_hdr>()).tp_len).write(frame.len() as u32);
            start.add(32).copy_from_nonoverlapping(frame.as_ptr(), frame.len());
            status.store(libc::TP_STATUS_SEND_REQUEST, Ordering::Release);
            libc::send(self.socket, std::ptr::null(), 0, libc::MSG_DONTWAIT);
        }
        self.send = (self.send + 1) % SLOTS;
    }

    /// The length of the next frame, copied into `buffer`; `None` while there is none.
    pub fn poll(&mut self, buffer: &mut [u8]) -> Option<usize> {
        let (start, status) = self.slot(self.receive);
        if status.load(Ordering::Acquire) & libc::TP_STATUS_USER == 0 {
            std::hint::spin_loop();
            return None;
        }
        // SAFETY: the slot is ours until its status is given back.
        let length = unsafe {
            let header = &*start.cast::<libc::tpacket2_hdr>();
            let length = header.tp_snaplen as usize;
            buffer.as_mut_ptr().copy_from_nonoverlapping(start.add(usize::from(header.tp_mac)), length);
            length
        };
        status.store(libc::TP_STATUS_KERNEL, Ordering::Release);
        self.receive = (self.receive + 1) % SLOTS;
        Some(length)
    }
}

// An open socket gets a copy of every echo: candidates that have had their turn must be gone.
impl Drop for BareRing {
    fn drop(&mut self) {
        // SAFETY: mapping and socket are this value's own.
        unsafe {
            libc::munmap(self.map.cast(), 2 * SLOTS * SLOT);
            libc::close(self.socket);
        }
    }
}

/// A packet socket and nothing else: results aren't looked at.
pub struct BareSocket(i32);

impl BareSocket {
    /// Opens `interface`.
    pub fn open(interface: &str) -> Self {
        BareSocket(bare_socket(interface, false).0)
    }

    /// Sends `frame`.
    pub fn send(&mut self, frame: &[u8]) {
        // SAFETY: pointer and length are those of a live slice.
        unsafe { libc::send(self.0, frame.as_ptr().cast(), frame.len(), 0) };
    }

    /// Waits for a frame.
    pub fn receive(&mut self, buffer: &mut [u8]) {
        // SAFETY: pointer and length are those of a live slice.
        unsafe { libc::recv(self.0, buffer.as_mut_ptr().cast(), buffer.len(), 0) };
    }
}

impl Drop for BareSocket {
    fn drop(&mut self) {
        // SAFETY: the socket is this value's own.
        unsafe { libc::close(self.0) };
    }
}
