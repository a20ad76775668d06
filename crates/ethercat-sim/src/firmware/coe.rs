//! The CoE server: SDO and SDO Information.

mod info;
mod sdo;

use crate::device::Device;
use crate::dictionary::{Dictionary, pdo};
use omnibase_ethercat_wire::AlState;
use omnibase_ethercat_wire::coe::{self, AbortCode, ObjectAddress, Service};

/// A mailbox error that answers a request (ETG.1000.4, "Error reply").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub(crate) enum MailboxFault {
    Syntax = 1,
    UnsupportedProtocol = 2,
    UnsupportedService = 4,
    TooShort = 6,
}

/// What the server works on while it answers one request.
pub(crate) struct Served<'a> {
    pub dictionary: &'a mut Dictionary,
    pub device: &'a mut dyn Device,
    pub state: AlState,
    /// Service data that an answer can hold, bytes.
    pub room: usize,
    /// Bytes of process data that one direction can hold.
    pub max_process_data: usize,
}

impl Served<'_> {
    /// Writes one entry as an SDO does, with every check.
    fn write(&mut self, address: ObjectAddress, data: &[u8]) -> Result<(), AbortCode> {
        self.dictionary.check_write(address, data, self.state)?;
        self.write_checked(address, data)
    }

    /// Writes one entry whose rights, length and range were checked.
    fn write_checked(&mut self, address: ObjectAddress, data: &[u8]) -> Result<(), AbortCode> {
        if pdo::is_pdo_object(address.index) {
            pdo::check_write(self.dictionary, address, data, self.max_process_data)?;
        }
        self.device.check_write(self.dictionary, address, data)?;
        self.dictionary.store(address, data);
        self.device.written(self.dictionary, address);
        Ok(())
    }
}

/// The server's memory between requests.
#[derive(Debug, Default)]
pub(crate) struct Server {
    transfer: sdo::Transfer,
}

impl Server {
    /// Answers the service data of a CoE message, CoE header first, with messages to send.
    pub fn answer(&mut self, request: &[u8], served: &mut Served) -> Result<Vec<Vec<u8>>, MailboxFault> {
        let code = coe::service_code(request).ok_or(MailboxFault::TooShort)?;
        let body = &request[coe::HEADER..];
        match Service::from_code(code) {
            Some(Service::SdoRequest) => Ok(self.transfer.answer(body, served)?.into_iter().collect()),
            Some(Service::SdoInfo) => info::answer(body, served),
            _ => Err(MailboxFault::UnsupportedService),
        }
    }
}

/// A message of this service with `body` behind the CoE header.
fn message(service: Service, body: &[u8]) -> Vec<u8> {
    let mut message = vec![0; coe::HEADER];
    coe::write_header(&mut message, service);
    message.extend_from_slice(body);
    message
}
