//! From a segment file, or from images, to a segment.

use super::{Kind, Mistake, SegmentFile, SegmentFileError, SubDeviceEntry};
use crate::device::Piece;
use crate::device::axis::Axis;
use crate::device::esi;
use crate::device::generic::Generic;
use crate::device::simple;
use crate::pdi_socket::{Pace, SocketApplication};
use crate::segment::{TopologyError, frame_order};
use crate::{Attachment, Parent, Segment, SubDevice};
use core::time::Duration;
use omnibase_ethercat_wire::sii::ImageTooShort;
use std::path::Path;

/// How long virtual time waits for a firmware.
const PATIENCE: Duration = Duration::from_secs(30);
/// Ports in the order in which free ones are taken.
const PORTS: [u8; 3] = [1, 2, 3];
/// The same where frames come in by another one than 0.
const PORTS_SWAPPED: [u8; 4] = [0, 1, 2, 3];

impl SegmentFile {
    /// The segment; images are looked for in `base_dir`. Every servo has a motor of its own, and foreign firmware runs in
    /// lockstep.
    pub fn build(&self, base_dir: &Path) -> Result<Segment, SegmentFileError> {
        self.build_on(base_dir, &mut |_| None)
    }

    /// The same, foreign firmware at this pace.
    pub fn build_paced(&self, base_dir: &Path, pace: Pace) -> Result<Segment, SegmentFileError> {
        self.build_all(base_dir, pace, &mut |_| None)
    }

    /// The segment, servos on the axes that `axis` gives for their names; where it gives none, on their own.
    pub fn build_on(
        &self,
        base_dir: &Path,
        axis: &mut dyn FnMut(&str) -> Option<Box<dyn Axis>>,
    ) -> Result<Segment, SegmentFileError> {
        self.build_all(base_dir, Pace::Lockstep, axis)
    }

    fn build_all(
        &self,
        base_dir: &Path,
        pace: Pace,
        axis: &mut dyn FnMut(&str) -> Option<Box<dyn Axis>>,
    ) -> Result<Segment, SegmentFileError> {
        let mut problems = Vec::new();
        let mut sub_devices = Vec::new();
        for entry in &self.sub_devices {
            let built = build_one(entry, base_dir, axis(&entry.name));
            match built.and_then(|sub_device| with_socket(sub_device, entry, pace)) {
                Ok(sub_device) => sub_devices.push(sub_device),
                Err(text) => problems.push(problem(entry, text)),
            }
        }
        if problems.is_empty() {
            let attachments = self.attachments(&sub_devices, &mut problems);
            if problems.is_empty() {
                match in_frame_order(sub_devices, attachments).and_then(|(all, how)| Segment::new(all, how)) {
                    Ok(segment) => return Ok(segment),
                    Err(error) => problems.push(Mistake { line: 1, column: 1, text: error.to_string() }),
                }
            }
        }
        Err(SegmentFileError { problems })
    }

    fn attachments(&self, sub_devices: &[SubDevice], problems: &mut Vec<Mistake>) -> Vec<Attachment> {
        let mut taken: Vec<[bool; 4]> = self
            .sub_devices
            .iter()
            .map(|entry| [0, 1, 2, 3].map(|port| port == entry.plug.entry_port))
            .collect();
        let mut attachments = Vec::new();
        for entry in &self.sub_devices {
            let parent = match entry.plug.parent {
                None => Parent::MainDevice,
                Some(position) => {
                    let config = sub_devices[position].esc().config();
                    let is_swapped = self.sub_devices[position].plug.entry_port != 0;
                    let candidates: &[u8] = if is_swapped { &PORTS_SWAPPED } else { &PORTS };
                    let free = |port: &u8| config.has_port(*port) && !taken[position][usize::from(*port)];
                    let port = entry.plug.port.or_else(|| candidates.iter().copied().find(free));
                    let Some(port) = port else {
                        let name = &self.sub_devices[position].name;
                        problems.push(problem(entry, format!("\"{name}\" has no free port")));
                        continue;
                    };
                    if !config.has_port(port) {
                        let name = &self.sub_devices[position].name;
                        problems.push(problem(entry, format!("\"{name}\" has no port {port}")));
                    }
                    taken[position][usize::from(port)] = true;
                    Parent::SubDevice { position, port }
                }
            };
            attachments.push(Attachment {
                parent,
                entry_port: entry.plug.entry_port,
                cable_delay_ns: entry.plug.cable_delay_ns,
            });
        }
        attachments
    }
}

/// A file lists SubDevices as cables lead to them; positions are given in the order in which frames pass, where swapped
/// cables make another one of it.
fn in_frame_order(
    sub_devices: Vec<SubDevice>,
    attachments: Vec<Attachment>,
) -> Result<(Vec<SubDevice>, Vec<Attachment>), TopologyError> {
    if attachments.iter().all(|attachment| attachment.entry_port == 0) {
        return Ok((sub_devices, attachments));
    }
    let order =
        frame_order(&attachments, |position, port| sub_devices[position].esc().config().has_port(port))?;
    let place = |listed: usize| order.iter().position(|one| *one == listed).unwrap_or(listed);
    let moved = order.iter().map(|listed| {
        let attachment = attachments[*listed];
        let parent = match attachment.parent {
            Parent::SubDevice { position, port } => Parent::SubDevice { position: place(position), port },
            Parent::MainDevice => Parent::MainDevice,
        };
        Attachment { parent, ..attachment }
    });
    let moved = moved.collect();
    let mut places: Vec<Option<SubDevice>> = sub_devices.into_iter().map(Some).collect();
    let all = order.iter().filter_map(|listed| places[*listed].take()).collect();
    Ok((all, moved))
}

fn problem(entry: &SubDeviceEntry, text: String) -> Mistake {
    Mistake { line: entry.place.0, column: entry.place.1, text }
}

/// The same chip with its firmware behind a socket, where it has one.
fn with_socket(sub_device: SubDevice, entry: &SubDeviceEntry, pace: Pace) -> Result<SubDevice, String> {
    let Some(path) = &entry.socket else { return Ok(sub_device) };
    let mut application = SocketApplication::bind(path, pace)
        .map_err(|error| format!("socket `{}`: {error}", path.display()))?;
    if pace == Pace::Lockstep {
        // Virtual time would be over before anybody has connected.
        application.wait_for_firmware(PATIENCE).map_err(|error| {
            format!("socket `{}`: {error} within {} s", path.display(), PATIENCE.as_secs())
        })?;
    }
    Ok(sub_device.with_application(Box::new(application)))
}

fn build_one(
    entry: &SubDeviceEntry,
    base_dir: &Path,
    axis: Option<Box<dyn Axis>>,
) -> Result<SubDevice, String> {
    let generic = match &entry.kind {
        Kind::Drive(drive, load) => {
            return Ok(match axis {
                Some(axis) => drive.build_on(&entry.piece, axis),
                None => drive.build(&entry.piece, *load),
            });
        }
        Kind::Sii(path) => {
            let path = base_dir.join(path);
            let bytes = std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
            Generic::from_sii(&bytes, &entry.piece)
        }
        Kind::Esi(wanted) => return esi::build(wanted, base_dir, &entry.piece, axis),
        Kind::Coupler => simple::coupler(&entry.piece),
        Kind::DigitalIo(bits) => simple::digital_io(*bits, &entry.piece),
    };
    generic.map(|generic| generic.sub_device).map_err(|error| error.to_string())
}

/// Why images don't make a segment.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImagesError {
    /// An image can't be read.
    #[error("image {position}: {error}")]
    Image {
        /// Which one, from 0.
        position: usize,
        /// What is wrong.
        error: ImageTooShort,
    },
    /// The devices can't be plugged into a line.
    #[error(transparent)]
    Topology(#[from] crate::TopologyError),
    /// A device has no port for the next one.
    #[error("the device of image {position} has no port for the next one")]
    NoPort {
        /// Which one, from 0.
        position: usize,
    },
}

/// A line of devices from SII images.
pub fn line_of_images(images: &[Vec<u8>]) -> Result<Segment, ImagesError> {
    let mut sub_devices: Vec<SubDevice> = Vec::new();
    let mut attachments = Vec::new();
    for (position, image) in images.iter().enumerate() {
        let parent = match position.checked_sub(1) {
            None => Parent::MainDevice,
            Some(before) => {
                let config = sub_devices[before].esc().config();
                let port = PORTS.into_iter().find(|port| config.has_port(*port));
                let port = port.ok_or(ImagesError::NoPort { position: before })?;
                Parent::SubDevice { position: before, port }
            }
        };
        let generic = Generic::from_sii(image, &Piece::default())
            .map_err(|error| ImagesError::Image { position, error })?;
        sub_devices.push(generic.sub_device);
        attachments.push(Attachment { parent, entry_port: 0, cable_delay_ns: super::CABLE_DELAY_NS });
    }
    Ok(Segment::new(sub_devices, attachments)?)
}
