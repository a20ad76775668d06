//! The FoE server: files in BOOT.

use super::coe::MailboxFault;
use omnibase_ethercat_wire::AlState;
use omnibase_ethercat_wire::foe::{FoeErrorCode, HEADER, Message};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The most that a file may have, bytes.
pub const FILE_LIMIT: usize = 16 << 20;

/// A device's files as they lie in its flash memory: they outlast power. Clones are the same files.
#[derive(Clone, Debug, Default)]
pub struct FileStore(Arc<Mutex<Files>>);

/// What is in a [`FileStore`], and how the server behaves.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Files {
    /// Files by their names.
    pub files: BTreeMap<String, Vec<u8>>,
    /// A file was begun and not completed: the device has no valid firmware and stays below PRE-OP.
    pub incomplete: bool,
    /// What must be said to write; 0 takes anything.
    pub password: u32,
    /// Before each of these packets it is busy so many times.
    pub busy_times: u32,
}

impl FileStore {
    /// Files with one firmware in them.
    pub fn with_firmware(name: &str, content: &[u8]) -> Self {
        let files = BTreeMap::from([(name.to_owned(), content.to_vec())]);
        FileStore(Arc::new(Mutex::new(Files { files, ..Files::default() })))
    }

    /// The files.
    pub fn lock(&self) -> MutexGuard<'_, Files> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[derive(Debug, Default)]
enum Transfer {
    #[default]
    None,
    Writing {
        name: String,
        data: Vec<u8>,
        /// The packet that was taken last.
        packet: u32,
        busy: u32,
    },
    Reading {
        data: Vec<u8>,
        /// The packet that was sent last.
        packet: u32,
        is_last: bool,
    },
}

/// The server with its transfer in hand.
#[derive(Debug)]
pub(crate) struct Server {
    store: FileStore,
    transfer: Transfer,
}

/// Service data that a packet holds, bytes, each way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    pub receive: usize,
    pub send: usize,
}

impl Server {
    pub fn new(store: FileStore) -> Self {
        Server { store, transfer: Transfer::None }
    }

    pub fn store(&self) -> &FileStore {
        &self.store
    }

    /// Forgets the transfer in hand; what it had erased stays erased.
    pub fn reset(&mut self) {
        self.transfer = Transfer::None;
    }

    /// Answers the service data of an FoE message.
    pub fn answer(
        &mut self,
        request: &[u8],
        state: AlState,
        room: Room,
    ) -> Result<Option<Vec<u8>>, MailboxFault> {
        let message = Message::read(request).map_err(|_| MailboxFault::TooShort)?;
        if state != AlState::Bootstrap {
            self.transfer = Transfer::None;
            return Ok(refusal(FoeErrorCode::BOOTSTRAP_ONLY, "files in BOOT only"));
        }
        Ok(match message {
            Message::Write { password, name } => self.begin_writing(password, name),
            Message::Read { password, name } => self.begin_reading(password, name, room),
            Message::Data { packet, data } => self.take(packet, data, room),
            Message::Acknowledge { packet } => self.acknowledged(packet, room),
            Message::Busy { .. } => self.again(room),
            Message::Error { .. } => {
                self.transfer = Transfer::None;
                None
            }
        })
    }

    fn begin_writing(&mut self, password: u32, name: &[u8]) -> Option<Vec<u8>> {
        let mut files = self.store.lock();
        if files.password != 0 && files.password != password {
            self.transfer = Transfer::None;
            return refusal(FoeErrorCode::ACCESS_DENIED, "wrong password");
        }
        // The flash memory is erased before the first packet, as real devices do.
        let name = String::from_utf8_lossy(name).into_owned();
        files.files.remove(&name);
        files.incomplete = true;
        self.transfer = Transfer::Writing { name, data: Vec::new(), packet: 0, busy: files.busy_times };
        emit(Message::Acknowledge { packet: 0 })
    }

    fn take(&mut self, number: u32, bytes: &[u8], room: Room) -> Option<Vec<u8>> {
        let Transfer::Writing { name, data, packet, busy } = &mut self.transfer else {
            return refusal(FoeErrorCode::ILLEGAL, "nothing is being written");
        };
        if number != packet.wrapping_add(1) {
            self.transfer = Transfer::None;
            return refusal(FoeErrorCode::PACKET_NUMBER, "");
        }
        if *busy > 0 {
            *busy -= 1;
            return emit(Message::Busy { done: 0, entire: 0, text: b"flash" });
        }
        if data.len() + bytes.len() > FILE_LIMIT {
            self.transfer = Transfer::None;
            return refusal(FoeErrorCode::DISK_FULL, "");
        }
        data.extend_from_slice(bytes);
        *packet = number;
        let mut files = self.store.lock();
        *busy = files.busy_times;
        if bytes.len() < room.receive.saturating_sub(HEADER) {
            files.files.insert(core::mem::take(name), core::mem::take(data));
            files.incomplete = false;
            self.transfer = Transfer::None;
        }
        emit(Message::Acknowledge { packet: number })
    }

    fn begin_reading(&mut self, password: u32, name: &[u8], room: Room) -> Option<Vec<u8>> {
        let files = self.store.lock();
        if files.password != 0 && files.password != password {
            return refusal(FoeErrorCode::ACCESS_DENIED, "wrong password");
        }
        let Some(data) = files.files.get(&*String::from_utf8_lossy(name)) else {
            return refusal(FoeErrorCode::NOT_FOUND, "");
        };
        self.transfer = Transfer::Reading { data: data.clone(), packet: 1, is_last: false };
        drop(files);
        self.again(room)
    }

    fn acknowledged(&mut self, number: u32, room: Room) -> Option<Vec<u8>> {
        match &mut self.transfer {
            Transfer::Reading { packet, is_last, .. } if number == *packet => {
                if *is_last {
                    self.transfer = Transfer::None;
                    return None;
                }
                *packet += 1;
                self.again(room)
            }
            _ => {
                self.transfer = Transfer::None;
                refusal(FoeErrorCode::PACKET_NUMBER, "")
            }
        }
    }

    /// The packet in hand of a file that is read.
    fn again(&mut self, room: Room) -> Option<Vec<u8>> {
        let Transfer::Reading { data, packet, is_last } = &mut self.transfer else {
            return refusal(FoeErrorCode::ILLEGAL, "nothing is being read");
        };
        let full = room.send.saturating_sub(HEADER).max(1);
        let start = (*packet as usize - 1) * full;
        let piece = &data[start.min(data.len())..(start + full).min(data.len())];
        *is_last = piece.len() < full;
        emit(Message::Data { packet: *packet, data: piece })
    }
}

fn refusal(code: FoeErrorCode, text: &str) -> Option<Vec<u8>> {
    emit(Message::Error { code, text: text.as_bytes() })
}

fn emit(message: Message<'_>) -> Option<Vec<u8>> {
    let rest = match message {
        Message::Data { data, .. } => data.len(),
        Message::Error { text, .. } | Message::Busy { text, .. } => text.len(),
        _ => 0,
    };
    let mut bytes = vec![0; HEADER + rest];
    message.write(&mut bytes);
    Some(bytes)
}
