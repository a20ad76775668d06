//! Against a small mailbox server that can be made to misbehave; written from the standard, not from the client.

mod losses;
mod server;
mod transfers;

use super::SdoAccess;
use super::*;
use crate::subdevice::MemoryArea;
use crate::wire::coe::ObjectAddress;
use crate::wire::{Address, Command};
use server::{Fate, STATION, Server, config, mailbox, object, run, run_with, upload, value};
