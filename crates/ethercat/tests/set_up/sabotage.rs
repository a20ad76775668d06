//! A link that spoils one chosen datagram.

use omnibase_ethercat::wire::bytes::put_u16;
use omnibase_ethercat::wire::frame::{DATAGRAM_HEADER, Datagrams};
use omnibase_ethercat::wire::{HostTime, Link, LinkError};

/// What happens to the chosen datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sabotage {
    /// Its frame is lost on the way out: no SubDevice sees it.
    LostOut,
    /// Its frame is lost on the way back: the SubDevices saw it.
    LostBack,
    /// No SubDevice takes part: its command is taken out, its working counter stays 0.
    Ignored,
    /// The SubDevices took part, but its working counter comes back as 0.
    Uncounted,
}

impl Sabotage {
    pub const ALL: [Sabotage; 4] =
        [Sabotage::LostOut, Sabotage::LostBack, Sabotage::Ignored, Sabotage::Uncounted];
}

/// Spoils datagram number `victim`, counted from 0 over all frames.
#[derive(Debug)]
pub struct SabotagedLink<L> {
    inner: L,
    sabotage: Sabotage,
    victim: u64,
    seen: u64,
    /// Bytes of the spoiled frame as they were sent, while it is on its way, and its datagram's offset.
    marked: Option<(Vec<u8>, usize)>,
}

impl<L> SabotagedLink<L> {
    pub fn new(inner: L, sabotage: Sabotage, victim: u64) -> Self {
        SabotagedLink { inner, sabotage, victim, seen: 0, marked: None }
    }

    /// Datagrams sent so far.
    pub fn seen(&self) -> u64 {
        self.seen
    }
}

fn offsets(frame: &[u8]) -> Vec<usize> {
    Datagrams::new(frame).unwrap().map(|datagram| datagram.unwrap().offset).collect()
}

impl<L: Link> Link for SabotagedLink<L> {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let offsets = offsets(frame);
        let first = self.seen;
        self.seen += offsets.len() as u64;
        let chosen = self.victim.checked_sub(first).and_then(|n| offsets.get(n as usize).copied());
        let Some(offset) = chosen else { return self.inner.send(frame) };
        match self.sabotage {
            Sabotage::LostOut => Ok(()),
            Sabotage::LostBack | Sabotage::Uncounted => {
                self.marked = Some((frame.to_vec(), offset));
                self.inner.send(frame)
            }
            Sabotage::Ignored => {
                self.marked = Some((frame.to_vec(), offset));
                let mut altered = frame.to_vec();
                altered[offset] = 0;
                self.inner.send(&altered)
            }
        }
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        loop {
            let Some(length) = self.inner.receive(buffer, deadline)? else { return Ok(None) };
            let Some((sent, offset)) = &self.marked else { return Ok(Some(length)) };
            // All datagrams of one frame carry the frame's index.
            if buffer[17] != sent[17] || length < sent.len() {
                return Ok(Some(length));
            }
            let (sent, offset) = (sent.clone(), *offset);
            self.marked = None;
            match self.sabotage {
                Sabotage::LostOut | Sabotage::LostBack => continue,
                Sabotage::Ignored => buffer[offset] = sent[offset],
                Sabotage::Uncounted => {
                    let data = usize::from(u16::from_le_bytes([sent[offset + 6], sent[offset + 7]]) & 0x7FF);
                    put_u16(buffer, offset + DATAGRAM_HEADER + data, 0);
                }
            }
            return Ok(Some(length));
        }
    }
}
