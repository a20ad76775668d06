//! SDO server: expedited, normal and segmented transfers, up and down, complete access.

use super::{MailboxFault, Served, message};
use crate::dictionary::{FirstSubindex, pdo};
use omnibase_ethercat_wire::coe::{AbortCode, ObjectAddress, SDO_HEADER, SdoHeader, Service, sdo};

/// Data of a segment that is as short as CANopen's.
const SHORT_SEGMENT: usize = 7;
/// The most that a segmented download may announce: the largest object that a dictionary can describe.
const MAX_OBJECT: usize = 65_536;

/// A transfer of several messages.
#[derive(Debug, Default)]
pub(super) enum Transfer {
    #[default]
    Idle,
    Download {
        target: Target,
        data: Vec<u8>,
        announced: usize,
        toggle: u8,
    },
    Upload {
        object: ObjectAddress,
        data: Vec<u8>,
        sent: usize,
        toggle: u8,
    },
}

/// What a transfer reads or writes.
#[derive(Clone, Copy, Debug)]
pub(super) enum Target {
    Entry(ObjectAddress),
    Complete(u16, FirstSubindex, ObjectAddress),
}

impl Target {
    fn new(header: &SdoHeader) -> Result<Self, AbortCode> {
        if header.command & sdo::COMPLETE_ACCESS == 0 {
            return Ok(Target::Entry(header.object));
        }
        let first = FirstSubindex::new(header.object.subindex)?;
        Ok(Target::Complete(header.object.index, first, header.object))
    }

    fn address(&self) -> ObjectAddress {
        match self {
            Target::Entry(address) | Target::Complete(_, _, address) => *address,
        }
    }

    fn flag(&self) -> u8 {
        match self {
            Target::Entry(_) => 0,
            Target::Complete(..) => sdo::COMPLETE_ACCESS,
        }
    }

    fn read(&self, served: &Served) -> Result<Vec<u8>, AbortCode> {
        match self {
            Target::Entry(address) => served.dictionary.read(*address, served.state).map(<[u8]>::to_vec),
            Target::Complete(index, first, _) => {
                served.dictionary.read_complete(*index, *first, served.state)
            }
        }
    }

    /// Before the data of a long download come: refuses what can't be written anyway.
    fn check_announced(&self, served: &Served, announced: usize) -> Result<(), AbortCode> {
        if let Target::Entry(address) = self {
            let object = served.dictionary.object(address.index).ok_or(AbortCode::NO_SUCH_OBJECT)?;
            let entry = object.entry(address.subindex).ok_or(AbortCode::NO_SUCH_SUBINDEX)?;
            entry.access.check_write(served.state)?;
            if announced > entry.capacity() {
                return Err(AbortCode::TOO_LONG);
            }
        }
        if announced > MAX_OBJECT { Err(AbortCode::OUT_OF_MEMORY) } else { Ok(()) }
    }

    fn write(&self, served: &mut Served, data: &[u8]) -> Result<(), AbortCode> {
        let (index, first) = match self {
            Target::Entry(address) => return served.write(*address, data),
            Target::Complete(index, first, _) => (*index, *first),
        };
        let mut parts = served.dictionary.split_complete(index, first, served.state, data)?;
        if pdo::is_pdo_object(index) && first == FirstSubindex::Zero && !parts.is_empty() {
            // The number of entries is emptied first and becomes valid last, as a careful client does it.
            parts.insert(0, (ObjectAddress::new(index, 0), vec![0]));
            let count = parts.remove(1);
            parts.push(count);
        }
        let before: Vec<(ObjectAddress, Vec<u8>)> = parts
            .iter()
            .filter_map(|(address, _)| Some((*address, served.dictionary.peek(*address)?.to_vec())))
            .collect();
        for (address, value) in &parts {
            if let Err(abort) = served.write_checked(*address, value) {
                for (address, value) in &before {
                    served.dictionary.store(*address, value);
                }
                return Err(abort);
            }
        }
        Ok(())
    }
}

impl Transfer {
    /// Answers an SDO request; `None` where the request wants no answer.
    pub fn answer(&mut self, body: &[u8], served: &mut Served) -> Result<Option<Vec<u8>>, MailboxFault> {
        let header = SdoHeader::read(body).ok_or(MailboxFault::TooShort)?;
        let data = &body[SDO_HEADER..];
        let (object, result) = match header.command & sdo::SPECIFIER {
            sdo::CLIENT_DOWNLOAD => (header.object, self.start_download(&header, data, served)),
            sdo::CLIENT_UPLOAD => (header.object, self.start_upload(&header, served)),
            sdo::CLIENT_DOWNLOAD_SEGMENT => (self.object(), self.download_segment(body, served)),
            sdo::CLIENT_UPLOAD_SEGMENT => (self.object(), self.upload_segment(header.command, served)),
            sdo::ABORT => {
                *self = Transfer::Idle;
                return Ok(None);
            }
            _ => (header.object, Err(AbortCode::COMMAND)),
        };
        Ok(Some(result.unwrap_or_else(|abort| {
            *self = Transfer::Idle;
            refusal(object, abort)
        })))
    }

    /// The object of the transfer on its way.
    fn object(&self) -> ObjectAddress {
        match self {
            Transfer::Idle => ObjectAddress::new(0, 0),
            Transfer::Download { target, .. } => target.address(),
            Transfer::Upload { object, .. } => *object,
        }
    }

    fn start_download(
        &mut self,
        header: &SdoHeader,
        data: &[u8],
        served: &mut Served,
    ) -> Result<Vec<u8>, AbortCode> {
        *self = Transfer::Idle;
        let target = Target::new(header)?;
        if header.command & sdo::EXPEDITED != 0 {
            let length = if header.command & sdo::SIZE_INDICATED != 0 {
                sdo::expedited_length(header.command)
            } else {
                served.dictionary.entry(header.object).map_or(4, |entry| entry.capacity().min(4))
            };
            target.write(served, &header.data[..length])?;
            return Ok(download_response(&target));
        }
        let announced = header.value() as usize;
        if header.command & sdo::SIZE_INDICATED == 0 {
            return Err(AbortCode::COMMAND);
        }
        target.check_announced(served, announced)?;
        if data.len() >= announced {
            target.write(served, &data[..announced])?;
        } else {
            let (data, toggle) = (data.to_vec(), 0);
            *self = Transfer::Download { target, data, announced, toggle };
        }
        Ok(download_response(&target))
    }

    fn download_segment(&mut self, body: &[u8], served: &mut Served) -> Result<Vec<u8>, AbortCode> {
        let Transfer::Download { target, data, announced, toggle } = self else {
            return Err(AbortCode::COMMAND);
        };
        let command = body[0];
        if command & sdo::TOGGLE != *toggle {
            return Err(AbortCode::TOGGLE);
        }
        let unused = if body.len() <= 1 + SHORT_SEGMENT { sdo::segment_unused_bytes(command) } else { 0 };
        data.extend_from_slice(&body[1..body.len() - unused.min(body.len() - 1)]);
        if data.len() > *announced {
            return Err(AbortCode::TOO_LONG);
        }
        let response = segment_response(sdo::SERVER_DOWNLOAD_SEGMENT | *toggle, &[]);
        *toggle ^= sdo::TOGGLE;
        if command & sdo::LAST_SEGMENT != 0 {
            if data.len() < *announced {
                return Err(AbortCode::TOO_SHORT);
            }
            let (target, data) = (*target, core::mem::take(data));
            *self = Transfer::Idle;
            target.write(served, &data)?;
        }
        Ok(response)
    }

    fn start_upload(&mut self, header: &SdoHeader, served: &Served) -> Result<Vec<u8>, AbortCode> {
        *self = Transfer::Idle;
        let target = Target::new(header)?;
        let data = target.read(served)?;
        if data.len() <= 4 && !data.is_empty() {
            let mut bytes = [0; 4];
            bytes[..data.len()].copy_from_slice(&data);
            let kind = sdo::SERVER_UPLOAD | sdo::EXPEDITED | sdo::SIZE_INDICATED | target.flag();
            let command = kind | sdo::expedited_unused(data.len());
            return Ok(response(SdoHeader { command, object: header.object, data: bytes }, &[]));
        }
        let size = u32::try_from(data.len()).map_err(|_| AbortCode::GENERAL)?.to_le_bytes();
        let command = sdo::SERVER_UPLOAD | sdo::SIZE_INDICATED | target.flag();
        let sent = data.len().min(served.room.saturating_sub(2 + SDO_HEADER));
        let message = response(SdoHeader { command, object: header.object, data: size }, &data[..sent]);
        if sent < data.len() {
            *self = Transfer::Upload { object: header.object, data, sent, toggle: 0 };
        }
        Ok(message)
    }

    fn upload_segment(&mut self, command: u8, served: &Served) -> Result<Vec<u8>, AbortCode> {
        let Transfer::Upload { data, sent, toggle, .. } = self else {
            return Err(AbortCode::COMMAND);
        };
        if command & sdo::TOGGLE != *toggle {
            return Err(AbortCode::TOGGLE);
        }
        let room = served.room.saturating_sub(3).max(1);
        let segment = &data[*sent..data.len().min(*sent + room)];
        let last = *sent + segment.len() == data.len();
        let flags = sdo::segment_unused(segment.len()) | if last { sdo::LAST_SEGMENT } else { 0 };
        let message = segment_response(sdo::SERVER_UPLOAD_SEGMENT | *toggle | flags, segment);
        *sent += segment.len();
        *toggle ^= sdo::TOGGLE;
        if last {
            *self = Transfer::Idle;
        }
        Ok(message)
    }
}

fn response(header: SdoHeader, data: &[u8]) -> Vec<u8> {
    let mut body = vec![0; SDO_HEADER];
    header.write(&mut body);
    body.extend_from_slice(data);
    message(Service::SdoResponse, &body)
}

fn download_response(target: &Target) -> Vec<u8> {
    let command = sdo::SERVER_DOWNLOAD | target.flag();
    response(SdoHeader { command, object: target.address(), data: [0; 4] }, &[])
}

/// A segment, filled up to CANopen's eight bytes.
fn segment_response(command: u8, data: &[u8]) -> Vec<u8> {
    let mut body = vec![command];
    body.extend_from_slice(data);
    body.resize(body.len().max(1 + SHORT_SEGMENT), 0);
    message(Service::SdoResponse, &body)
}

/// An abort, which the standard counts among the requests.
fn refusal(object: ObjectAddress, abort: AbortCode) -> Vec<u8> {
    let mut body = [0; SDO_HEADER];
    SdoHeader { command: sdo::ABORT, object, data: abort.0.to_le_bytes() }.write(&mut body);
    message(Service::SdoRequest, &body)
}
