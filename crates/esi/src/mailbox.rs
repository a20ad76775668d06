//! Mailboxes and what is to be sent through them.

use crate::model::{Coe, InitCommand, Mailbox};
use crate::notes::Notes;
use crate::pdo::slot_index;
use crate::texts::short;
use crate::xml::{Element, quoted};

/// Longest data of a command, bytes.
const DATA_LIMIT: usize = 4096;
/// Commands of a device or module.
const COMMAND_LIMIT: usize = 4096;

/// A mailbox.
pub(crate) fn read(element: Element, notes: &mut Notes) -> Mailbox {
    let mut mailbox = Mailbox { data_link_layer: element.is("DataLinkLayer", notes), ..Mailbox::default() };
    for child in element.children(notes) {
        match child.name() {
            "CoE" => mailbox.coe = Some(coe(child, notes)),
            "EoE" => {
                mailbox.eoe = true;
                foreign_commands(child, &mut mailbox, notes);
            }
            "FoE" => {
                child.set_aside_children(notes);
                mailbox.foe = true;
            }
            "SoE" => {
                mailbox.soe = true;
                foreign_commands(child, &mut mailbox, notes);
            }
            "AoE" => mailbox.aoe = child.is_there(),
            "VoE" => mailbox.voe = child.is_there(),
            _ => child.skip(notes),
        }
    }
    mailbox
}

/// Commands of protocols that nothing here speaks: counted, each with its line.
fn foreign_commands(protocol: Element, mailbox: &mut Mailbox, notes: &mut Notes) {
    for child in protocol.children(notes) {
        if child.name() == "InitCmd" {
            mailbox.foreign_commands += 1;
        }
        child.skip(notes);
    }
}

fn coe(element: Element, notes: &mut Notes) -> Coe {
    let mut coe = Coe {
        sdo_info: element.is("SdoInfo", notes),
        pdo_assign: element.is("PdoAssign", notes),
        pdo_config: element.is("PdoConfig", notes),
        pdo_upload: element.is("PdoUpload", notes),
        complete_access: element.is("CompleteAccess", notes),
        segmented: element.is("SegmentedSdo", notes),
        diagnosis_history: element.is("DiagHistory", notes),
        commands: Vec::new(),
    };
    for child in element.children(notes) {
        match child.name() {
            "InitCmd" if coe.commands.len() == COMMAND_LIMIT => {
                child.problem(
                    format!("there are more than {COMMAND_LIMIT} commands: the rest is left out"),
                    notes,
                );
                break;
            }
            "InitCmd" => coe.commands.extend(command(child, notes)),
            _ => child.skip(notes),
        }
    }
    coe
}

/// A command; `None` where it can't be sent.
fn command(element: Element, notes: &mut Notes) -> Option<InitCommand> {
    let before = notes.told();
    let complete_access = element.is("CompleteAccess", notes);
    let mut command = InitCommand { line: element.line(), complete_access, ..InitCommand::default() };
    let mut data = None;
    for child in element.children(notes) {
        match child.name() {
            "Transition" => {
                let transition = child.text();
                let is_known =
                    transition.len() == 2 && transition.chars().all(|letter| "IPSOB".contains(letter));
                if is_known {
                    command.transitions.push(transition);
                } else {
                    let text =
                        format!("expected two of the letters I, P, S, O, B, found {}", quoted(&transition));
                    child.problem(text, notes);
                }
            }
            "Index" => command.index = slot_index(child, notes),
            "SubIndex" => command.subindex = child.u8(notes).unwrap_or(0),
            "Data" => {
                data = child.bytes(DATA_LIMIT, notes);
            }
            "Comment" => command.comment = short(child.text()),
            _ => child.skip(notes),
        }
    }
    let is_read = notes.told() == before;
    let whole = is_read && !command.transitions.is_empty() && command.index.index != 0 && data.is_some();
    if !whole {
        let what = if is_read { "lacks a transition, an index or data" } else { "can't be read whole" };
        element.problem(format!("the command {what}: it is left out"), notes);
    }
    command.data = data.unwrap_or_default();
    whole.then_some(command)
}
