//! The older format: one header, then records.

use super::{Capture, CaptureError, CapturedFrame, LINKTYPE_ETHERNET};
use pcap_parser::pcap::{
    parse_pcap_frame, parse_pcap_frame_be, parse_pcap_frame_modified, parse_pcap_header,
};

/// First words of a file: micro- and nanoseconds in either byte order, and the variant with longer records.
pub(super) const MAGICS: [u32; 5] = [0xA1B2_C3D4, 0xD4C3_B2A1, 0xA1B2_3C4D, 0x4D3C_B2A1, 0xA1B2_CD34];

pub(super) fn read(file: &[u8]) -> Result<Capture<'_>, CaptureError> {
    let Ok((_, header)) = parse_pcap_header(file) else {
        return Err(CaptureError::Header { format: "pcap", expected: 24, found: file.len() });
    };
    let mut capture = Capture::default();
    let linktype = header.network.0 & 0xFFFF;
    if linktype != LINKTYPE_ETHERNET {
        capture.warn(20, format!("link type {linktype} is not Ethernet (1): no frames can be read"));
        return Ok(capture);
    }
    let parse = match (header.is_modified_format(), header.is_bigendian()) {
        (true, _) => parse_pcap_frame_modified,
        (false, true) => parse_pcap_frame_be,
        (false, false) => parse_pcap_frame,
    };
    let unit_ns = if header.is_nanosecond_precision() { 1 } else { 1000 };
    let mut offset = header.size();
    while offset < file.len() {
        let Ok((rest, record)) = parse(&file[offset..]) else {
            let left = file.len() - offset;
            capture.warn(offset, format!("the file ends inside a record, {left} bytes are left over"));
            break;
        };
        capture.frames.push(CapturedFrame {
            number: capture.frames.len() as u64 + 1,
            unix_ns: u64::from(record.ts_sec) * 1_000_000_000 + u64::from(record.ts_usec) * unit_ns,
            direction: None,
            data: &file[file.len() - rest.len() - record.data.len()..file.len() - rest.len()],
            original_length: record.origlen as usize,
        });
        offset = file.len() - rest.len();
    }
    Ok(capture)
}
